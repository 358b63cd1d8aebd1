"""The frozen registry of capabilities, and how names in plans are looked up in it.

A check uses the built-in library, one of folders of capability files, or both.
"""

from __future__ import annotations

import math
from dataclasses import replace
from enum import StrEnum
from functools import cache, cached_property
from typing import TYPE_CHECKING, TypeVar

from gpsfsm.errors import InputError, require_flag, require_list
from gpsfsm.late import dataclass
from gpsfsm.model.capability import (
    OWN,
    Binding,
    Effects,
    Filling,
    Interface,
    Leaf,
    Parameter,
    Permission,
    Provider,
    Robot,
    SemanticInterface,
    ValueType,
)
from gpsfsm.model.plan import NOT_PARAMETERS, Attribute
from gpsfsm.model.printable import clip
from gpsfsm.model.story import Vocabulary

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from gpsfsm.model.plan import Element, Plan, Value

_Entry = TypeVar("_Entry", Interface, Provider, SemanticInterface)


def namespace(name: str) -> str:
    """The package of a name: ``nav2_capabilities`` for ``nav2_capabilities/WaypointRunner``."""
    return name.partition("/")[0] if "/" in name else ""


class Match(StrEnum):
    """The fit of an interface and a provider (semantics, 8).

    DESCRIBED: the provider implements the interface, and its file says what it takes and gives.
    SILENT: it implements it, and its file does not say that. MISMATCH: the provider is known, but
    it is not one of this interface. UNDESCRIBED: no file describes one of the two, and nothing is
    known that the pair could stand for.
    """

    DESCRIBED = "described"
    SILENT = "silent"
    MISMATCH = "mismatch"
    UNDESCRIBED = "undescribed"


@dataclass(frozen=True, slots=True)
class Resolution:
    """The meaning of an interface and a provider, as they are written.

    ``interface`` is the one that is described, None if there is none. ``provider`` is the one that
    is meant if it fits, None otherwise. ``implements`` is the interface of the provider that is
    written, under its name here, "" if no file knows that provider.
    """

    match: Match
    interface: Interface | None = None
    provider: Provider | None = None
    implements: str = ""


