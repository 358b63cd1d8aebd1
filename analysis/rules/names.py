"""Names of interfaces, providers and parameters in plans: their status, and near names.

Looking for near names takes time, so only the first few unknown names of a plan get any; hostile
plans are full of them.
"""

from __future__ import annotations

import shlex
from difflib import get_close_matches
from enum import StrEnum
from functools import cached_property
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from gpsfsm.analysis.flow import placeholder
from gpsfsm.capabilities.library import Library, Match, namespace
from gpsfsm.model.capability import Binding, Input, Parameter, Permission, ValueType
from gpsfsm.model.finding import Related
from gpsfsm.model.plan import NOT_PARAMETERS
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from gpsfsm.analysis.context import Context
    from gpsfsm.model.plan import Attribute, Element, Location

MAX_RELATED = 20
"""Related places of one finding."""

_MAX_LOOKUPS = 100
_MAX_NAME = 80


class Status(StrEnum):
    """The knowledge of the library about a runner's interface and provider.

    BOUND: bound. NAMELESS: one of them is missing, which GP107 reports. NO_…: it does not exist.
    NEAR_…: it is not known, and reads like a misspelt name, or its package has others. FOREIGN: the
    interface is not known, and the provider is one of another interface. UNDESCRIBED: no file tells
    anything.
    """

    BOUND = "bound"
    NAMELESS = "nameless"
    NO_INTERFACE = "no interface"
    NEAR_INTERFACE = "near interface"
    FOREIGN = "foreign"
    NO_PROVIDER = "no provider"
    NEAR_PROVIDER = "near provider"
    UNDESCRIBED = "undescribed"


Survey = dict[Status, dict[tuple[str, str], list[int]]]
"""By status, then by interface and provider as written: runner numbers; all in document order."""


def survey(context: Context) -> Survey:
    """The runners of a plan by their status."""
    names = Names(context.capabilities.library)
    pairs: dict[tuple[str, str], tuple[Status, list[int]]] = {}
    for number, runner in enumerate(context.plan.runners):
        pair = runner.interface, runner.provider
        if pair not in pairs:
            bound = context.bindings[number] is not None
            pairs[pair] = (Status.BOUND if bound else names.status(*pair), [])
        pairs[pair][1].append(number)
    result: Survey = {status: {} for status in Status}
    for pair, (status, numbers) in pairs.items():
        result[status][pair] = numbers
    return result


class Names:
    """The names that a library knows, and those near to a name that it does not know."""

    def __init__(self, library: Library) -> None:
        self.library = library
        self._lookups = _MAX_LOOKUPS

    def status(self, interface: str, provider: str) -> Status:
        """The status of a runner that is not bound."""
        library = self.library
        if not interface.strip():
            return Status.NAMELESS
        resolution = library.resolve(interface, provider)
        if resolution.interface is None:
            status = self._without_interface(interface)
            mixed = resolution.match is Match.MISMATCH and status is not Status.NO_INTERFACE
            return Status.FOREIGN if mixed else status
        if not provider.strip():
            return Status.NAMELESS
        if resolution.match is Match.MISMATCH:
            return Status.NO_PROVIDER
        implementing = library.providers_of(resolution.interface.name)
        if resolution.implements or resolution.provider is not None:
            return Status.UNDESCRIBED  # its file says nothing of parameters
        if not implementing and not library.complete:
            return Status.UNDESCRIBED
        if library.complete or namespace(provider) in library.namespaces:
            return Status.NO_PROVIDER
        names = [each.name for each in implementing]
        return Status.NEAR_PROVIDER if self._misspelt(provider, names) else Status.UNDESCRIBED

    def _without_interface(self, interface: str) -> Status:
        library = self.library
        if interface in self._current:
            return Status.UNDESCRIBED  # a semantic interface of something that is not here
        if library.complete or self.implements(interface):
            return Status.NO_INTERFACE
        same = self._same(interface)
        if namespace(interface) in library.namespaces:
            wrong = same or self._near_in_package(interface)
            return Status.NO_INTERFACE if wrong else Status.NEAR_INTERFACE
        return Status.NEAR_INTERFACE if self._misspelt(interface, same) else Status.UNDESCRIBED

    def implements(self, provider: str) -> str:
        """The interface that a provider implements, under its name here; "" if it is not known."""
        return self.library.implemented(provider)

    def namesakes(self, interface: str) -> list[str]:
        """Up to three interfaces of other packages with the same short name."""
        return [name for name in self._first(self._same(interface)) if name != interface]

    def interfaces_near(self, interface: str) -> list[str]:
        """Up to three interfaces that may be meant, under their names here, nearest first."""
        same = self._same(interface)
        if same or self._lookups <= 0:
            return self._first(same)
        self._lookups -= 1
        near_words = get_close_matches(_word(interface), self._by_short_name, n=3, cutoff=0.75)
        package = namespace(interface)
        near = [
            name
            for word in near_words
            for name in sorted(
                self._by_short_name[word], key=lambda name: namespace(name) != package
            )
        ]
        return self._first(near)

    def _same(self, interface: str) -> Sequence[str]:
        return self._by_short_name.get(_word(interface), ())

    def _first(self, names: Iterable[str]) -> list[str]:
        """The first three, under their names here."""
        here = (self.library.translation(name) or name for name in names)
        return list(dict.fromkeys(here))[:3]

    def _near_in_package(self, interface: str) -> bool:
        """True if the package has a runner whose name differs by a few letters."""
        if self._lookups <= 0:
            return False
        self._lookups -= 1
        package = namespace(interface)
        words = {_stem(name) for name in self._current if namespace(name) == package}
        return bool(get_close_matches(_stem(interface)[:_MAX_NAME], sorted(words), cutoff=0.8))

    def _misspelt(self, name: str, candidates: Iterable[str]) -> bool:
        """True if a name differs from a candidate in its package only, and by a few letters."""
        same = {namespace(each) for each in candidates if _word(each) == _word(name)}
        if not same:
            return False
        if "/" not in name:
            return True
        if self._lookups <= 0:
            return False
        self._lookups -= 1
        return bool(get_close_matches(namespace(name)[:_MAX_NAME], sorted(same), cutoff=0.8))

    @cached_property
    def _current(self) -> Mapping[str, None]:
        return dict.fromkeys(self.library.interface_names)

    @cached_property
    def _by_short_name(self) -> Mapping[str, Sequence[str]]:
        """All names of interfaces, those of other dialects last, by what tells them apart."""
        names: dict[str, list[str]] = {}
        former = [name for interface in self.library.interfaces for name in interface.formerly]
        for name in (*self.library.interface_names, *sorted(former)):
            names.setdefault(_word(name), []).append(name)
        return names


