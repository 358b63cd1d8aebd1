"""Capabilities in words and as plain data, for the command line."""

from __future__ import annotations

import json
import re
import textwrap
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, NamedTuple
from xml.sax.saxutils import quoteattr

from gpsfsm.capabilities.library import Match
from gpsfsm.capabilities.naming import has_place
from gpsfsm.model.capability import Input, Parameter, Provider, Source, Span, ValueType
from gpsfsm.model.event import Event
from gpsfsm.model.printable import clip, printable

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.capabilities.library import Library
    from gpsfsm.capabilities.lookup import Found
    from gpsfsm.model.plan import Value

__all__ = [
    "LeastFile",
    "family",
    "least_files",
    "list_data",
    "list_lines",
    "runner_line",
    "show_data",
    "show_lines",
]

_MIN_WIDTH = 40
_MAX_NAME = 60
_SAMPLES: dict[ValueType, str] = {
    ValueType.BOOL: "false",
    ValueType.INT: "0",
    ValueType.DOUBLE: "0.0",
}


def family(origin: str) -> str:
    """The runner family of a built-in capability file; else the file itself."""
    parts = origin.split("/")
    return parts[1] if len(parts) == 5 and parts[0] == "runners" else origin


def list_data(library: Library) -> list[dict[str, Any]]:
    """Every name that a plan may write as interface, with its providers, sorted by name."""
    semantic = {found.name: found for found in library.semantic}
    rows = []
    for name in library.interface_names:
        found = semantic.get(name) or library.interface(name)
        assert found is not None
        redefined = semantic[name].redefines if name in semantic else None
        interface = library.interface(name)
        rows.append(
            {
                "name": name,
                "redefines": redefined,
                "providers": [provider.name for provider in library.providers_of(name)],
                "deprecated": interface.deprecated if interface is not None else "",
                "family": family(found.origin),
                "description": found.description,
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


def show_data(found: Found) -> dict[str, Any]:
    """All that is known, with every field of the model."""
    return {
        "name": found.name,
        "interface": _data(found.interface),
        "semantic": _data(found.semantic),
        "providers": [
            {**_data(provider), "runner_line": runner_line(_interface(found, provider), provider)}
            for provider in found.providers
        ],
    }


def show_lines(found: Found, width: int = 100) -> Iterator[str]:
    """All that people want to know, in lines of ``width`` columns where that is possible."""
    width = max(width, _MIN_WIDTH)
    kind = "interface" if found.interface else "provider"
    yield f"{printable(found.name)} ({'semantic interface' if found.semantic else kind})"
    if found.semantic is not None:
        yield from _wrapped(found.semantic.description, width)
        yield f"Redefines: {printable(found.semantic.redefines)}"
        yield f"File: {printable(found.semantic.origin)}"
    elif found.interface is not None:
        yield from _wrapped(found.interface.description, width)
        yield f"File: {printable(found.interface.origin)}"
    if found.interface is not None and found.interface.deprecated:
        yield from _wrapped(f"Deprecated: {found.interface.deprecated}", width)
    if found.interface is not None and found.interface.formerly:
        yield from _wrapped(f"In other dialects: {', '.join(found.interface.formerly)}", width)
    if not found.providers:
        yield ""
        yield "No file describes a provider of it."
    for place, provider in enumerate(found.providers):
        yield ""
        default = " (default)" if place == 0 and len(found.providers) > 1 else ""
        yield f"Provider {printable(provider.name)}{default}"
        lines = _provider(provider, _interface(found, provider), width - 2)
        yield from (f"  {line}".rstrip() for line in lines)


def _interface(found: Found, provider: Provider) -> str:
    """The interface that a plan writes for a provider of what was found."""
    alone = found.interface is None and found.semantic is None
    return provider.implements if alone else found.name


def runner_line(interface: str, provider: Provider, *, everything: bool = False) -> str:
    """How a plan writes the runner, with the parameters that it must give, or all of them."""
    words = [f"interface={quoteattr(interface)}", f"provider={quoteattr(provider.name)}"]
    written = {found.name: found for found in provider.inputs}
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
    for found in provider.outputs:
        when = "on failure" if found.event is Event.FAILED else "on success"
        notes = [when, *(["optional"] * found.optional), *(["status"] * found.status)]
        outputs.append((found.name, found.type.value, ", ".join(notes), found.description))
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
    """Whether a plan may write the input, which need not arrive then."""
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

_PLAIN = re.compile(r"[A-Za-z]\w*/[A-Za-z]\w*", re.ASCII)


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
    found = library.resolve(interface, provider)
    if found.match in (Match.DESCRIBED, Match.MISMATCH):
        return []
    if found.interface is not None:
        implemented = found.interface.name
    else:
        redefined = {each.name: each.redefines for each in library.semantic}
        implemented = redefined.get(interface, interface)
    own = found.provider or library.provider(provider)
    written = own.name if own is not None else provider or implemented
    implements = own.implements if own is not None else implemented
    if not all(map(has_place, (implemented, written, implements))):
        return []
    files = [] if found.interface is not None else [_least(implemented, "interface")]
    if own is None:
        files.append(_least(written, "provider", f"implements: {_scalar(implements)}", *_NOTHING))
    elif not own.described:
        files.append(LeastFile(own.origin, _NOTHING, exists=True))
    return files


_NOTHING = ("definition:", "  configuration_parameters: []")


def _least(name: str, kind: str, *more: str) -> LeastFile:
    package, _, bare = name.partition("/")
    lines = (f"name: {_scalar(name)}", f"spec_type: {kind}", "spec_version: 1.2", *more)
    return LeastFile(f"{package}/{kind}s/{bare}.yaml", lines)


def _scalar(text: str) -> str:
    return text if _PLAIN.fullmatch(text) else json.dumps(text, ensure_ascii=False)


def _data(entry: Any) -> Any:
    return None if entry is None else asdict(entry)
