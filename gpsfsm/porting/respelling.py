"""Values that an engine reads as another type, spelt so that it does not (GP708, GP709)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.fixing.fixer import Edit, apply_edits
from gpsfsm.fixing.fixes.attributes import Spelling, respelled
from gpsfsm.fixing.layout import escaped
from gpsfsm.model.capability import ValueType
from gpsfsm.model.printable import clip
from gpsfsm.porting.result import Loss, Note
from gpsfsm.syntax.scan import scan
from gpsfsm.syntax.tokens import StartTag

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.compile.engine_text import EngineReading
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.plan import Attribute, Element
    from gpsfsm.porting.porter import Proof
    from gpsfsm.porting.reading import Source
    from gpsfsm.porting.writing import Draft
    from gpsfsm.syntax import Limits

_TYPES, _ALTERED = "GP708", "GP709"
_WORDS = {
    ValueType.DOUBLE: "a double",
    ValueType.INT: "an integer",
    ValueType.STRING: "a string",
    ValueType.BOOL: "a Boolean",
}
_MOST = 60


@dataclass(slots=True)
class Respelled:
    """The text with other spellings; ``losses``: values that change, or have no other spelling."""

    text: str
    notes: list[Note] = field(default_factory=list)
    losses: list[Loss] = field(default_factory=list)


class _Place(NamedTuple):
    """An attribute that a finding is about, and where it is in the text as given."""

    number: int
    element: Element
    attribute: Attribute
    line: int
    column: int


def respell(draft: Draft, proof: Proof, source: Source, engine: str, limits: Limits) -> Respelled:
    """Spell the values that kill runners so that they do not."""
    result = Respelled(draft.text)
    reading = proof.reading
    if reading is None or not any(each.rule == _TYPES for each in proof.findings):
        return result
    tags = {tag.start: tag for tag in scan(draft.text, limits) if isinstance(tag, StartTag)}
    edits: list[Edit] = []
    for place in _places(reading, proof.findings, _TYPES, draft, source):
        binding = reading.compiled.bindings[place.number]
        name, text = place.attribute.name, place.attribute.text
        declared = binding.provider.parameter(name) if binding else None
        if declared is None:
            continue
        new = respelled(text, declared.type)
        before = f'{name}="{clip(text, _MOST)}"'
        if new is not None:
            raw = next(raw for raw in tags[place.element.start].attributes if raw.name == name)
            written = escaped(new.text)
            if draft.text[raw.value_start - 1] == "'":
                written = written.replace("'", "&apos;")
            edits.append(Edit(raw.value_start, raw.value_end, written))
        if new is not None and new.safe:
            note = (
                f'{before} is changed to {name}="{clip(new.text, _MOST)}", which {engine} reads as '
            )
            result.notes.append(Note(place.line, place.column, note + _WORDS[declared.type]))
        else:
            lost = f"{engine} does not read {before} as {_WORDS[declared.type]}, and crashes on it"
            result.losses.append(Loss(place.line, place.column, lost, _instead(name, new)))
    result.text = apply_edits(draft.text, edits)
    return result


def _instead(name: str, new: Spelling | None) -> str:
    return "" if new is None else f'{name}="{clip(new.text, _MOST)}", which is a different value'


def altered(draft: Draft, proof: Proof, source: Source, engine: str) -> Iterator[Note]:
    """Notes on the values that the engine changes, which no spelling can prevent."""
    if proof.reading is None:
        return
    for place in _places(proof.reading, proof.findings, _ALTERED, draft, source):
        name = place.attribute.name
        passed = next(
            each.text for each in proof.reading.parameters[place.number] if each.name == name
        )
        yield Note(
            place.line,
            place.column,
            f'{engine} reads {name}="{clip(place.attribute.text, _MOST)}" as {passed}; this cannot '
            "be fixed",
        )


def _places(
    reading: EngineReading, findings: tuple[Finding, ...], code: str, draft: Draft, source: Source
) -> Iterator[_Place]:
    plan = reading.plan
    numbers = {plan.path(runner): number for number, runner in enumerate(plan.runners)}
    for finding in findings:
        if finding.rule != code:
            continue
        number = numbers[finding.location.element]
        element = plan.runners[number]
        at = finding.location.line, finding.location.column
        attribute = next(each for each in element.attributes if (each.line, each.column) == at)
        was = source.plan.elements[draft.runners[number]]
        line, column = source.place(was)
        if was.index not in source.places:
            written = next(each for each in was.attributes if each.name == attribute.name)
            line, column = written.line, written.column
        yield _Place(number, element, attribute, line, column)
