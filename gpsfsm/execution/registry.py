"""The registry of runners: from providers to classes.

Capability files are not trusted: what they name as ``runner`` is imported only from
``gpsfsm.runners`` and from modules that the user allows. An installed package that registers a
runner under the entry-point group ``gpsfsm.runners`` needs no permission, since it was installed.
"""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import re
from enum import StrEnum
from importlib.metadata import entry_points
from typing import TYPE_CHECKING

from gpsfsm.capabilities.library import Match, builtin_capabilities
from gpsfsm.execution.runner import Runner, RunnerError, clean, said

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
    from importlib.metadata import EntryPoint

    from gpsfsm.capabilities.library import Library, Resolution
    from gpsfsm.model.capability import Provider

GROUP = "gpsfsm.runners"
"""The group of entry points; the name of an entry is that of a provider or of an interface."""

PERMIT = "allow it (--allow-module)"
"""What to do so that the class of a module that a file names may act."""

_BUILT_IN = "gpsfsm.runners"
_ROS = ("gpsfsm.ros.runner", "RosRunner")
"""The class that acts where a file describes what is to be called on ROS 2."""

_DOTTED = re.compile(r"([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*):([A-Za-z_]\w*)", re.ASCII)


class Mode(StrEnum):
    """The mode of runners: for real or in a world."""

    REAL = "real"
    SIMULATED = "simulated"


class InstalledRunnerError(RunnerError):
    """A runner that an installed package registers cannot be used."""


class UndescribedError(RunnerError):
    """No capability file describes a runner, so nothing that it does has been checked."""


def runner_class(
    provider: Provider,
    *,
    mode: Mode = Mode.REAL,
    allow: Collection[str] = (),
    permit: str = PERMIT,
) -> type[Runner]:
    """The class that runs a provider.

    An entry point with the name of the provider is taken first, then one with the name of its
    interface, then the class that the capability file names, ``module:Class``. ``allow`` names
    further modules, with all that is below them, from which files may name classes; ``permit``
    says what to do so that another one is allowed.

    A class with an attribute ``simulated`` has that class for simulations (True: itself). The
    built-in ones are in the module ``simulated`` of their family. Raises RunnerError, which says
    what to do, if there is no class for the mode, and in real mode also if an entry point with one
    of these names cannot be used (InstalledRunnerError).
    """
    if mode is Mode.REAL:
        registered = _registered(provider.name, provider.implements)
        if registered is None and provider.ros is not None:
            return _imported(*_ROS, f"{':'.join(_ROS)} of {provider.name}")
        return registered or _named(provider, mode, allow, permit)
    try:
        registered = _registered(provider.name, provider.implements)
    except InstalledRunnerError:  # for ``wrong_registrations`` to tell
        registered = None
    if registered is not None:
        simulated = _simulated(registered, provider)
        if simulated is not None:
            return simulated
    chosen = _named(provider, mode, allow, permit)
    simulated = _simulated(chosen, provider)
    if simulated is None:
        raise RunnerError(
            f"{provider.name} has no simulated runner: {chosen.__name__} acts for real"
        )
    return simulated


def wrong_registrations(providers: Iterable[Provider]) -> list[str]:
    """The problems of installed runners that some providers of a plan should have.

    For real runs that is an error. A simulation leaves them out, but should say so.
    """
    problems: dict[str, None] = {}
    for provider in providers:
        try:
            _registered(provider.name, provider.implements)
        except InstalledRunnerError as error:
            problems[str(error)] = None
    return list(problems)


def _simulated(runner_class: type[Runner], provider: Provider) -> type[Runner] | None:
    """The class that stands in for another one in simulations."""
    simulated = getattr(runner_class, "simulated", None)
    if simulated is True or runner_class.__module__.endswith(".simulated"):
        return runner_class
    if isinstance(simulated, type):
        return check_class(simulated, f"what stands in for {provider.name} in a simulation")
    return None


def _registered(*names: str) -> type[Runner] | None:
    """The class of an entry point with one of these names, the first that there is."""
    entries = entry_points(group=GROUP)
    for name in dict.fromkeys(names):
        fitting = {entry.value: entry for entry in entries if name and entry.name == name}
        if len(fitting) > 1:
            who = "; ".join(sorted(map(_written, fitting.values())))
            raise InstalledRunnerError(
                f"several installed packages register a runner for {name}: {who}; "
                "uninstall all but one"
            )
        for entry in fitting.values():
            return _loaded(entry)
    return None


