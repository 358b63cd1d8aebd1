"""Steps → text: the tags as they were written, in the order of the steps, with their comments."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.fixing.layout import escaped, indentation, line_end
from gpsfsm.model.plan import ControlType, Kind
from gpsfsm.porting.trivia import About, Trivia, trivia_of
from gpsfsm.syntax.elements import is_completion
from gpsfsm.syntax.tinyxml.values import decode
from gpsfsm.syntax.tokens import Markup, StartTag

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.compile.units import Units
    from gpsfsm.fixing.elements import Piece
    from gpsfsm.model.plan import Plan
    from gpsfsm.porting.forms import Step

__all__ = ["Draft", "write"]

_NOTHING = About((), gap=False)
_ENCODING = re.compile(
    r"""\A(<\?xml[^>]*?)\s+encoding\s*=\s*(?:"(?!utf-?8")[^"]*"|'(?!utf-?8')[^']*')""",
    re.IGNORECASE,
)


class Draft(NamedTuple):
    """A new text; ``runners`` are, in its order, the elements of the plan that its runners were.

    ``dissolved`` are the controls of the plan that are not in it, although runners of theirs are.
    """

    text: str
    runners: tuple[int, ...]
    dissolved: tuple[int, ...] = ()


def write(
    text: str, tokens: Sequence[Piece], plan: Plan, units: Units, steps: Sequence[Step]
) -> Draft:
    """The plan with these steps only; what stands around ``<Plan>`` stays."""
    writer = _Writer(text, tokens, plan, units, steps)
    return Draft(writer.write(), tuple(writer.runners), writer.dissolved())


@dataclass(slots=True)
class _Line:
    """A tag on a line of its own; ``element`` is -1 for what the text does not have."""

    depth: int
    tag: str
    element: int = -1


@dataclass(slots=True)
class _Writer:
    text: str
    tokens: Sequence[Piece]
    plan: Plan
    units: Units
    steps: Sequence[Step]
    runners: list[int] = field(default_factory=list)
    _lines: list[_Line] = field(default_factory=list)
    _tags: dict[int, StartTag] = field(default_factory=dict)

    def write(self) -> str:
        self._tags = {tag.start: tag for tag in self.tokens if isinstance(tag, StartTag)}
        self._collect()
        kept = {line.element for line in self._lines if line.element >= 0}
        trivia = trivia_of(self.text, self.tokens, self.plan, kept)
        root = self.plan.elements[0]
        if trivia.close < 0:  # <Plan/>
            return _ENCODING.sub(r"\1", self._without_markup(0, len(self.text)))
        indent = indentation(self.text, root.start) or ""
        parts: list[str] = []
        if trivia.spread:
            end = line_end(self.text)
            pieces = self._spread(trivia, indent)
            parts = [*(f"{end}{piece}" if piece else end for piece in pieces), f"{end}{indent}"]
        else:
            for line in self._lines:
                about = trivia.of.get(line.element, _NOTHING)
                parts += [*about.before, line.tag, *about.after]
            parts += trivia.left
        # It is written as UTF-8, which is what an engine reads whatever is declared.
        head = _ENCODING.sub(r"\1", self._without_markup(0, root.end))
        return head + "".join(parts) + self._without_markup(trivia.close, len(self.text))

    def _without_markup(self, start: int, end: int) -> str:
        """A part of the text without instructions, which engines take at the beginning only."""
        parts: list[str] = []
        for token in self.tokens:
            if isinstance(token, Markup) and 0 < token.start >= start and token.end <= end:
                parts.append(self.text[start : token.start])
                start = token.end
        return "".join([*parts, self.text[start:end]])

    def dissolved(self) -> tuple[int, ...]:
        """The controls around runners that stay, without those that stay too."""
        around: set[int] = set()
        for runner in self.runners:
            parent = self.plan.elements[runner].parent
            while parent > 0 and parent not in around:
                around.add(parent)
                parent = self.plan.elements[parent].parent
        return tuple(sorted(around.difference(line.element for line in self._lines)))

    def _spread(self, trivia: Trivia, indent: str) -> Iterator[str]:
        """The lines between the tags of the plan."""
        for number, line in enumerate(self._lines):
            pad = indent + trivia.step * line.depth
            about = trivia.of.get(line.element, _NOTHING)
            if about.gap and number:
                yield ""
            for comment in about.before:
                yield pad + comment
            yield " ".join([pad + line.tag, *about.after])
        for comment in trivia.left:
            yield indent + trivia.step + comment

    def _collect(self) -> None:
        """All tags in their order."""
        open_: list[int] = []
        for step in self.steps:
            around = self._around(step.runners[0])
            same = 0
            while same < min(len(open_), len(around)) and open_[same] == around[same]:
                same += 1
            while len(open_) > same:
                open_.pop()
                self._lines.append(_Line(len(open_) + 1, "</Control>"))
            for element in around[same:]:
                self._lines.append(_Line(len(open_) + 1, self._slice(element), element))
                open_.append(element)
            self._step(step, len(open_) + 1)
        while open_:
            open_.pop()
            self._lines.append(_Line(len(open_) + 1, "</Control>"))
        if self._lines and self._completes(self._lines[-1].element):
            # As the last child of the plan it would be the completion, which engines append too.
            line = self._lines.pop()
            deeper = _Line(2, line.tag, line.element)
            opened, closed = _Line(1, '<Control type="sequential">'), _Line(1, "</Control>")
            self._lines += (opened, deeper, closed)

    def _completes(self, element: int) -> bool:
        """Whether a line is a completion runner; -1 is none."""
        return element >= 0 and is_completion(self.plan.elements[element].interface)

    def _step(self, step: Step, depth: int) -> None:
        first, *others = step.runners
        self._runner(first, depth)
        if not others:
            return
        element = self.plan.elements[step.recovery]
        if element.control_type is ControlType.RECOVERY:
            self._lines.append(_Line(depth, self._slice(element.index), element.index))
        else:
            name = element.text("name")
            label = f' name="{escaped(name)}"' if name is not None else ""
            self._lines.append(_Line(depth, f'<Control type="recovery"{label}>', element.index))
        for unit in others:
            self._runner(unit, depth + 1)
        self._lines.append(_Line(depth, "</Control>"))

    def _runner(self, unit: int, depth: int) -> None:
        element = self.units.elements[unit]
        self.runners.append(element)
        self._lines.append(_Line(depth, self._slice(element), element))

    def _around(self, unit: int) -> list[int]:
        """The sequential controls that stay around a unit, the outermost first."""
        found: list[int] = []
        parent = self.units.parents[unit]
        while parent > 0:
            element = self.plan.elements[self.units.elements[parent]]
            if element.control_type is ControlType.SEQUENTIAL:
                found.append(element.index)
            else:  # what is inside another control is no sequence of its own any more
                found.clear()
            parent = self.units.parents[parent]
        return found[::-1]

    def _slice(self, index: int) -> str:
        """The start tag as it was written, with values that the engine reads as they are meant."""
        element = self.plan.elements[index]
        tag = self._tags[element.start]
        parts: list[str] = []
        at = tag.start
        for raw in tag.attributes:
            value = element.text(raw.name)
            if value is None or decode(self.text[raw.value_start : raw.value_end]) == value:
                continue
            quote = self.text[raw.value_start - 1]
            written = escaped(value)
            parts += [
                self.text[at : raw.value_start],
                written.replace("'", "&apos;") if quote == "'" else written,
            ]
            at = raw.value_end
        whole = "".join([*parts, self.text[at : tag.end]])
        if element.kind is Kind.RUNNER and not tag.empty:
            whole = whole.removesuffix(">").rstrip() + "/>"
        return whole