def _word(name: str) -> str:
    """The part that tells names apart: ``waypoint`` of ``nav2_capabilities/WaypointRunner``."""
    return short(name)[:_MAX_NAME].lower().removesuffix("runner")


def mixes_dialects(library: Library, runners: Iterable[Element]) -> bool:
    """True if the runners of a plan have names of several published stacks.

    The packages of one stack begin with the same word, up to the underscore. A name belongs to an
    older or newer stack if it means one that has another name here. Such a stack is mixed with
    another one if some runner of the plan that has a name there is written otherwise:

        capabilities2_runner_nav2/WaypointRunner, nav2_capabilities/RobotPoseRunner   mixed
        fp_perception_capabilities/SpeechRunner, nav2_capabilities/WaypointRunner     one stack
    """
    names = dict.fromkeys(runner.interface for runner in runners)
    stacks = {_stack(name) for name in names if library.translation(name) is not None}
    if not stacks:
        return False
    for name in names:
        described = library.interface(library.translation(name) or name)
        if described is None:
            continue
        own = _stack(name) if library.translation(name) is not None else ""
        theirs = {_stack(former) for former in described.formerly}
        if any(stack != own for stack in stacks & theirs):
            return True
    return False


def _stack(name: str) -> str:
    return namespace(name).partition("_")[0]


def not_permitted(
    binding: Binding, permission: Permission, name: str, allowed: Sequence[str]
) -> str:
    """The reason why a runner must not reach what its parameter ``name`` says; "" if it may."""
    what = _REACHES[permission]
    attribute = binding.written.get(name)
    if not allowed:
        shown = f": {written(attribute)}" if attribute else ""
        return f"{what} without permission{shown}"
    value = binding.value(name)
    text = value if isinstance(value, str) else "" if attribute is None else attribute.text
    if text and not any(_reaches(permission, text, each) for each in allowed):
        return f"{what} that is not permitted: {quoted(text)}"
    if not binding.settled(name):
        return f"{what}, but the step before may replace the {quoted(name)} that is written here"
    return "" if text else f"{what}, but the plan does not say which"


_REACHES = {
    Permission.PROGRAM: "starts a program",
    Permission.HOST: "calls a URL",
    Permission.FUNCTION: "calls a function",
}