@dataclass(frozen=True)
class Library:
    """A collection of interfaces, providers and semantic interfaces; names are unique within each.

    ``complete``: nothing else exists, so any other name is an error. The built-in library is not
    complete, because a robot may have runners that nobody has described. ``leaves`` define what the
    leaves of behaviour trees do in a simulation, ``blackboard`` the values of keys.
    """

    interfaces: tuple[Interface, ...] = ()
    providers: tuple[Provider, ...] = ()
    semantic: tuple[SemanticInterface, ...] = ()
    complete: bool = False
    leaves: tuple[Leaf, ...] = ()
    blackboard: tuple[tuple[str, str], ...] = ()

    @cached_property
    def _interfaces(self) -> Mapping[str, Interface]:
        return {each.name: each for each in self.interfaces}

    @cached_property
    def _semantic(self) -> Mapping[str, SemanticInterface]:
        return {each.name: each for each in self.semantic}

    @cached_property
    def _providers(self) -> Mapping[str, Provider]:
        return {each.name: each for each in self.providers}

    @cached_property
    def _implementing(self) -> Mapping[str, tuple[Provider, ...]]:
        implementing: dict[str, list[Provider]] = {}
        for provider in self.providers:
            name = self.translation(provider.implements) or provider.implements
            implementing.setdefault(name, []).append(provider)
        return {name: tuple(providers) for name, providers in implementing.items()}

    @cached_property
    def _translations(self) -> Mapping[str, str]:
        translations: dict[str, str] = {}
        for interface in self.interfaces:
            for name in interface.formerly:
                translations.setdefault(name, interface.name)
        return translations

    @cached_property
    def namespaces(self) -> frozenset[str]:
        """The packages for which this library has a description."""
        names = (*self._interfaces, *self._providers, *self._semantic)
        return frozenset(map(namespace, names))

    @cached_property
    def interface_names(self) -> tuple[str, ...]:
        """The names that a plan may use as an interface, sorted."""
        return tuple(sorted({*self._interfaces, *self._semantic}))

    def interface(self, name: str) -> Interface | None:
        """The interface of this name; for a semantic interface, the one that it redefines."""
        semantic = self._semantic.get(name)
        return self._interfaces.get(name if semantic is None else semantic.redefines)

    def provider(self, name: str) -> Provider | None:
        """The provider of this name."""
        return self._providers.get(name)

    def providers_of(self, interface: str) -> tuple[Provider, ...]:
        """The providers that implement an interface, sorted by name after the default one.

        Without a declared default, the default is the provider with the name of the interface, else
        the only one, else the first by name.
        """
        described = self.interface(interface)
        if described is None:
            return ()
        default = described.default_provider or described.name
        providers = self._implementing.get(described.name, ())
        if interface in self._semantic:
            providers += self._implementing.get(interface, ())
        return tuple(
            sorted(providers, key=lambda provider: (provider.name != default, provider.name))
        )

    def translation(self, name: str) -> str | None:
        """The name in this library of a name from another dialect; None if there is none."""
        if name in self._interfaces or name in self._semantic:
            return None
        return self._translations.get(name)

    def extended(self, other: Library) -> Library:
        """Add the entries of ``other``, which replace entries of the same name.

        What the old schemas cannot express is kept: the definition of a provider that ``other``
        names without one, and the other names of an interface.
        """
        ours = self._interfaces
        interfaces = [_completed_interface(new, ours.get(new.name)) for new in other.interfaces]
        providers = [_completed_provider(new, self.provider(new.name)) for new in other.providers]
        return Library(
            interfaces=_merged(self.interfaces, tuple(interfaces)),
            providers=_merged(self.providers, tuple(providers)),
            semantic=_merged(self.semantic, other.semantic),
            complete=self.complete or other.complete,
            leaves=other.leaves or self.leaves,
            blackboard=other.blackboard or self.blackboard,
        )

    def says_the_same(self, other: Library) -> bool:
        """True if another library has the same descriptions, regardless of file names."""
        return _without_origins(self) == _without_origins(other)

    def implemented(self, provider: str) -> str:
        """The interface that a provider implements, under its name in this library; "" if unknown.

        The provider's name may be that of another dialect.
        """
        described = self._providers.get(provider)
        if described is None:
            return self.translation(provider) or ""
        return self.translation(described.implements) or described.implements

    def resolve(self, interface: str, provider: str) -> Resolution:
        """Resolve the names of a runner; an empty ``provider`` means the default one.

        Checks, runs and comparisons with tasks all use this function, so that they agree on which
        runner is meant.
        """
        if interface in OWN and provider in ("", interface):
            return Resolution(Match.DESCRIBED, *OWN[interface], interface if provider else "")
        translated = self.translation(interface)
        described = self.interface(translated or interface)
        implements = self.implemented(provider) if provider else ""
        if described is None:
            own = self._providers.get(provider)
            fits = not implements or (own is not None and own.implements == interface)
            return Resolution(Match.UNDESCRIBED if fits else Match.MISMATCH, None, None, implements)
        meant = self._provider_for(described, interface, provider)
        if meant is None:
            wrong = bool(implements) and implements != described.name
            match = Match.MISMATCH if wrong else Match.UNDESCRIBED
            return Resolution(match, described, None, implements)
        if not meant.described and translated is None:
            # files of an older dialect say little; what it is called here may be described
            translated = self._translations.get(interface)
            candidates = self.providers_of(translated) if translated is not None else ()
            meant = candidates[0] if candidates and candidates[0].described else meant
        if not meant.described:
            return Resolution(Match.SILENT, described, meant, implements)
        if translated is not None:
            meant = self.elsewhere(meant)
        return Resolution(Match.DESCRIBED, described, meant, implements)

    def bind(self, runner: Element) -> Binding | None:
        """The binding of a runner; None if no file describes it."""
        resolution = self.resolve(runner.interface, runner.provider)
        if resolution.match is not Match.DESCRIBED:
            return None
        assert resolution.interface is not None
        assert resolution.provider is not None
        return Binding(
            resolution.interface,
            resolution.provider,
            _attributes_by_parameter(resolution.provider, runner.attributes),
            semantic=runner.interface if runner.interface in self._semantic else "",
        )

    @cached_property
    def _without_effects(self) -> dict[str, Provider]:
        return {}

    @cached_property
    def dialects(self) -> dict[str, Library]:
        """The same library under the names of engines, for those requested so far."""
        return {}

    def elsewhere(self, provider: Provider) -> Provider:
        """The provider as other dialects define it.

        Its parameters and outputs are the same, but older engines keep and send prompts by other
        rules: there is one buffer, without a name, and asking for a plan sends it.
        """
        if provider.effects == Effects():
            return provider
        bare = self._without_effects
        if provider.name not in bare:
            buffer = provider.effects.prompt_buffer
            answer = "" if buffer is None else buffer.answer
            outputs = tuple(  # nobody need read an answer that may be empty
                replace(output, status=output.status or output.name == answer)
                for output in provider.outputs
            )
            bare[provider.name] = replace(provider, effects=Effects(), outputs=outputs)
        return bare[provider.name]

    def _provider_for(self, described: Interface, written: str, provider: str) -> Provider | None:
        named = self._providers.get(provider)
        if named is None and provider in ("", written, *described.formerly):
            # none is named, or that of another dialect, or of a semantic interface
            implementing = self.providers_of(described.name) or self.providers_of(written)
            return implementing[0] if implementing else None
        if named is None:
            return None
        implemented = self.translation(named.implements) or named.implements
        if implemented != described.name and named.implements != written:
            return None
        return named


