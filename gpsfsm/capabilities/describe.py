"""Capabilities by name, in words and as plain data: for the command line, models and runners."""

from __future__ import annotations

import json
import re
import textwrap
from dataclasses import asdict, dataclass
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any, NamedTuple
from xml.sax.saxutils import quoteattr

from gpsfsm.capabilities.defects import quoted
from gpsfsm.capabilities.files import has_place
from gpsfsm.capabilities.library import Match
from gpsfsm.errors import UsageError
from gpsfsm.model.capability import Input, Parameter, Provider, Source, Span, ValueType
from gpsfsm.model.event import Event
from gpsfsm.model.printable import clip, printable

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.capabilities.library import Library
    from gpsfsm.model.capability import Interface, Provider, SemanticInterface
    from gpsfsm.model.plan import Value

_MIN_WIDTH = 40
_MAX_NAME = 60
_SAMPLES: dict[ValueType, str] = {
    ValueType.BOOL: "false",
    ValueType.INT: "0",
    ValueType.DOUBLE: "0.0",
}

_PLAIN = re.compile(r"[A-Za-z]\w*/[A-Za-z]\w*", re.ASCII)
_NOTHING = ("definition:", "  configuration_parameters: []")
_MAX_HINTS = 3
_LIKE = 0.8  # so many names end in Runner that less is no likeness


@dataclass(frozen=True, slots=True)
class Capability:
    """The meaning of a name. ``name`` is how the library writes it.

    For an interface, ``providers`` are all that implement it, the default one first; for a
    semantic interface, ``interface`` is the one that it redefines; a provider stands alone only if
    no interface has its name.
    """

    name: str
    interface: Interface | None
    semantic: SemanticInterface | None
    providers: tuple[Provider, ...]


def find(library: Library, wanted: str) -> Capability:
    """The capability of a name: the full one, that of another dialect, or a unique bare one.

    Raises UsageError, with names that are near, if it means nothing or several things.
    """
    names = sorted({*library.interface_names, *(each.name for each in library.providers)})
    name = wanted if wanted in names else library.translation(wanted)
    if name is None and "/" not in wanted:
        name = _short(names, wanted)
    if name is None:
        raise UsageError(f"there is no capability {quoted(wanted)}; {_hint(names, wanted)}")
    semantic = next((each for each in library.semantic if each.name == name), None)
    interface = library.interface(name)
    alone = library.provider(name)
    providers = library.providers_of(name)
    if not providers and interface is None and semantic is None and alone is not None:
        providers = (alone,)
    return Capability(name, interface, semantic, providers)


def _short(names: list[str], wanted: str) -> str | None:
    fitting = [name for name in names if name.rpartition("/")[2] == wanted]
    if len(fitting) > 1:
        listed = " or ".join(map(quoted, fitting[:_MAX_HINTS]))
        raise UsageError(f"{quoted(wanted)} is the name of several capabilities; write {listed}")
    return fitting[0] if fitting else None


def _hint(names: list[str], wanted: str) -> str:
    bare = wanted.rpartition("/")[2].lower()
    shorts = {name.rpartition("/")[2].lower(): name for name in names}
    near = [shorts[match] for match in get_close_matches(bare, list(shorts), _MAX_HINTS, _LIKE)]
    near += [name for name in names if bare and bare in name.lower()]
    listed = list(dict.fromkeys(near))[:_MAX_HINTS]
    if listed:
        return f"did you mean {' or '.join(map(quoted, listed))}?"
    return "'gpsfsm capabilities list' lists them"


def family(origin: str) -> str:
    """The runner family of a built-in capability file; else the file itself."""
    parts = origin.split("/")
    return parts[1] if len(parts) == 5 and parts[0] == "runners" else origin


