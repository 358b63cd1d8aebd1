"""What a model is offered: the runners that a plan may use, each with its exact spelling."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

from gpsfsm.capabilities.describe import runner_line
from gpsfsm.errors import UsageError
from gpsfsm.model.capability import Source
from gpsfsm.model.event import Event
from gpsfsm.model.printable import clip
from gpsfsm.syntax.elements import is_completion

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.capabilities.library import Library
    from gpsfsm.model.capability import Input, Interface, Parameter, Provider

__all__ = ["Offer", "closed", "offers"]

_MAX_TEXT = 600
_MAX_DETAIL = 160


@dataclass(frozen=True, slots=True)
class Offer:
    """One way to use a capability: ``name`` is what a plan writes as interface."""

    name: str
    interface: Interface
    provider: Provider

    def block(self, *, details: bool = True) -> str:
        """What the model is told about it; without ``details`` what it needs at least."""
        return "\n".join(self._lines(details))

    def _lines(self, details: bool) -> Iterator[str]:
        description = self.interface.description or self.provider.description
        yield f"## {clip(self.name, _MAX_TEXT)}"
        if description:
            yield clip(description, _MAX_TEXT if details else _MAX_DETAIL)
        yield self.line
        for parameter in self._written():
            if details or parameter.required:
                yield f"- {_parameter(parameter)}"
        if details:
            yield from self._flow()

    @property
    def line(self) -> str:
        """How a plan writes it, with what it must give."""
        if self.provider.described:
            return clip(runner_line(self.name, self.provider), _MAX_TEXT)
        if self.provider.command:  # all that an older file tells
            return clip(" ".join(self.provider.command.split()), _MAX_TEXT)
        pair = f"interface={quoteattr(self.name)} provider={quoteattr(self.provider.name)}"
        return clip(f"<Runner {pair}/>", _MAX_TEXT)

    def _written(self) -> Iterator[Parameter]:
        arriving = {found.name for found in self.provider.inputs if not _writable(found)}
        for parameter in self.provider.configuration:
            if parameter.name not in arriving:
                yield parameter

    def _flow(self) -> Iterator[str]:
        """Values that come from the step before, and go to the next one."""
        arriving = [
            found.name for found in self.provider.inputs if found.required and not _writable(found)
        ]
        if arriving:
            names = ", ".join(arriving)
            yield f"- Must stand right behind a step that gives: {clip(names, _MAX_DETAIL)}"
        given = [
            f"{found.name} ({found.type.value or 'any'})"
            for found in self.provider.outputs
            if found.event is Event.SUCCEEDED and not found.status
        ]
        if given:
            yield f"- Gives to the next step: {clip(', '.join(given), _MAX_TEXT)}"
        if self.provider.outcomes.never_fails:
            yield "- Never fails"


def offers(library: Library, only: Sequence[str] = ()) -> tuple[Offer, ...]:
    """The runners that can be run, by name: described, or with the command that writes them.

    Deprecated ones are left out, and the one that ends a plan, which no plan needs. ``only`` are
    patterns such as ``nav2_capabilities/*``; raises UsageError for one that
    matches nothing.
    """
    found = []
    for name in library.interface_names:
        interface = library.interface(name)
        if interface is None or interface.deprecated or is_completion(name):
            continue
        found += [
            Offer(name, interface, provider)
            for provider in library.providers_of(name)
            if not provider.deprecated and (provider.described or provider.command)
        ]
    if not only:
        return tuple(found)
    for pattern in only:
        if not any(_matches(offer.name, pattern) for offer in found):
            raise UsageError(
                f"no capability matches '{pattern}'; 'gpsfsm capabilities list' shows all"
            )
    return tuple(offer for offer in found if any(_matches(offer.name, pattern) for pattern in only))


def closed(library: Library, only: Sequence[str] = ()) -> Library:
    """The library by which to judge what a model has written: what was not offered is not there.

    Else a runner that nobody has described would be none of the check's business. ``only`` is as
    for ``offers``. What a small context had no room for may be used all the same.
    """
    if not only:
        return replace(library, complete=True)
    kept = {
        name
        for name in library.interface_names
        if is_completion(name) or any(_matches(name, pattern) for pattern in only)
    }
    semantic = tuple(each for each in library.semantic if each.name in kept)
    kept.update(each.redefines for each in semantic)
    return replace(
        library,
        interfaces=tuple(each for each in library.interfaces if each.name in kept),
        providers=tuple(
            each
            for each in library.providers
            if (library.translation(each.implements) or each.implements) in kept
        ),
        semantic=semantic,
        complete=True,
    )


def _matches(name: str, pattern: str) -> bool:
    return fnmatchcase(name, pattern) or name.rpartition("/")[2] == pattern


def _writable(value: Input) -> bool:
    return any(source is not Source.UPSTREAM for source in value.satisfiable_from)


def _parameter(parameter: Parameter) -> str:
    need = "required" if parameter.required else "optional"
    if parameter.default is not None and parameter.default != "":
        default = parameter.default
        need = f"default {str(default).lower() if isinstance(default, bool) else default}"
    kind = parameter.type.value or "any"
    if parameter.choices:
        kind = "one of " + ", ".join(parameter.choices)
    low, high = parameter.minimum, parameter.maximum
    if low is not None or high is not None:
        kind += f" from {'-inf' if low is None else f'{low:g}'}"
        kind += f" to {'inf' if high is None else f'{high:g}'}"
    told = f": {parameter.description}" if parameter.description else ""
    return f"{parameter.name} ({clip(kind, _MAX_DETAIL)}, {need}){clip(told, _MAX_DETAIL)}"