def _loaded(entry: EntryPoint) -> type[Runner]:
    """The class of an entry point. Raises InstalledRunnerError."""
    if _is_taken(entry.name):
        raise InstalledRunnerError(
            f"{_written(entry)} claims {entry.name}, for which gpsfsm has a runner of its own; "
            "uninstall it, or let it register its runner under a name of its own"
        )
    try:
        loaded = entry.load()
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a module may also want to exit
        raise InstalledRunnerError(
            f"{_written(entry)} cannot be imported: {said(error)}; repair or uninstall it"
        ) from error
    try:
        return check_class(loaded, _written(entry))
    except RunnerError as error:
        raise InstalledRunnerError(f"{error}; repair or uninstall it") from None


def _written(entry: EntryPoint) -> str:
    """An entry point in words: ``the runner demo/Grasp = robot:Grasp of the package robot 1.0``."""
    package = "" if entry.dist is None else f" of the package {entry.dist.name}"
    version = "" if entry.dist is None else f" {entry.dist.version}"
    return clean(f"the runner {entry.name} = {entry.value}{package}{version}", 300)


def _is_taken(name: str) -> bool:
    """True if gpsfsm itself has a runner of that name that acts for real."""
    return ours(name) is not None


def ours(name: str) -> Provider | None:
    """The provider of that name for which gpsfsm itself has code that acts for real."""
    described = builtin_capabilities().library.provider(name)
    match = None if described is None else _DOTTED.fullmatch(described.runner)
    if match is None or not hasattr(_module(match[1], match[0]), match[2]):
        return None
    return described


def _named(provider: Provider, mode: Mode, allow: Collection[str], permit: str) -> type[Runner]:
    """The class that the capability file names."""
    match = _DOTTED.fullmatch(provider.runner)
    if match is None:
        names = f"names {provider.runner[:200]!r}, which is not module:Class"
        nothing = "has neither a section 'ros' nor a 'runner' (module:Class)"
        raise RunnerError(
            f"no runner is installed for {provider.name}: its file "
            f"{names if provider.runner else nothing}, and no package registers one under {GROUP}"
        )
    module, name = match.groups()
    if _below(module, _BUILT_IN):
        return _built_in(provider, module, name, mode)
    if not any(_below(module, prefix) for prefix in allow):
        raise RunnerError(
            f"the file of {provider.name} names the runner {provider.runner}, and runners from "
            f"the module {module} are not allowed; if you trust it, {permit}"
        )
    return _imported(module, name, provider.runner)


def _built_in(provider: Provider, module: str, name: str, mode: Mode) -> type[Runner]:
    """A built-in runner; many exist only simulated."""
    simulated = module if module.endswith(".simulated") else f"{module}.simulated"
    if mode is Mode.SIMULATED and _exists(simulated):
        return _imported(simulated, name, f"{simulated}:{name}")
    if mode is Mode.REAL and not hasattr(_module(module, provider.runner), name):
        raise RunnerError(
            f"{provider.name} exists only as a simulation: install a package that registers a "
            f"runner for it under {GROUP}, or run the plan without real runners"
        )
    return _imported(module, name, provider.runner)


def _below(module: str, prefix: str) -> bool:
    return module == prefix or module.startswith(f"{prefix}.")


def _exists(module: str) -> bool:
    try:
        return importlib.util.find_spec(module) is not None
    except ImportError:
        return False


def _module(module: str, named: str) -> object:
    try:
        return importlib.import_module(module)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a module may also want to exit
        raise RunnerError(f"the runner {named} cannot be imported: {said(error)}") from error


def _imported(module: str, name: str, named: str) -> type[Runner]:
    candidate = getattr(_module(module, named), name, None)
    if candidate is None:
        raise RunnerError(f"there is no runner {named}: the module has no {name}")
    return check_class(candidate, named)


def check_class(candidate: object, named: str) -> type[Runner]:
    """A class that runs something. Raises RunnerError for anything else."""
    if (
        not isinstance(candidate, type)
        or not issubclass(candidate, Runner)
        or inspect.isabstract(candidate)
    ):
        raise RunnerError(
            f"{named} is not a runner: it must be a subclass of {Runner.__module__}:"
            f"{Runner.__name__} with a method run"
        )
    return candidate


