"""Offers: the runners that a plan may use, with their exact spelling, the likely ones first.

Which capabilities a task is likely to need is decided by comparing its words with their names and
descriptions. That is crude and needs no model: it decides what is left out when there is no room,
and nothing else.
"""

from __future__ import annotations

import math
import re
from collections import Counter
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
    from collections.abc import Iterable, Iterator, Sequence

    from gpsfsm.capabilities.library import Library
    from gpsfsm.model.capability import Input, Interface, Parameter, Provider

_MAX_TEXT = 600
_MAX_DETAIL = 160
_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|[^\W\d_a-zA-Z]+")
_PLACE = re.compile(r"\(\s*[-+]?\d+(?:\.\d*)?\s*,\s*[-+]?\d+(?:\.\d*)?\s*[,)]")
_STEM = 5
_IN_NAME, _IN_TEXT = 3.0, 1.0
_COORDINATES = 5.0
_ALIKE = (
    "move go drive travel navigate visit return bring waypoint position place location reach",
    "say speak speech tell announce greet inform voice talk",
    "listen hear transcribe audio speech ask answer",
    "look see watch image picture camera photo inspect view describe find detect recognise",
    "wait pause sleep delay second minute",
    "plan replan generate",
    "pose orientation where",
    "map occupancy grid obstacle",
    "mood sentiment feeling happy sad",
    "prompt ask think decide reason model",
    "web http url request server",
    "program command script process run",
)
_GROUPS = tuple(frozenset(word[:_STEM] for word in words.split()) for words in _ALIKE)
_COMMON = frozenset(
    word
    for words in (
        "a an the to of and or in on at it is be then if not can cannot for with from this that",
        "all as by runner robot capabilities",
    )
    for word in words.split()
)


@dataclass(frozen=True, slots=True)
class Offer:
    """One way to use a capability: ``name`` is what a plan writes as interface."""

    name: str
    interface: Interface
    provider: Provider

    def block(self, *, details: bool = True) -> str:
        """The text about it for the model; without ``details`` what it needs at least."""
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
        """The tag that a plan writes, with what it must give."""
        if self.provider.described:
            return clip(runner_line(self.name, self.provider), _MAX_TEXT)
        if self.provider.command:  # all that an older file tells
            return clip(" ".join(self.provider.command.split()), _MAX_TEXT)
        pair = f"interface={quoteattr(self.name)} provider={quoteattr(self.provider.name)}"
        return clip(f"<Runner {pair}/>", _MAX_TEXT)

    def _written(self) -> Iterator[Parameter]:
        arriving = {each.name for each in self.provider.inputs if not _writable(each)}
        for parameter in self.provider.configuration:
            if parameter.name not in arriving:
                yield parameter

    @property
    def arriving(self) -> list[str]:
        """The values that the step before must hand over."""
        inputs = self.provider.inputs
        return [each.name for each in inputs if each.required and not _writable(each)]

    def _flow(self) -> Iterator[str]:
        """Values that come from the step before, and go to the next one."""
        if self.arriving:
            names = ", ".join(self.arriving)
            yield f"- Must stand right behind a step that gives: {clip(names, _MAX_DETAIL)}"
        outputs = [
            f"{value.name} ({value.type.value or 'any'})"
            for value in self.provider.outputs
            if value.event is Event.SUCCEEDED and not value.status
        ]
        if outputs:
            yield f"- Gives to the next step: {clip(', '.join(outputs), _MAX_TEXT)}"
        if self.provider.outcomes.never_fails:
            yield "- Never fails"


def offers(library: Library, only: Sequence[str] = ()) -> tuple[Offer, ...]:
    """The runners that can be run, by name: described, or with the command that writes them.

    Deprecated ones are left out, the one that ends a plan, which no plan needs, and unless ``only``
    names them those that need what no runner hands over. ``only`` are patterns such as
    ``nav2_capabilities/*``; raises UsageError for one that matches nothing.
    """
    offered = []
    for name in library.interface_names:
        interface = library.interface(name)
        if interface is None or interface.deprecated or is_completion(name):
            continue
        offered += [
            Offer(name, interface, provider)
            for provider in library.providers_of(name)
            if not provider.deprecated and (provider.described or provider.command)
        ]
    if not only:
        handed = {each.name for offer in offered for each in offer.provider.outputs}
        is_any = any(not offer.provider.described for offer in offered)
        return tuple(each for each in offered if is_any or handed.issuperset(each.arriving))
    for pattern in only:
        if not any(_matches(offer.name, pattern) for offer in offered):
            raise UsageError(
                f"no capability matches '{pattern}'; 'gpsfsm capabilities list' shows all"
            )
    return tuple(
        offer for offer in offered if any(_matches(offer.name, pattern) for pattern in only)
    )


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
    description = f": {parameter.description}" if parameter.description else ""
    return f"{parameter.name} ({clip(kind, _MAX_DETAIL)}, {need}){clip(description, _MAX_DETAIL)}"


def ranked(task: str, offered: Sequence[Offer]) -> tuple[Offer, ...]:
    """The offers, what fits the task best first; by name where nothing tells them apart."""
    names = [Counter(_stems(offer.name)) for offer in offered]
    texts = [Counter(_stems(_text(offer))) for offer in offered]
    rarity = _rarity([{*name, *text} for name, text in zip(names, texts, strict=True)])
    wanted = _wanted(task)
    coordinates = _PLACE.search(task) is not None

    def score(place: int) -> float:
        total = sum(
            rarity[stem] * (_IN_NAME * (stem in names[place]) + _IN_TEXT * (stem in texts[place]))
            for stem in wanted
            if stem in rarity
        )
        if coordinates and _has_coordinates(offered[place]):
            total += _COORDINATES
        return total

    order = sorted(
        range(len(offered)), key=lambda place: (-round(score(place), 9), offered[place].name, place)
    )
    return tuple(offered[place] for place in order)


def _text(offer: Offer) -> str:
    provider = offer.provider
    parameters = (
        f"{parameter.name} {parameter.description}" for parameter in provider.configuration
    )
    return " ".join((offer.interface.description, provider.description, *parameters))


def _stems(text: str) -> Iterable[str]:
    for match in _WORD.finditer(text):
        word = match.group().lower()
        if word not in _COMMON:
            yield word[:_STEM]


def _wanted(task: str) -> list[str]:
    """The words of the task and what means about the same, sorted so that sums are reproducible."""
    stems = set(_stems(task))
    for group in _GROUPS:
        if stems & group:
            stems |= group
    return sorted(stems)


def _rarity(documents: Sequence[set[str]]) -> dict[str, float]:
    """A word that few descriptions have tells more."""
    counts = Counter(stem for stems in documents for stem in stems)
    return {stem: math.log(1 + len(documents) / count) for stem, count in counts.items()}


def _has_coordinates(offer: Offer) -> bool:
    names = {parameter.name for parameter in offer.provider.configuration if parameter.required}
    return {"x", "y"} <= names