def list_data(library: Library) -> list[dict[str, Any]]:
    """Every name that a plan may write as interface, with its providers, sorted by name."""
    semantic = {entry.name: entry for entry in library.semantic}
    rows = []
    for name in library.interface_names:
        entry = semantic.get(name) or library.interface(name)
        assert entry is not None
        redefined = semantic[name].redefines if name in semantic else None
        interface = library.interface(name)
        rows.append(
            {
                "name": name,
                "redefines": redefined,
                "providers": [provider.name for provider in library.providers_of(name)],
                "deprecated": interface.deprecated if interface is not None else "",
                "family": family(entry.origin),
                "description": entry.description,
            }
        )
    return rows


def list_lines(library: Library) -> Iterator[str]:
    """One line per interface: name, family or file, providers."""
    rows = list_data(library)
    names = max((len(clip(row["name"], _MAX_NAME)) for row in rows), default=0)
    families = max((len(printable(row["family"])) for row in rows), default=0)
    for row in rows:
        providers = ", ".join(clip(name, _MAX_NAME) for name in row["providers"]) or "no provider"
        if row["redefines"]:
            providers += f" (redefines {clip(row['redefines'], _MAX_NAME)})"
        if row["deprecated"]:
            providers += " (deprecated)"
        start = f"{clip(row['name'], _MAX_NAME):{names}}  {printable(row['family']):{families}}"
        yield f"{start}  {providers}"


def show_data(capability: Capability) -> dict[str, Any]:
    """All that is known, with every field of the model."""
    return {
        "name": capability.name,
        "interface": _data(capability.interface),
        "semantic": _data(capability.semantic),
        "providers": [
            {
                **_data(provider),
                "runner_line": runner_line(_interface(capability, provider), provider),
            }
            for provider in capability.providers
        ],
    }


def show_lines(capability: Capability, width: int = 100) -> Iterator[str]:
    """All that people want to know, in lines of ``width`` columns where that is possible."""
    width = max(width, _MIN_WIDTH)
    kind = "interface" if capability.interface else "provider"
    yield f"{printable(capability.name)} ({'semantic interface' if capability.semantic else kind})"
    if capability.semantic is not None:
        yield from _wrapped(capability.semantic.description, width)
        yield f"Redefines: {printable(capability.semantic.redefines)}"
        yield f"File: {printable(capability.semantic.origin)}"
    elif capability.interface is not None:
        yield from _wrapped(capability.interface.description, width)
        yield f"File: {printable(capability.interface.origin)}"
    if capability.interface is not None and capability.interface.deprecated:
        yield from _wrapped(f"Deprecated: {capability.interface.deprecated}", width)
    if capability.interface is not None and capability.interface.formerly:
        yield from _wrapped(f"In other dialects: {', '.join(capability.interface.formerly)}", width)
    if not capability.providers:
        yield ""
        yield "No file describes a provider of it."
    for place, provider in enumerate(capability.providers):
        yield ""
        default = " (default)" if place == 0 and len(capability.providers) > 1 else ""
        yield f"Provider {printable(provider.name)}{default}"
        lines = _provider(provider, _interface(capability, provider), width - 2)
        yield from (f"  {line}".rstrip() for line in lines)


def _interface(capability: Capability, provider: Provider) -> str:
    """The interface that a plan writes for a provider of what was found."""
    alone = capability.interface is None and capability.semantic is None
    return provider.implements if alone else capability.name


def runner_line(interface: str, provider: Provider, *, everything: bool = False) -> str:
    """The tag of the runner in a plan, with the parameters that it must give, or all of them."""
    words = [f"interface={quoteattr(interface)}", f"provider={quoteattr(provider.name)}"]
    written = {value.name: value for value in provider.inputs}
    for parameter in provider.configuration:
        same = written.pop(parameter.name, None)
        needed = parameter.required if same is None else same.required and _writable(same)
        if needed or everything:
            words.append(f"{parameter.name}={quoteattr(_sample(parameter))}")
    for each in written.values():  # those that are no parameters
        if _writable(each) and (each.required or everything):
            words.append(f"{each.name}={quoteattr(_sample(Parameter(each.name, each.type)))}")
    return f"<Runner {' '.join(words)}/>"


