"""Where the runners of a simulation come from: what ``VirtualDriver`` takes as ``make``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from gpsfsm.capabilities.specs import specs
from gpsfsm.execution.registry import Mode, runner_class
from gpsfsm.execution.runner import RunnerError
from gpsfsm.model.capability import Provider
from gpsfsm.model.event import Outcome
from gpsfsm.simulation.drawn import Drawn, Scripted
from gpsfsm.simulation.state import WorldState

if TYPE_CHECKING:
    from collections.abc import Callable

    from gpsfsm.capabilities.library import Library
    from gpsfsm.execution.runner import Runner
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


Bound = Mapping[tuple[str, str], Provider]
"""The providers that a plan's bindings mean, by interface and provider (``Kernel.bound``)."""


def world_maker(
    world: World, library: Library, *, bound: Bound | None = None
) -> Callable[[str, str], Runner]:
    """Runners that act in a world (they find it in ``world_services``).

    A runner that has no simulated form of its own is drawn by chance, with the probability to fail
    that the world file gives for its interface.
    """

    def make(interface: str, provider: str) -> Runner:
        described = _provider(library, bound, (interface, provider))
        found = None if described is None else simulated_class(described)
        if found is not None:
            return found()
        return Drawn(described, failure=world.settings_of(interface).fails)

    return make


def drawn_maker(
    library: Library, *, failure: float = 0.1, bound: Bound | None = None
) -> Callable[[str, str], Runner]:
    """Runners whose outcomes are drawn; ``failure`` is the probability to fail."""
    return lambda *key: Drawn(_provider(library, bound, key), failure=failure)


def scripted_maker(
    outcomes: Mapping[str, Outcome],
    library: Library,
    *,
    otherwise: Outcome = Outcome.SUCCEEDED,
    bound: Bound | None = None,
) -> Callable[[str, str], Runner]:
    """Runners whose outcomes are given, by element path; ``otherwise`` holds for the others."""
    return lambda *key: Scripted(_provider(library, bound, key), outcomes, otherwise=otherwise)


def simulated_class(provider: Provider) -> type[Runner] | None:
    """The simulated form of a runner; None if it has none.

    It is looked for as ``gpsfsm.execution.registry`` says: installed packages may have one, and
    the built-in families do. Other modules that capability files name are never imported.
    """
    try:
        return runner_class(provider, mode=Mode.SIMULATED)
    except RunnerError:
        return None


def _provider(library: Library, bound: Bound | None, key: tuple[str, str]) -> Provider | None:
    """What is known of a runner; None if nothing is: it is only drawn then, and acts as nobody."""
    found = (bound or {}).get(key)
    return found if found is not None else library.resolve(*key).provider
