"""Attributes: their names, the capabilities in them, and values spelt otherwise than their type."""

from __future__ import annotations

import re
from difflib import SequenceMatcher, get_close_matches
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.analysis.rules.names import Names, near, short
from gpsfsm.capabilities.library import namespace
from gpsfsm.compile.fabric_parameters import typed as typed_by_engine
from gpsfsm.fixing.fixer import Edit, Fix, Fixer, Safety
from gpsfsm.fixing.layout import attribute_edit, attribute_end, escaped, without_attribute
from gpsfsm.model.capability import ValueType
from gpsfsm.model.engine import OptionType
from gpsfsm.model.plan import ControlType, value_key
from gpsfsm.model.printable import clip
from gpsfsm.syntax.elements import control_type_hint, nearest_attribute
from gpsfsm.syntax.text import is_namespace_declaration, strip
from gpsfsm.syntax.token_reader import similar
from gpsfsm.syntax.values import decode_value, typed

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft, Node
    from gpsfsm.model.capability import Binding
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.plan import Element
    from gpsfsm.syntax.tokens import RawAttribute


_BOTH = ("interface", "provider")


def _attribute_names(draft: Draft) -> Iterator[Fix]:
    """A missing interface or provider: one fix per runner and attribute."""
    for node in draft.outline.nodes.values():
        if node.name != "Runner":
            continue
        for name in _BOTH:
            if node.attribute(name) is None:
                yield from _missing(draft, node, name)


def _missing(draft: Draft, node: Node, name: str) -> Iterator[Fix]:
    respelt = _respelt(node, name, _BOTH)
    if respelt is not None:
        yield respelt
        return
    beside = node.attribute(_BOTH[1 - _BOTH.index(name)])
    if beside is None:
        return
    twin = strip(decode_value(draft.text[beside.value_start : beside.value_end], 0, []))
    wanted, sure = _other(draft, name, twin)
    if not wanted:
        return
    place = attribute_end(draft.text, beside)
    edit = Edit(place, place, f' {name}="{escaped(wanted)}"')
    if name == "interface":
        edit = Edit(beside.start, beside.start, f'{name}="{escaped(wanted)}" ')
    safety = Safety.SAFE if sure else Safety.UNSAFE
    yield Fix("GP107", f"{name} added", node.start, (edit,), safety)


def _respelt(node: Node, name: str, others: tuple[str, ...]) -> Fix | None:
    """The attribute whose name is like ``name`` takes this name; ``others`` are never meant."""
    names = [raw.name for raw in node.tag.attributes if raw.name not in others]
    near = nearest_attribute(name, names)
    attribute = node.attribute(near) if near else None
    if attribute is None:
        return None
    edit = Edit(attribute.start, attribute.start + len(near), name)
    return Fix("GP107", f"'{near[:40]}' changed to '{name}'", node.start, (edit,))


def _other(draft: Draft, name: str, twin: str) -> tuple[str, bool]:
    """The provider of an interface, or the interface of a provider; whether it is the only one."""
    library = draft.library
    if name == "interface":
        provider = library.provider(twin)
        return (provider.implements, True) if provider else ("", False)
    here = library.translation(twin)
    providers = library.providers_of(here or twin)
    if not providers:
        return "", False
    return (twin if here else providers[0].name), len(providers) == 1


_ALLOWED = {"Plan": ("name",), "Control": ("type", "name")}


def _foreign_attributes(draft: Draft) -> Iterator[Fix]:
    """Attributes that mean nothing where they stand: one fix per element.

    An ID becomes the name that the element does not have.
    """
    for finding in draft.findings("GP112"):
        node = draft.around(draft.offset(finding))
        if node is None:
            continue
        changes = list(_edits(draft, node))
        title = clip(", ".join(each for each, _ in changes), 200)
        edits = tuple(edit for _, edit in changes)
        yield Fix("GP112", title, draft.offset(finding), edits)