def _provider(provider: Provider, interface: str, width: int) -> Iterator[str]:
    yield from _wrapped(provider.description, width)
    if provider.name != interface or provider.implements != interface:
        yield f"implements {printable(provider.implements)}"
    if provider.deprecated:
        yield from _wrapped(f"deprecated: {provider.deprecated}", width)
    if not provider.described:
        yield "parameters, inputs and outputs are not described"
    yield from _tables(provider, width)
    yield from map(printable, _facts(provider))
    yield f"file: {printable(provider.origin)}"
    short = runner_line(interface, provider)
    full = runner_line(interface, provider, everything=True)
    yield "in a plan:"
    yield f"  {printable(short)}"
    if full != short:
        yield "with all parameters:"
        yield f"  {printable(full)}"


def _tables(provider: Provider, width: int) -> Iterator[str]:
    parameters = [
        (each.name, each.type.value, _need(each.required, each.default), _detail(each))
        for each in provider.configuration
    ]
    yield from _table("parameters", parameters, width)
    inputs = []
    for each in provider.inputs:
        sources = ", ".join(each.satisfiable_from) or "upstream"
        also = f"Also called {', '.join(each.aliases)}. " if each.aliases else ""
        detail = f"{also}From {sources}. {each.description}"
        inputs.append((each.name, each.type.value, _need(each.required, each.default), detail))
    yield from _table("inputs", inputs, width)
    outputs = []
    for output in provider.outputs:
        when = "on failure" if output.event is Event.FAILED else "on success"
        notes = [when, *(["optional"] * output.optional), *(["status"] * output.status)]
        outputs.append((output.name, output.type.value, ", ".join(notes), output.description))
    yield from _table("outputs", outputs, width)


def _table(title: str, rows: Sequence[tuple[str, str, str, str]], width: int) -> Iterator[str]:
    """Three columns and a text that is wrapped below itself."""
    if not rows:
        return
    yield f"{title}:"
    cells = [tuple(map(printable, row)) for row in rows]
    sizes = [max(len(row[column]) for row in cells) for column in range(3)]
    for row in cells:
        start = "  " + "  ".join(f"{row[column]:{sizes[column]}}" for column in range(3))
        room = max(width - len(start) - 2, 30)
        lines = textwrap.wrap(row[3], room, break_long_words=False, break_on_hyphens=False)
        yield f"{start}  {lines[0] if lines else ''}".rstrip()
        yield from (" " * (len(start) + 2) + line for line in lines[1:])


def _writable(value: Input) -> bool:
    """True if a plan may write the input, which need not arrive then."""
    return any(source is not Source.UPSTREAM for source in value.satisfiable_from)


def _need(required: bool, default: Value | None) -> str:
    if default is not None:
        return f"= {_written(default)}" if default != "" else '= ""'
    return "required" if required else "optional"


def _detail(parameter: Parameter) -> str:
    parts = []
    if parameter.choices:
        parts.append(f"One of {', '.join(parameter.choices)}.")
    low, high = parameter.minimum, parameter.maximum
    if low is not None and high is not None:
        parts.append(f"From {low:g} to {high:g}.")
    elif low is not None:
        parts.append(f"At least {low:g}.")
    elif high is not None:
        parts.append(f"At most {high:g}.")
    if parameter.aliases:
        parts.append(f"Also called {', '.join(parameter.aliases)}.")
    return " ".join([*parts, parameter.description])


def _facts(provider: Provider) -> Iterator[str]:
    outcomes = provider.outcomes
    if outcomes.never_fails:
        unless = " or ".join(f"{name} is {_written(value)}" for name, value in outcomes.unless)
        yield f"never fails{f', unless {unless}' if unless else ''}"
    if outcomes.never_succeeds:
        yield "never succeeds"
    if outcomes.may_hang:
        yield "may hang"
    if provider.duration is not None:
        yield f"takes {_span(provider.duration, 's')}"
    if provider.energy is not None:
        yield f"uses {_span(provider.energy, 'J')}"
    if provider.resources:
        yield f"holds {', '.join(provider.resources)}"
    for interface, used in provider.depends_on:
        yield f"depends on {interface}{f' ({used})' if used else ''}"
    buffer = provider.effects.prompt_buffer
    if buffer is not None:
        yield f"fills the prompt buffer of {buffer.uuid}, or flushes it if {buffer.flush} is true"
    if provider.effects.sets_plan:
        yield f"makes {provider.effects.sets_plan} the next plan"
    if provider.effects.answers:
        yield f"succeeds whatever it answers in {provider.effects.answers}"
    if provider.effects.checks:
        yield f"succeeds if the answer to {provider.effects.checks} is yes, fails if it is no"