@dataclass(frozen=True, slots=True)
class FileDefect:
    """Something that is wrong with a file: ``text`` is ``file:line:column: error: message``.

    ``names``: what the file describes; bare names where it could not be read, as far as it seems to
    have any, and none at all where that may be anything.
    """

    text: str
    file: str = ""
    names: tuple[str, ...] = ()

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True, slots=True)
class Capabilities:
    """The library that a check uses.

    - ``defects``: what is wrong with its files.
    - ``robot``: the robot that plans are for, if the library comes from a robot profile.
    - ``named_by``: the engine whose names the built-in library uses; "" for its own names.
    - ``allow``: the only programs, hosts and functions that plans may reach. None: not specified,
      so that plans that reach any get a warning.
    """

    library: Library
    defects: tuple[FileDefect, ...] = ()
    robot: Robot | None = None
    allow: tuple[tuple[Permission, str], ...] | None = None
    named_by: str = ""


EMPTY = Capabilities(Library())
"""No capabilities at all: every instance is undescribed."""


@cache
def builtin_capabilities() -> Capabilities:
    """Return the built-in library, which is loaded from a compiled table."""
    from gpsfsm.capabilities.table import builtin

    return Capabilities(builtin())


def bind(plan: Plan, library: Library) -> tuple[Binding | None, ...]:
    """The bindings of the runner instances of a plan, in document order.

    The name that a behaviour tree has for a node says nothing about the runners of a library; only
    choices and ticks are what they are called.
    """
    if plan.vocabulary is Vocabulary.TREE:
        own = Library()
        return tuple(own.bind(each) if each.interface in OWN else None for each in plan.runners)
    return tuple(library.bind(runner) for runner in plan.runners)


_MOST_LINES = 8