def _edits(draft: Draft, node: Node) -> Iterator[tuple[str, Edit]]:
    """The changes: each in words that name what is lost, and its edit."""
    allowed = _ALLOWED.get(node.name)
    named = node.attribute("name") is not None
    for raw in node.tag.attributes:
        if allowed is None:
            if is_namespace_declaration(raw.name):
                yield _removed(draft, raw)
        elif raw.name.lower() == "id" and not named:
            named = True
            edit = Edit(raw.start, raw.start + len(raw.name), "name")
            yield f"'{clip(raw.name, 60)}' changed to 'name'", edit
        elif raw.name not in allowed:
            yield _removed(draft, raw)


def _removed(draft: Draft, raw: RawAttribute) -> tuple[str, Edit]:
    return f"ineffective '{clip(raw.name, 60)}' removed", without_attribute(draft, raw)


_TYPES = tuple(kind.value for kind in ControlType)
_PLAIN = {kind.replace("_", ""): kind for kind in _TYPES}
_HINTED = re.compile(r'type="([a-z_]+)"')
_SEQUENCES = ("sequence", "seq")


def _control_types(draft: Draft) -> Iterator[Fix]:
    """One fix per control whose type is missing or misspelt."""
    for node in draft.outline.nodes.values():
        if node.name != "Control":
            continue
        raw = node.attribute("type")
        if raw is None:
            respelt = _respelt(node, "type", ("name",))
            if respelt is not None:
                yield respelt
            continue
        written = draft.text[raw.value_start : raw.value_end]
        if written in _TYPES:
            continue
        meant, safety = _meant(written)
        if meant:
            edit = Edit(raw.value_start, raw.value_end, meant)
            yield Fix("GP106", f'type changed to "{meant}"', raw.start, (edit,), safety)


def _meant(written: str) -> tuple[str, Safety]:
    """The type that is meant, "" if nobody can tell."""
    word = re.sub(r"[\W_]", "", strip(written).lower()[:40])
    if word in _PLAIN:
        return _PLAIN[word], Safety.SAFE
    close = get_close_matches(word, _PLAIN, n=2, cutoff=0.85)
    if len(close) == 1:
        return _PLAIN[close[0]], Safety.SAFE
    if word in _SEQUENCES:
        return ControlType.SEQUENTIAL, Safety.SAFE
    hinted = _HINTED.findall(control_type_hint(written))
    return (hinted[0], Safety.UNSAFE) if len(hinted) == 1 else ("", Safety.UNSAFE)


def _parameter_names(draft: Draft) -> Iterator[Fix]:
    """Misspelt parameters: one fix per attribute, if the runner does not have it yet."""
    for at, raw, _, binding in draft.attributes("GP203"):
        if binding.provider.parameter(raw.name) is not None:
            continue
        meant = near(raw.name, _open(binding))
        if not meant:
            continue
        # A word among several (speech_text) is weaker evidence than a few wrong letters.
        sure = len(meant) > 1 and similar(raw.name, meant)
        sure |= raw.name.lower() == meant.lower()
        safety = Safety.SAFE if sure else Safety.UNSAFE
        edit = Edit(raw.start, raw.start + len(raw.name), meant)
        yield Fix("GP203", f"'{raw.name[:40]}' changed to '{meant}'", at, (edit,), safety)


def _open(binding: Binding) -> list[str]:
    """The parameters that the plan does not write, those that are needed first."""
    unwritten = [
        each for each in binding.provider.configuration if each.name not in binding.written
    ]
    return [each.name for each in sorted(unwritten, key=lambda each: not each.required)]


_MINUS = "\u2212\u2010\u2011\u2012\u2013\ufe63\uff0d"
_BOOLEANS = {"true": "true", "false": "false"}
_LONGEST = 60


def _parameter_values(draft: Draft) -> Iterator[Fix]:
    """Values that are spelt otherwise than their type is: one fix each."""
    for at, raw, value, binding in draft.attributes("GP205"):
        declared = binding.provider.parameter(raw.name)
        if declared is None or len(value) > _LONGEST:
            continue
        wanted = _spelt(value, declared.type)
        if wanted and wanted != value:
            title = f"{raw.name[:40]} changed to '{wanted}'"
            edit = attribute_edit(draft, raw, raw.name, wanted)
            yield Fix("GP205", title, at, (edit,))


