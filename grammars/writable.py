"""The runners that a grammar of plans can allow, and how they are written."""

from __future__ import annotations

from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

from gpsfsm.errors import UsageError
from gpsfsm.grammars.forms import Form, form_of, is_plain
from gpsfsm.model.capability import Source
from gpsfsm.model.plan import NOT_PARAMETERS, Attribute, Element, Kind
from gpsfsm.model.printable import clip
from gpsfsm.syntax.elements import is_completion
from gpsfsm.syntax.text import NAME

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from gpsfsm.capabilities.library import Library
    from gpsfsm.model.capability import Input, Parameter, Provider

_MAX_SHOWN = 80


@dataclass(frozen=True, slots=True)
class Slot:
    """A parameter as a plan gives it: its name there, which values it takes, whether it must."""

    name: str
    form: Form
    required: bool


@dataclass(frozen=True, slots=True)
class Writable:
    """A runner that plans may hold: interface and provider as they are written, and parameters."""

    interface: str
    provider: str
    slots: tuple[Slot, ...]


@dataclass(frozen=True, slots=True)
class LeftOut:
    """A runner that no grammar allows, and why."""

    name: str
    why: str


@dataclass(frozen=True, slots=True)
class Alphabet:
    """The runners that a grammar allows, by name, and those that it does not."""

    runners: tuple[Writable, ...]
    left_out: tuple[LeftOut, ...]


def alphabet(library: Library, only: Sequence[str] | None = None) -> Alphabet:
    """The alphabet of plans over a library.

    ``only`` are names of interfaces, with or without their package, or patterns as in file names:
    ``nav2_capabilities/*``. Raises UsageError for one that matches nothing, and if no runner is
    left.
    """
    left_out: list[LeftOut] = []
    kept: list[tuple[str, Provider]] = []
    for name in _chosen(library, only):
        for provider, why in _candidates(library, name):
            if why:
                left_out.append(LeftOut(name, why))
            elif provider is not None:
                kept.append((name, provider))
    outputs = {output.name for _, provider in kept for output in provider.outputs}
    runners = []
    for name, provider in kept:
        slots, lacking = _slots(provider, outputs)
        if lacking:
            why = f"nothing can be written for its parameter '{clip(lacking, _MAX_SHOWN)}'"
            left_out.append(LeftOut(name, why))
        else:
            runners.append(Writable(name, provider.name, slots))
    if not runners:
        raise UsageError(_nothing_left(left_out))
    return Alphabet(tuple(runners), tuple(left_out))


def _nothing_left(left_out: Sequence[LeftOut]) -> str:
    if not left_out:
        return "there is no capability, so there is no plan that a grammar could allow"
    first = left_out[0]
    more = f" (and {len(left_out) - 1} more)" if len(left_out) > 1 else ""
    return (
        f"a grammar can allow none of the capabilities: {clip(first.name, _MAX_SHOWN)} is left "
        f"out{more}, because {first.why}"
    )


def _chosen(library: Library, only: Sequence[str] | None) -> Sequence[str]:
    names = library.interface_names
    if only is None:
        return names
    for pattern in only:
        if not any(_matches(name, pattern) for name in names):
            raise UsageError(
                f"no capability matches '{clip(pattern, _MAX_SHOWN)}'; "
                "'gpsfsm capabilities list' shows all"
            )
    return [name for name in names if any(_matches(name, pattern) for pattern in only)]


def _matches(name: str, pattern: str) -> bool:
    return pattern in (name, name.rpartition("/")[2]) or fnmatchcase(name, pattern)


def _candidates(library: Library, name: str) -> Iterator[tuple[Provider | None, str]]:
    """The providers of an interface, each with the reason why it is left out ("": it is not)."""
    interface = library.interface(name)
    providers = library.providers_of(name)
    if interface is None or not providers:
        yield None, "no provider of it is described"
    elif interface.deprecated:
        yield None, "it is deprecated"
    elif is_completion(name):
        yield None, "a plan completes by itself"
    else:
        for provider in providers:
            yield provider, _objection(library, name, provider)


def _objection(library: Library, name: str, provider: Provider) -> str:
    if provider.deprecated:
        return "its provider is deprecated"
    if not provider.described:
        return "its file does not say which parameters there are"
    if not is_plain(name + provider.name) or not (name.strip() and provider.name.strip()):
        return "its name cannot be written"
    attributes = tuple(
        Attribute(key, text, text, 1, 1)
        for key, text in (("interface", name), ("provider", provider.name))
    )
    written = Element(1, Kind.RUNNER, 0, 1, (), attributes, 1, 1, 0, 0)
    binding = library.bind(written)
    if binding is None or binding.provider.name != provider.name:
        return "its provider has the name of something else"
    return ""


def _slots(provider: Provider, outputs: Collection[str]) -> tuple[tuple[Slot, ...], str]:
    """The slots that can be written, and the name of a required parameter that cannot be."""
    slots: dict[str, Slot] = {}
    for parameter in provider.configuration:
        required = _is_required(provider, parameter, outputs)
        form = form_of(parameter, provider)
        spelt = next(
            (
                name
                for name in (parameter.name, *parameter.aliases)
                if _is_attribute(name)
                and name not in slots
                and provider.parameter(name) is parameter
            ),
            "",
        )
        if form is not None and spelt:
            slots[spelt] = Slot(spelt, form, required)
        elif required:
            return (), parameter.name
    for expected in provider.inputs:
        if not _may_be_written(expected) or provider.parameter(expected.name) is not None:
            continue
        required = _is_required(provider, expected, outputs)
        form = form_of(expected, provider)
        if form is not None and _is_attribute(expected.name):
            slots[expected.name] = Slot(expected.name, form, required)
        elif required:
            return (), expected.name
    return tuple(slots.values()), ""


def _is_attribute(name: str) -> bool:
    """True if a plan can give a parameter of this name: ``xml…`` is reserved, ``p:x`` no name."""
    return (
        NAME.fullmatch(name) is not None
        and name.isprintable()
        and ":" not in name
        and not name.lower().startswith("xml")
        and name not in NOT_PARAMETERS
    )


def _may_be_written(expected: Input) -> bool:
    return bool({Source.CONFIGURATION, Source.EXTERNAL} & set(expected.satisfiable_from))


def _is_required(
    provider: Provider, parameter: Parameter | Input, outputs: Collection[str]
) -> bool:
    """True if a plan has to write this parameter.

    It may leave out what has a default, what some runner can hand over, and what would not be read.
    """
    expected = provider.input(parameter.name)
    if expected is None:
        return parameter.required and parameter.default is None
    if not expected.required or expected.default is not None or not _may_be_written(expected):
        return False
    if Source.CONFIGURATION in expected.satisfiable_from:
        fallback = provider.parameter(expected.fallback or expected.name)
        if fallback is not None and fallback.default is not None:
            return False
    return Source.UPSTREAM not in expected.satisfiable_from or parameter.name not in outputs
