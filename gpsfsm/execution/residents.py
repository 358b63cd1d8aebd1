"""The runners that are loaded in real time, with what they depend on.

A runner is loaded once per interface and provider, however many need it, and after the runners
that it depends on; it is unloaded when nobody needs it any more, before those. Each has a lane of
its own, unless all share one.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

from gpsfsm.execution.dependencies import Key, loading_order
from gpsfsm.execution.lane import Action, Lane
from gpsfsm.execution.outputs import said
from gpsfsm.execution.runner import LoadContext, Runner, RunnerError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

__all__ = ["Key", "Resident", "Residents"]


class Resident:
    """A runner that is loaded or being loaded. ``users`` counts who needs it."""

    __slots__ = ("key", "lane", "problem", "ready", "runner", "users", "waiting")

    def __init__(self, key: Key, lane: Lane) -> None:
        self.key = key
        self.lane = lane
        self.runner: Runner | None = None
        self.ready = False
        self.problem = ""
        self.users = 0
        self.waiting: list[Callable[[], None]] = []


class Residents:
    """Loads and unloads. All methods are called in the thread of the engine.

    ``post`` calls a function there from any thread, ``later`` after some seconds; ``note`` gets
    what goes wrong while unloading.
    """

    def __init__(
        self,
        make: Callable[[str, str], Runner],
        services: Mapping[str, Any],
        *,
        depends_on: Callable[[str, str], Sequence[Key]],
        shared: Lane | None,
        load_s: float,
        grace_s: float,
        post: Callable[[Callable[[], None]], None],
        later: Callable[[float, Callable[[], None]], None],
        note: Callable[[str], None],
    ) -> None:
        self._make = make
        self._services = services
        self._depends_on = depends_on
        self._shared = shared
        self._load_s = load_s
        self._grace_s = grace_s
        self._post = post
        self._later = later
        self._note = note
        self._present: dict[Key, Resident] = {}  # in the order of their loading
        self._held: dict[Key, list[Resident]] = {}
        self._unloads: deque[Resident] = deque()
        self._unloading: Resident | None = None

    def __getitem__(self, key: Key) -> Resident | None:
        """The runner, if it is loaded."""
        found = self._present.get(key)
        return found if found is not None and found.ready else None

    @property
    def at_rest(self) -> bool:
        """Whether nothing is being unloaded."""
        return self._unloading is None

    # -- loading ----------------------------------------------------------------------------

    def acquire(self, key: Key, done: Callable[[str], None]) -> None:
        """Load a runner and what it depends on; ``done`` gets what went wrong, "" for nothing.

        ``done`` may be called at once.
        """
        held = self._held[key] = []
        try:
            order = loading_order(key, self._depends_on)
        except Exception as error:
            self._refuse(key, said(error), done)
            return
        self._acquire_next(key, deque(order), held, done)

    def _acquire_next(
        self, key: Key, order: deque[Key], held: list[Resident], done: Callable[[str], None]
    ) -> None:
        while order and self._held.get(key) is held:
            wanted = order.popleft()
            resident = self._present.get(wanted)
            if resident is None:
                resident = self._load(wanted)
            resident.users += 1
            held.append(resident)
            if not resident.ready:
                resident.waiting.append(
                    lambda: self._go_on(key, order, held, done)  # once it is loaded, or cannot be
                )
                return
        if self._held.get(key) is held:
            done("")

    def _go_on(
        self, key: Key, order: deque[Key], held: list[Resident], done: Callable[[str], None]
    ) -> None:
        if self._held.get(key) is not held:
            return  # it is not wanted any more
        resident = held[-1]
        if resident.ready:
            self._acquire_next(key, order, held, done)
            return
        problem = resident.problem
        if resident.key != key:
            problem = f"{resident.key[1] or resident.key[0]}, which it depends on: {problem}"
        self._refuse(key, problem, done)

    def _refuse(self, key: Key, problem: str, done: Callable[[str], None]) -> None:
        self.release(key)
        done(problem)

    def _load(self, key: Key) -> Resident:
        lane = self._shared or Lane(f"runner {key[1] or key[0]}")
        resident = self._present[key] = Resident(key, lane)

        async def load() -> None:
            made = self._make(*key)
            if not isinstance(made, Runner):
                raise RunnerError(f"{type(made).__name__} is no runner")
            resident.runner = made
            await made.start(LoadContext(*key, self._services))

        action = Action(
            lane, load, lambda _, error: self._post(lambda: self._loaded(resident, error))
        )
        self._later(self._load_s, lambda: self._too_slow(resident, action))
        return resident

    def _too_slow(self, resident: Resident, action: Action) -> None:
        if resident.waiting:
            action.cut_off()
            self._loaded(resident, RunnerError(f"not loaded within {self._load_s:g} s"))

    def _loaded(self, resident: Resident, error: BaseException | None) -> None:
        if self._present.get(resident.key) is not resident or resident.ready or resident.problem:
            return  # nobody waits for it any more
        resident.ready = error is None
        if error is not None:
            resident.problem = str(error) if isinstance(error, RunnerError) else said(error)
            resident.problem = resident.problem or "it cannot be loaded"
        waiting, resident.waiting = resident.waiting, []
        for go_on in waiting:
            go_on()

    # -- unloading --------------------------------------------------------------------------

    def release(self, key: Key) -> None:
        """A runner is needed no more; unload it and what it depends on, as far as nobody does."""
        for resident in reversed(self._held.pop(key, [])):
            resident.users -= 1
            if resident.users == 0:
                del self._present[resident.key]
                resident.waiting.clear()
                self._unloads.append(resident)
        self._unload_next()

    def release_all(self) -> None:
        """Unload everything, what was loaded last first."""
        for key in reversed(list(self._held)):
            self.release(key)

    def _unload_next(self) -> None:
        """One after the other, so that what depends on a runner has let go of it before."""
        while self._unloading is None and self._unloads:
            resident = self._unloads.popleft()
            if not resident.ready or resident.runner is None:
                self._leave(resident)
                continue
            self._unloading = resident
            self._unload(resident, resident.runner)

    def _unload(self, resident: Resident, runner: Runner) -> None:
        action = Action(
            resident.lane,
            runner.stop,
            lambda _, error: self._post(lambda: self._unloaded(resident, error)),
        )

        def too_slow() -> None:
            if self._unloading is resident:
                action.cut_off()
                self._unloaded(resident, RunnerError(f"not unloaded within {self._grace_s:g} s"))

        self._later(self._grace_s, too_slow)

    def _unloaded(self, resident: Resident, error: BaseException | None) -> None:
        if self._unloading is not resident:
            return
        if error is not None:
            self._note(f"unloading {resident.key[1] or resident.key[0]}: {said(error)}")
        self._leave(resident)
        self._unloading = None
        self._unload_next()

    def _leave(self, resident: Resident) -> None:
        if resident.lane is not self._shared:
            resident.lane.close()