def _spelt(value: str, wanted: ValueType) -> str:
    """The value as its type is written; "" if nobody can tell."""
    word = strip(value).strip("\u00a0")
    if wanted is ValueType.BOOL:
        return _BOOLEANS.get(word.lower(), "")
    if wanted in (ValueType.INT, ValueType.DOUBLE):
        number = "".join("-" if character in _MINUS else character for character in word)
        read = typed(number)
        whole = isinstance(read, int) and not isinstance(read, bool)
        return number if whole or (isinstance(read, float) and wanted is ValueType.DOUBLE) else ""
    return ""


_OPTION_TYPES = {
    ValueType.DOUBLE: OptionType.DOUBLE,
    ValueType.INT: OptionType.INT,
    ValueType.STRING: OptionType.STRING,
    ValueType.BOOL: OptionType.BOOL,
}
_BOOLS = {"true": "true", "1": "true", "false": "false", "0": "false"}


class Spelling(NamedTuple):
    """Another way to write a value. Not ``safe``: it is another value."""

    text: str
    safe: bool


def respelled(text: str, wanted: ValueType) -> Spelling | None:
    """The spelling of a value that fabric-v2 reads as ``wanted``; None if there is none.

    >>> respelled("1", ValueType.DOUBLE), respelled("42", ValueType.STRING)
    (Spelling(text='1.0', safe=True), Spelling(text='42 ', safe=False))
    >>> respelled("far", ValueType.DOUBLE)
    """
    if wanted is ValueType.STRING:
        new: str | None = text + " "
    elif wanted is ValueType.BOOL:
        new = _BOOLS.get(text.strip().lower())
    elif wanted is ValueType.DOUBLE:
        new = _double(text)
    else:
        new = _integer(text)
    if new is None or typed_by_engine("", new).type is not _OPTION_TYPES.get(wanted):
        return None
    return Spelling(new, value_key(typed(new)) == value_key(typed(text)))


def _double(text: str) -> str | None:
    """``1`` → ``1.0``."""
    value = typed(text.strip())
    if isinstance(value, bool | str):
        return None
    return f"{value}.0" if isinstance(value, int) else text.strip()


def _integer(text: str) -> str | None:
    """``1.0`` → ``1``."""
    value = typed(text.strip())
    if isinstance(value, bool | str):
        return None
    return str(int(value)) if isinstance(value, int) or value.is_integer() else None


def _engine_values(draft: Draft) -> Iterator[Fix]:
    """Values that an engine reads as another type than the runner takes: one fix each."""
    for at, raw, value, binding in draft.attributes("GP708"):
        declared = binding.provider.parameter(raw.name)
        new = respelled(value, declared.type) if declared and len(value) <= _LONGEST else None
        if new is not None:
            title = f"{raw.name[:40]} changed to '{new.text}'"
            safety = Safety.SAFE if new.safe else Safety.UNSAFE
            yield Fix("GP708", title, at, (attribute_edit(draft, raw, raw.name, new.text),), safety)


_NUMBER = re.compile(r"[+-]?[0-9.]+(?:[eE][+-]?[0-9]+)?")
_NUMBERS = (ValueType.DOUBLE, ValueType.INT)


def _packed_coordinates(draft: Draft) -> Iterator[Fix]:
    """Several numbers in one attribute: one fix each, where the provider says what is meant."""
    for at, raw, value, binding in draft.attributes("GP111"):
        numbers = _NUMBER.findall(value)
        names = _parameters(binding, raw.name, len(numbers))
        if names is None:
            continue
        written = " ".join(f'{n}="{v}"' for n, v in zip(names, numbers, strict=True))
        edit = Edit(raw.start, attribute_end(draft.text, raw), written)
        safety = Safety.SAFE if len(numbers) == 2 else Safety.UNSAFE
        yield Fix("GP111", f"'{raw.name[:40]}' split into {', '.join(names)}", at, (edit,), safety)


def _parameters(binding: Binding, written: str, count: int) -> list[str] | None:
    """The parameters that take the numbers: those that are needed, then the next ones.

    None if the plan gives one of them already, or the attribute is a number of its own.
    """
    provider = binding.provider
    numbers = [each for each in provider.configuration if each.type in _NUMBERS]
    needed = [each.name for each in numbers if each.required]
    if len(needed) != 2 or provider.input(written) is not None:
        return None
    same = provider.parameter(written)
    if same is not None and same.name not in needed:
        return None
    others = [each.name for each in numbers if not each.required]
    names = [*needed, *others][:count]
    taken = {name for name in binding.written if same is None or name != same.name}
    return None if len(names) < count or taken & set(names) else names


