"""Where the runners of a simulation come from: what ``VirtualDriver`` takes as ``make``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.capabilities.specs import specs
from gpsfsm.execution.registry import Mode, runner_class
from gpsfsm.execution.runner import RunnerError
from gpsfsm.model.event import Outcome
from gpsfsm.simulation.drawn import Drawn, Scripted
from gpsfsm.simulation.state import WorldState

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from gpsfsm.capabilities.library import Library
    from gpsfsm.execution.runner import Runner
    from gpsfsm.model.capability import Provider
    from gpsfsm.simulation.world import World

__all__ = [
    "drawn_maker",
    "scripted_maker",
    "simulated_class",
    "world_maker",
    "world_services",
]


def world_services(world: World, library: Library, **others: Any) -> dict[str, Any]:
    """What the runners of one run share: ``world``, the world as it is at the beginning.

    Others, such as ``plans``, can be given along. Make new services for each run.
    """
    return {"world": WorldState(world, specs=specs(library)), **others}


def world_maker(world: World, library: Library) -> Callable[[str, str], Runner]:
    """Runners that act in a world (they find it in ``world_services``).

    A runner that has no simulated form of its own is drawn by chance, with the probability to fail
    that the world file gives for its interface.
    """

    def make(interface: str, provider: str) -> Runner:
        described = _provider(library, interface, provider)
        found = None if described is None else simulated_class(described)
        if found is not None:
            return found()
        return Drawn(described, failure=world.settings_of(interface).fails)

    return make


def drawn_maker(library: Library, *, failure: float = 0.1) -> Callable[[str, str], Runner]:
    """Runners whose outcomes are drawn; ``failure`` is the probability to fail."""
    return lambda interface, provider: Drawn(
        _provider(library, interface, provider), failure=failure
    )


def scripted_maker(
    outcomes: Mapping[str, Outcome],
    library: Library,
    *,
    otherwise: Outcome = Outcome.SUCCEEDED,
) -> Callable[[str, str], Runner]:
    """Runners whose outcomes are given, by element path; ``otherwise`` holds for the others."""
    return lambda interface, provider: Scripted(
        _provider(library, interface, provider), outcomes, otherwise=otherwise
    )


def simulated_class(provider: Provider) -> type[Runner] | None:
    """The simulated form of a runner; None if it has none.

    It is looked for as ``gpsfsm.execution.registry`` says: installed packages may have one, and
    the built-in families do. Other modules that capability files name are never imported.
    """
    try:
        return runner_class(provider, mode=Mode.SIMULATED)
    except RunnerError:
        return None


def _provider(library: Library, interface: str, provider: str) -> Provider | None:
    found = library.provider(provider)
    if found is not None:
        return found
    known = library.providers_of(library.translation(interface) or interface)
    return known[0] if known and interface == provider else None