def _reaches(permission: Permission, text: str, allowed: str) -> bool:
    """True if a text names what is allowed, as the runner itself will decide it."""
    if permission is Permission.PROGRAM:
        try:
            return shlex.split(text)[:1] == [allowed]
        except ValueError:
            return False
    if permission is Permission.FUNCTION:
        return text == allowed
    try:
        url = urlsplit(text)
        if url.scheme not in _PORTS or not url.hostname or "@" in url.netloc or "\\" in text:
            return False
        host, port = url.hostname.lower(), url.port or _PORTS[url.scheme]
    except ValueError:
        return False
    host = f"[{host}]" if ":" in host else host
    return allowed.lower() in (host, f"{host}:{port}")


_PORTS = {"http": 80, "https": 443}


# -- parameters -----------------------------------------------------------------------------


def _stem(name: str) -> str:
    """The part that tells names apart: most of them end in Runner."""
    return _word(name).removesuffix("runner").removesuffix("Runner")


def is_label(name: str) -> bool:
    """True if an attribute of a runner is no parameter: a name, or one that GP112 reports."""
    return name in NOT_PARAMETERS or ":" in name or name == "xmlns"


def is_placeholder(attribute: Attribute) -> bool:
    """True if an attribute is a placeholder beyond doubt, which GP207 reports."""
    named = placeholder(attribute.text)
    return named is not None and named.certain


def bound_parameters(
    context: Context,
) -> Iterator[tuple[int, Binding, Attribute, Parameter | Input]]:
    """The attributes of described runners that count, in document order.

    Their providers know them. Of two names for one parameter only one is read; GP203 tells that.
    """
    for number, binding in enumerate(context.bindings):
        if binding is None:
            continue
        provider = binding.provider
        for attribute in context.runner(number).attributes:
            if is_label(attribute.name):
                continue
            parameter = provider.parameter(attribute.name) or provider.input(attribute.name)
            if parameter is not None and binding.written.get(parameter.name) is attribute:
                yield number, binding, attribute, parameter


def expected_type(binding: Binding, parameter: Parameter | Input) -> ValueType:
    """The type of a parameter; where its file does not say, that of the input of this name."""
    if parameter.type is ValueType.ANY:
        expected = binding.provider.input(parameter.name)
        return ValueType.ANY if expected is None else expected.type
    return parameter.type


def near(name: str, candidates: Sequence[str]) -> str:
    """The candidate that is probably meant by a name, or "".

    >>> near("speech_text", ["uuid", "text"]), near("Text", ["text"]), near("z", ["text"])
    ('text', 'text', '')
    """
    lower = name.lower()[:_MAX_NAME]
    words = lower.replace("-", "_").split("_")
    for candidate in candidates:
        if candidate.lower() == lower:
            return candidate
    for candidate in candidates:
        if candidate.lower() in words:
            return candidate
    by_lower = {candidate.lower(): candidate for candidate in reversed(candidates)}
    close = get_close_matches(lower, by_lower, n=1, cutoff=0.7)
    return by_lower[close[0]] if close else ""


# -- words ----------------------------------------------------------------------------------


def short(name: str) -> str:
    """``WaypointRunner`` for ``nav2_capabilities/WaypointRunner``."""
    return name.rpartition("/")[2]


def quoted(name: str) -> str:
    """A name from a plan or a file as messages show it."""
    return f"'{clip(name, _MAX_NAME)}'"


def written(attribute: Attribute) -> str:
    """An attribute as the plan writes it: ``x="1.0"``."""
    return f'{clip(attribute.name, 40)}="{clip(attribute.text, 40)}"'


def either(items: Sequence[str], *, most: int = 5) -> str:
    """``a``, ``a or b``, ``a, b or c``; ``a, b, … and 3 more`` if they are too many."""
    if len(items) > most:
        return f"{', '.join(items[:most])} and {len(items) - most} more"
    if len(items) <= 1:
        return "".join(items)
    return f"{', '.join(items[:-1])} or {items[-1]}"


def at(context: Context, runner: Element, name: str) -> Location:
    """The place of the attribute ``name`` of a runner; the start tag if there is none."""
    attribute = next((each for each in runner.attributes if each.name == name), None)
    return context.plan.location(runner, attribute)


def others(context: Context, numbers: Sequence[int], name: str = "") -> tuple[Related, ...]:
    """All runners but the first as related places, at their attribute ``name``; not too many."""
    return tuple(
        Related(at(context, context.runner(number), name))
        for number in numbers[1 : 1 + MAX_RELATED]
    )


def more_runners(numbers: Sequence[int]) -> str:
    """The addition to a message that speaks of the first of these runners."""
    more = len(numbers) - 1
    return f" (and {more} more runner{'s' if more > 1 else ''})" if more else ""