def bind_leaves(plan: Plan, library: Library, *, real: bool) -> tuple[Binding | None, ...]:
    """The bindings of a run. Leaves of a tree mean the runners that a robot profile names.

    For real nothing acts under another name than its own. Raises InputError if a parameter has no
    value that fits; each line says where.
    """
    bound = [*bind(plan, library)]
    if plan.vocabulary is not Vocabulary.TREE:
        return tuple(bound)
    if real:
        return tuple(library.bind(runner) for runner in plan.runners)
    leaves = {leaf.name: leaf for leaf in library.leaves}
    problems: dict[str, None] = {}
    for number, runner in enumerate(plan.runners):
        leaf = leaves.get(runner.interface)
        if bound[number] is not None or leaf is None:
            continue
        resolution = library.resolve(leaf.runner, "")
        assert resolution.interface is not None, "the profile was compared with the library"
        assert resolution.provider is not None
        written = {}
        for filling in leaf.fillings:
            try:
                value = _filled(filling, leaf, runner, resolution.provider, library)
            except ValueError as error:
                problems[f"{plan.file}:{runner.line}: {leaf.name}: {error}"] = None
                continue
            text = value if isinstance(value, str) else repr(value)
            place = runner.line, runner.column
            written[filling.parameter] = Attribute(filling.parameter, text, value, *place)
        bound[number] = Binding(resolution.interface, resolution.provider, written)
    if problems:
        lines = [*problems][:_MOST_LINES]
        more = len(problems) - len(lines)
        raise InputError("\n".join([*lines, f"and {more} more like these"] if more else lines))
    return tuple(bound)


def _filled(
    filling: Filling, leaf: Leaf, runner: Element, provider: Provider, library: Library
) -> Value:
    """The value of a parameter. Raises ValueError that says what is wrong and what to do."""
    source = written_for(filling, runner)
    part = None if source is None else part_of(source, filling, leaf, library)
    if part is None and filling.port:
        part = filling.text
    if part is None and source is None:
        raise ValueError(f"it has no port '{filling.port}'; write one")
    if part is None:
        where = f"'{clip(source or '', 60)}'"
        raise ValueError(f"{where} has other parts than those from which {filling.parameter} comes")
    parameter = provider.parameter(filling.parameter)
    assert parameter is not None, "the profile was compared with the library"
    value = of_type(part, parameter, filling)
    if isinstance(value, int | float) and not isinstance(value, bool):
        low, high = parameter.minimum, parameter.maximum
        if (low is not None and value < low) or (high is not None and value > high):
            raise ValueError(f"{parameter.name} is {value:g}, which the robot does not accept")
    if parameter.choices and value not in parameter.choices:
        raise ValueError(f"{parameter.name} is one of {', '.join(parameter.choices)}")
    return value


def written_for(filling: Filling, runner: Element) -> str | None:
    """The text from which a parameter of a leaf comes; None if its port is not written."""
    return runner.text(filling.port) if filling.port else filling.text


def part_of(text: str, filling: Filling, leaf: Leaf, library: Library) -> str | None:
    """The part of a text that is meant; None if it has no such part.

    Raises ValueError for a key of the blackboard whose value is unknown.
    """
    from gpsfsm.model.tree import is_reference  # which only trees need

    if is_reference(text):
        key = text.strip()[1:-1].strip()
        key = filling.port if key == "=" else key
        values = dict(library.blackboard)
        if key not in values:
            hint = f"set it in 'blackboard' of the robot profile, {key}: …"
            raise ValueError(f"the value of {clip(text.strip(), 60)} is unknown; {hint}")
        text = values[key]
    text = dict(leaf.words).get(text.strip(), text)
    if not filling.parts:
        return text
    parts = text.split(";")
    places = dict(filling.parts)
    place = places.get(len(parts), places.get(0, 0))
    return parts[place - 1].strip() if 0 < place <= len(parts) else None