class Maker:
    """Makes the runners of a library, for drivers.

    ``maker(interface, provider)`` is a new runner, ``maker.depends_on(interface, provider)`` what
    has to be loaded before it. Both take "" for a provider that is not named. Names mean what they
    mean to a check: ``Library.resolve`` says it, or ``bound``, the providers that a check has bound
    already (``Kernel.bound``). Raises RunnerError for what cannot be made: UndescribedError where
    the library does not describe both names, so that nothing acts of which a check knew nothing.
    ``own`` are classes by the names of providers or interfaces, which come before all others.
    ``via`` may have a class for a provider that gpsfsm has no runner of its own for: what another
    server does. A class with ``brings_dependencies`` needs nothing loaded before it.
    """

    def __init__(
        self,
        library: Library,
        *,
        mode: Mode = Mode.REAL,
        allow: Collection[str] = (),
        bound: Mapping[tuple[str, str], Provider] | None = None,
        own: Mapping[str, type[Runner]] | None = None,
        via: Callable[[Provider], type[Runner] | None] | None = None,
        permit: str = PERMIT,
    ) -> None:
        self._via = via
        self._permit = permit
        self._own = own or {}
        self._library = library
        self._mode = mode
        self._allow = tuple(allow)
        self._bound = bound or {}
        self._classes: dict[tuple[str, str], type[Runner]] = {}

    def __call__(self, interface: str, provider: str) -> Runner:
        """A new runner."""
        return self.runner_class(interface, provider)()

    def runner_class(self, interface: str, provider: str) -> type[Runner]:
        """The class of the runner."""
        key = (interface, provider)
        if key not in self._classes:
            described = self.described(interface, provider)
            own = self._own.get(described.name) or self._own.get(described.implements)
            self._classes[key] = own or self._class(described)
        return self._classes[key]

    def _class(self, described: Provider) -> type[Runner]:
        if self._via is not None:
            own = ours(described.name)
            chosen = None if own is not None else self._via(described)
            if chosen is not None:
                return chosen
            described = own or described  # a robot's file names its own code, not ours
        return runner_class(described, mode=self._mode, allow=self._allow, permit=self._permit)

    def described(self, interface: str, provider: str) -> Provider:
        """The provider that is meant, with its description.

        Raises UndescribedError, and RunnerError if interface and provider do not fit.
        """
        bound = self._bound.get((interface, provider))
        if bound is not None:
            return bound
        resolution = self._library.resolve(interface, provider)
        if resolution.match is Match.MISMATCH:
            raise RunnerError(
                f"{clean(provider, 300)} implements {resolution.implements}, not "
                f"{clean(interface, 300)}: name an interface and a provider of it"
            )
        if resolution.provider is None or resolution.match is not Match.DESCRIBED:
            raise UndescribedError(_undescribed(interface, provider, resolution))
        return resolution.provider

    def depends_on(self, interface: str, provider: str) -> Sequence[tuple[str, str]]:
        """Interface and provider of each runner that has to be loaded before; real ones only."""
        if self._mode is Mode.SIMULATED:
            return ()  # a simulated runner works against its world
        try:
            if self._via is not None and hasattr(
                self.runner_class(interface, provider), "brings_dependencies"
            ):
                return ()
            return self.described(interface, provider).depends_on
        except RunnerError:  # it is never loaded
            return ()

    def with_dependencies(self, runners: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
        """Some runners and all that they depend on, each once."""
        pending = list(dict.fromkeys(runners))
        seen = set(pending)
        for key in pending:  # it grows meanwhile
            fresh = [wanted for wanted in self.depends_on(*key) if wanted not in seen]
            seen.update(fresh)
            pending += dict.fromkeys(fresh)
        return pending

    def undescribed(self, runners: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
        """Those of some runners, and of what they depend on, that no file describes."""
        keys = []
        for key in self.with_dependencies(runners):
            try:
                self.described(*key)
            except UndescribedError:
                keys.append(key)
            except RunnerError:  # ``problems`` tells it
                continue
        return keys

    def unbound(self, runners: Iterable[tuple[str, str]]) -> list[str]:
        """The reasons why some of these runners, or their dependencies, mean no known provider."""
        problems: dict[str, None] = {}
        for key in self.with_dependencies(runners):
            try:
                self.described(*key)
            except RunnerError as error:
                problems[str(error)] = None
        return list(problems)

    def problems(self, runners: Iterable[tuple[str, str]]) -> list[str]:
        """The reasons why some of these runners, or their dependencies, cannot be made."""
        problems: dict[str, None] = {}
        for key in self.with_dependencies(runners):
            try:
                unavailable = getattr(self.runner_class(*key), "unavailable", None)
                if unavailable is not None and (why := unavailable(self.described(*key))):
                    problems[why] = None
            except RunnerError as error:
                problems[str(error)] = None
        return list(problems)


def _undescribed(interface: str, provider: str, resolution: Resolution) -> str:
    """The message about the name that no file describes, or describes too little."""
    shown, named = clean(interface, 300), clean(provider, 300)
    if resolution.provider is not None:
        return (
            f"the file of {resolution.provider.name} does not say what it takes and gives "
            "(definition), so nothing that it does has been checked"
        )
    missing = shown if resolution.interface is None else named or f"any provider of {shown}"
    if resolution.interface is None and not resolution.implements and named not in ("", shown):
        missing = f"{shown} and {named}"
    return f"no capability file describes {missing}, so nothing that it does has been checked"