_NEAR = 0.8
_NEWEST = "fp_perception_capabilities"
"""The package of the newest published stack whose names differ from those of the library."""
_VERY_NEAR = 0.9


def _capability_names(draft: Draft) -> Iterator[Fix]:
    """Misspelt names, or of the wrong package: one fix for all runners that write the same."""
    names = Names(draft.library)
    for rule, propose in (("GP201", _interface), ("GP202", _provider), ("GP212", _foreign)):
        for finding, runner in draft.elements(rule):
            yield from propose(draft, names, finding, runner)


def _interface(draft: Draft, names: Names, finding: Finding, runner: Element) -> Iterator[Fix]:
    written = runner.interface
    implemented = names.implements(written)
    near = [implemented] if implemented else names.interfaces_near(written)
    if len(near) != 1:
        return
    safety = Safety.SAFE if _like(written, near[0]) else Safety.UNSAFE
    edits: list[Edit] = []
    for other in _same(draft, "interface", written):
        edits += _written(draft, other, "interface", near[0])
        # Where the provider has the same wrong name, it has it for the same reason.
        if other.provider == written:
            provider = draft.library.providers_of(near[0])
            edits += _written(draft, other, "provider", provider[0].name if provider else near[0])
    title = f"interface changed to {near[0]}"
    yield Fix("GP201", title, draft.offset(finding), tuple(edits), safety)


def _provider(draft: Draft, names: Names, finding: Finding, runner: Element) -> Iterator[Fix]:
    library, written = draft.library, runner.provider
    here = library.translation(runner.interface) or runner.interface
    described = library.providers_of(here)
    if not described:
        return
    wanted = described[0].name
    at = draft.offset(finding)
    if library.translation(runner.interface) and written == wanted:
        # The interface is the one that is spelt in another dialect.
        same = [each for each in _same(draft, "provider", written) if each.interface != here]
        edits = [e for each in same for e in _written(draft, each, "interface", here)]
        yield Fix("GP202", f"interface changed to {here}", at, tuple(edits))
        return
    alone = len(described) == 1
    other = names.implements(written)
    sure = alone and (_like(written, wanted) or other == here)
    same = [e for e in _same(draft, "provider", written) if e.interface == runner.interface]
    edits = [e for each in same for e in _written(draft, each, "provider", wanted)]
    safety = Safety.SAFE if sure else Safety.UNSAFE
    yield Fix("GP202", f"provider changed to {wanted}", at, tuple(edits), safety)


def _foreign(draft: Draft, names: Names, finding: Finding, runner: Element) -> Iterator[Fix]:
    """The interface of the provider, unless that of another one is nearer to what is written."""
    written, wanted = runner.interface, names.implements(runner.provider)
    near = names.interfaces_near(written)
    if near and wanted not in near:
        return
    safety = Safety.SAFE if _like(written, wanted) else Safety.UNSAFE
    same = [e for e in _same(draft, "interface", written) if e.provider == runner.provider]
    edits = [e for each in same for e in _written(draft, each, "interface", wanted)]
    title = f"interface changed to {wanted}"
    yield Fix("GP212", title, draft.offset(finding), tuple(edits), safety)


def _runners(draft: Draft) -> tuple[Element, ...]:
    assert draft.plan is not None, "the elements of findings are those of a plan"
    return draft.plan.runners


def _same(draft: Draft, name: str, written: str) -> list[Element]:
    return [runner for runner in _runners(draft) if runner.text(name) == written]


def _written(draft: Draft, runner: Element, name: str, wanted: str) -> Iterator[Edit]:
    node = draft.node(runner)
    raw = node.attribute(name) if node else None
    if raw is not None:
        yield attribute_edit(draft, raw, name, wanted)