def of_type(text: str, parameter: Parameter, filling: Filling) -> Value:
    """A text as a value of the type of a parameter. Raises ValueError."""
    kind = parameter.type
    if kind in (ValueType.DOUBLE, ValueType.INT):
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        number = abs(number * filling.factor) if filling.unsigned else number * filling.factor
        if not math.isfinite(number) or (kind is ValueType.INT and number != int(number)):
            wanted = "a whole number" if kind is ValueType.INT else "a number"
            hint = "define its meaning in 'words' of the leaf"
            raise ValueError(f"{parameter.name} is {wanted}, not '{clip(text, 60)}'; {hint}")
        return int(number) if kind is ValueType.INT else number
    if kind is ValueType.BOOL:
        word = text.strip().lower()
        if word not in ("true", "false", "1", "0"):
            raise ValueError(f"{parameter.name} is true or false, not '{clip(text, 60)}'")
        return word in ("true", "1")
    return text


def _attributes_by_parameter(
    provider: Provider, attributes: Iterable[Attribute]
) -> dict[str, Attribute]:
    """The attributes by the name of the parameter; the name itself wins over an alias of it."""
    by_name: dict[str, Attribute] = {}
    for attribute in attributes:
        if attribute.name in NOT_PARAMETERS:
            continue
        parameter = provider.parameter(attribute.name)
        name = attribute.name if parameter is None else parameter.name
        if name == attribute.name or name not in by_name:
            by_name[name] = attribute
    return by_name


def _completed_interface(new: Interface, old: Interface | None) -> Interface:
    if old is None:
        return new
    default = new.default_provider or old.default_provider
    return replace(new, formerly=new.formerly or old.formerly, default_provider=default)


def _completed_provider(new: Provider, old: Provider | None) -> Provider:
    if old is None or new.described or not old.described or old.implements != new.implements:
        return new
    return replace(
        old,
        runner=new.runner,
        description=new.description or old.description,
        version=new.version,
        lent=True,
        depends_on=new.depends_on,
        remappings=new.remappings,
        origin=new.origin,
    )


def _without_origins(library: Library) -> Library:
    return replace(
        library,
        interfaces=tuple(replace(each, origin="") for each in library.interfaces),
        providers=tuple(replace(each, origin="") for each in library.providers),
        semantic=tuple(replace(each, origin="") for each in library.semantic),
    )


def _merged(ours: tuple[_Entry, ...], theirs: tuple[_Entry, ...]) -> tuple[_Entry, ...]:
    merged = {entry.name: entry for entry in ours} | {entry.name: entry for entry in theirs}
    return tuple(merged[name] for name in sorted(merged))


def choose_capabilities(
    paths: Sequence[str | Path], *, builtin: bool = True, robot: str | Path | None = None
) -> Capabilities:
    """Return the built-in library extended by the capability files below ``paths``.

    Without ``builtin``, the result has only these files, and is taken to be complete. ``robot`` is
    the file of a robot profile, which names further files to read and the capabilities that the
    robot has.

    Raises ConfigError for an invalid profile, and UsageError for a path that cannot be read or
    contains no capability file. A defective file does not raise: it is listed in ``defects``.
    """
    require_list("choose_capabilities", "paths", paths)
    require_flag("choose_capabilities", "builtin", builtin)
    if robot is not None:
        from gpsfsm.capabilities.robot import capabilities_of_robot, load_profile

        profile = load_profile(robot)
        folders = [*profile.folders, *paths]
        described = choose_capabilities(folders, builtin=builtin and profile.builtin)
        return capabilities_of_robot(profile, described)
    base = builtin_capabilities() if builtin else EMPTY
    if not paths:
        return base
    from gpsfsm.capabilities.load import load_directories

    loaded = load_directories(paths, base=base.library)
    errors = tuple(
        FileDefect(defect.summary, defect.file, loaded.described.get(defect.file, ()))
        for defect in loaded.defects
        if defect.severity == "error"
    )
    library = base.library.extended(loaded.library)
    return Capabilities(replace(library, complete=not builtin), errors)