def _span(span: Span, unit: str) -> str:
    low = _amount(span.minimum, unit)
    if span.maximum is None:
        return f"at least {low}"
    return f"{low} to {_amount(span.maximum, unit)}"


def _amount(amount: float | str, unit: str) -> str:
    return f"{amount} (a parameter)" if isinstance(amount, str) else f"{amount:g} {unit}"


def _sample(parameter: Parameter) -> str:
    """A value of the right type: an integer for a double stops the original engine."""
    if parameter.default is not None:
        return _written(parameter.default)
    if parameter.choices:
        return parameter.choices[0]
    low, high = parameter.minimum, parameter.maximum
    bound = low if low is not None and low > 0 else high if high is not None and high < 0 else None
    if bound is not None:
        return _written(int(bound) if parameter.type is ValueType.INT else bound)
    return _SAMPLES.get(parameter.type, "…")


def _written(value: Value) -> str:
    """A value as a plan writes it."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _wrapped(text: str, width: int) -> list[str]:
    return textwrap.wrap(printable(text), width, break_long_words=False, break_on_hyphens=False)


# -- what is missing ------------------------------------------------------------------------


class LeastFile(NamedTuple):
    """A capability file to write below any folder; or, if it ``exists``, lines to add to it."""

    path: str
    lines: tuple[str, ...]
    exists: bool = False


def least_files(library: Library, interface: str, provider: str) -> list[LeastFile]:
    """The least that has to be written so that a runner is described.

    With it the library describes just this interface and provider. Empty if it does so already, or
    if no file can: where the provider is known as that of another interface, and where a name is
    not ``package/Name``, or would stand in a file that is hidden or elsewhere.
    """
    resolution = library.resolve(interface, provider)
    if resolution.match in (Match.DESCRIBED, Match.MISMATCH):
        return []
    if resolution.interface is not None:
        implemented = resolution.interface.name
    else:
        redefined = {each.name: each.redefines for each in library.semantic}
        implemented = redefined.get(interface, interface)
    own = resolution.provider or library.provider(provider)
    written = own.name if own is not None else provider or implemented
    implements = own.implements if own is not None else implemented
    if not all(map(has_place, (implemented, written, implements))):
        return []
    files = [] if resolution.interface is not None else [_least(implemented, "interface")]
    if own is None:
        files.append(_least(written, "provider", f"implements: {_scalar(implements)}", *_NOTHING))
    elif not own.described:
        files.append(LeastFile(own.origin, _NOTHING, exists=True))
    return files


def _least(name: str, kind: str, *more: str) -> LeastFile:
    package, _, bare = name.partition("/")
    lines = (f"name: {_scalar(name)}", f"spec_type: {kind}", "spec_version: 1.2", *more)
    return LeastFile(f"{package}/{kind}s/{bare}.yaml", lines)


def _scalar(text: str) -> str:
    return text if _PLAIN.fullmatch(text) else json.dumps(text, ensure_ascii=False)


def _data(entry: Any) -> Any:
    return None if entry is None else asdict(entry)


def specs(library: Library) -> tuple[str, ...]:
    """A text for each capability: what it does and how a plan writes it."""
    texts = []
    for name in library.interface_names:
        interface = library.interface(name)
        for provider in library.providers_of(name):
            about = "" if interface is None else interface.description
            texts.append(f"{name}: {about} {provider.command}".strip())
    return tuple(texts)