def _like(written: str, wanted: str) -> bool:
    """True if two names differ in their package, in case, or by a few letters only."""
    mine, theirs = short(written).lower()[:80], short(wanted).lower()[:80]
    if SequenceMatcher(None, mine, theirs).ratio() >= _VERY_NEAR:
        return True
    # Most names end in Runner, which makes them more alike than they are.
    mine, theirs = mine.removesuffix("runner"), theirs.removesuffix("runner")
    return mine == theirs or SequenceMatcher(None, mine, theirs).ratio() >= _NEAR


def _old_names(draft: Draft) -> Iterator[Fix]:
    """The names of another dialect: one fix per pair of packages, as the rule has it."""
    library = draft.library
    for finding, first in draft.elements("GP208"):
        if draft.options.described.robot is None and namespace(first.interface) == _NEWEST:
            continue  # who has a robot of the newest stack must not be led back to an older one
        edits: list[Edit] = []
        packages = _packages(draft, first.interface)
        for runner in _runners(draft):
            here = library.translation(runner.interface)
            if here is None or _packages(draft, runner.interface) != packages:
                continue
            edits += _written(draft, runner, "interface", here)
            provider = library.translation(runner.provider)
            if provider is not None:
                edits += _written(draft, runner, "provider", provider)
        title = f"names of {packages[0] or 'another dialect'} translated"
        yield Fix("GP208", title, draft.offset(finding), tuple(edits), Safety.UNSAFE)


def _packages(draft: Draft, name: str) -> tuple[str, str]:
    return namespace(name), namespace(draft.library.translation(name) or name)


FIXERS = (
    Fixer(
        name="attribute-names",
        rules=("GP107",),
        propose=_attribute_names,
        safe=(
            "corrects `Interface` or `provder`, and adds the provider or interface if the "
            "capability files have only one that fits"
        ),
        unsafe="adds the default provider if several fit: another one may be meant",
    ),
    Fixer(
        name="foreign-attributes",
        rules=("GP112",),
        propose=_foreign_attributes,
        safe=(
            "removes attributes of `<Plan>` and `<Control>` that nothing reads, and renames `ID` "
            "to `name`: neither has any effect"
        ),
    ),
    Fixer(
        name="control-types",
        rules=("GP106", "GP107"),
        propose=_control_types,
        safe=(
            "corrects `Sequential`, `parallel-all` or `sequance`, and a misspelt name of the "
            "attribute `type`: only one of the four types resembles the word"
        ),
        unsafe=(
            "replaces a word from another language, such as `fallback`, by the nearest type: the "
            "contents may be arranged for that language"
        ),
    ),
    Fixer(
        name="parameter-names",
        rules=("GP203",),
        propose=_parameter_names,
        safe=(
            "corrects `Text` or `promt` to the spelling in the capability file if the runner does "
            "not have that parameter yet: a misspelt parameter is ignored"
        ),
        unsafe="renames `speech_text` to `text`, which is only a part of it",
    ),
    Fixer(
        name="parameter-values",
        rules=("GP205",),
        propose=_parameter_values,
        safe=(
            "writes `True` as `true`, and a number with spaces around it or a typographic minus as "
            "a plain number: the value is the same"
        ),
    ),
    Fixer(
        name="engine-values",
        rules=("GP708",),
        propose=_engine_values,
        safe=(
            "writes `1` as `1.0` if the engine of `--engine` would read an integer and the runner "
            "accepts only a double, and the like: the value is the same"
        ),
        unsafe="adds a space to digits that must be a string: the string changes",
    ),
    Fixer(
        name="packed-coordinates",
        rules=("GP111",),
        propose=_packed_coordinates,
        safe=(
            'splits `position="1, 3"` into `x="1" y="3"` if the provider needs exactly two numbers '
            "and the plan gives neither"
        ),
        unsafe="does the same with three numbers, the third of which may be a height or an angle",
    ),
    Fixer(
        name="capability-names",
        rules=("GP201", "GP202", "GP212"),
        propose=_capability_names,
        safe=(
            "corrects a name that resembles only one interface or provider: the package, the case "
            "or a few letters differ"
        ),
        unsafe=(
            "takes the only candidate although it resembles the name less: something else may be "
            "meant"
        ),
    ),
    Fixer(
        name="old-names",
        rules=("GP208",),
        propose=_old_names,
        unsafe=(
            "writes the names from the capability files: the plan means the same, but an executor "
            "of the older dialect does not know them"
        ),
    ),
)
