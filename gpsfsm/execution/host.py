"""The part that all drivers share: from an input to its effects, and the loading of runners.

An input goes into the kernel, what follows is journaled, and only then is anything done.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from typing import TYPE_CHECKING, Protocol

from gpsfsm.execution.records import MARKS, Input, Kind, Load, Start, Stop, Unload
from gpsfsm.execution.runner import Runner, RunnerError, said

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from gpsfsm.execution.kernel import Kernel
    from gpsfsm.execution.records import Record


class Sink(Protocol):
    """The place where a run is written: a journal, a list, a terminal."""

    def write(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        """Keep an input and what follows from it; when this returns it is safe."""


class Host(ABC):
    """Delivers inputs to a kernel. Drivers add time and runners."""

    def __init__(self, kernel: Kernel, sink: Sink) -> None:
        self.kernel = kernel
        self._sink = sink
        self._arrived: deque[Input] = deque()  # inputs that are not done with
        self.watchers: list[Callable[[int, Input, Sequence[Record]], None]] = []
        self.failure: BaseException | None = None  # why nothing can be written any more

    @abstractmethod
    def now_us(self) -> int:
        """Microseconds since the run began."""

    def deliver(self, happened: Input) -> None:
        """Take in an input: step, journal, act.

        If it cannot be written, nothing of what follows from it is done: the run is abandoned and
        the error raised, now and at every further input.
        """
        if self.failure is not None:
            raise self.failure
        self._arrived.append(happened)
        if len(self._arrived) > 1:  # from within: after what goes on now
            return
        try:
            while self._arrived:
                if not self.kernel.status.ended:
                    self._deliver(self._arrived[0])
                self._arrived.popleft()
        finally:
            self._arrived.clear()

    def _deliver(self, happened: Input) -> None:
        records, commands = self.kernel.step(happened)
        self._keep(happened, records)
        for command in commands:
            if isinstance(command, Start):
                self.start(command)
            elif isinstance(command, Load):
                self.load(command.runner)
            elif isinstance(command, Stop):
                self.stop(command.number)
            elif isinstance(command, Unload):
                self.unload(command.runner)

    def mark(self, happened: Input) -> None:
        """Write down what changes nothing in the run: an input of one of the kinds ``MARKS``."""
        if self.failure is not None:
            raise self.failure
        assert happened.kind in MARKS, "a mark changes nothing"
        self._keep(happened, ())

    def _keep(self, happened: Input, records: Sequence[Record]) -> None:
        at_us = self.now_us()
        try:
            self._sink.write(at_us, happened, records)
        except BaseException as error:
            self.failure = error
            self.abandon()
            raise
        for watcher in self.watchers:
            watcher(at_us, happened, records)

    def abandon(self) -> None:  # noqa: B027 - a driver without runners of its own has nothing to do
        """Stop all runners without a word to the kernel: nothing can be written any more."""

    @abstractmethod
    def start(self, command: Start) -> None:
        """Let an instance act."""

    @abstractmethod
    def load(self, runner: int) -> None:
        """Load a runner; deliver LOADED or NOT_LOADED."""

    @abstractmethod
    def stop(self, number: int) -> None:
        """Let an instance stop; deliver STOPPED."""

    @abstractmethod
    def unload(self, runner: int) -> None:
        """Unload a runner."""

    def cancel(self, reason: str) -> None:
        """Stop the run."""
        self.deliver(Input(Kind.CANCEL, message=reason))


# ---- Dependencies of runners: the order of loading, and loaded runners in virtual time -----------


Key = tuple[str, str]
"""Interface and provider."""

_MOST = 1_000  # runners that one may depend on, directly or not


class DependencyError(RunnerError):
    """A runner cannot be loaded because another one, which it depends on, cannot."""


def loading_order(key: Key, depends_on: Callable[[str, str], Sequence[Key]]) -> list[Key]:
    """A runner and what it depends on, which comes first. A circle is cut where it closes.

    Raises RunnerError if it depends on more than 1,000 runners.
    """
    order: dict[Key, None] = {}
    seen = {key}
    pending = [(key, deque(depends_on(*key)))]
    while pending:
        current, rest = pending[-1]
        if not rest:
            order[current] = None
            pending.pop()
            continue
        wanted = rest.popleft()
        if wanted not in seen:
            if len(seen) > _MOST:
                raise RunnerError(f"it depends on more than {_MOST:,} runners")
            seen.add(wanted)
            pending.append((wanted, deque(depends_on(*wanted))))
    return list(order)


class _Resident:
    __slots__ = ("key", "runner", "users")

    def __init__(self, key: tuple[Key, int], runner: Runner) -> None:
        self.key = key
        self.runner = runner
        self.users = 0


class Loaded:
    """The runners that are loaded, each once, with what they depend on.

    ``load`` makes and loads a runner and may raise anything, ``unload`` lets go of one and raises
    nothing but KeyboardInterrupt. Both are done at once.
    """

    def __init__(
        self,
        load: Callable[[Key], Runner],
        unload: Callable[[Runner], None],
        depends_on: Callable[[str, str], Sequence[Key]],
    ) -> None:
        self._load = load
        self._unload = unload
        self._depends_on = depends_on
        self._present: dict[tuple[Key, int], _Resident] = {}
        self._held: dict[tuple[Key, int], list[_Resident]] = {}

    def acquire(self, key: Key, copy: int = -1) -> Runner:
        """Load a runner after what it depends on; with ``copy`` one of several of the same key.

        Raises whatever goes wrong; then nothing of it stays loaded.
        """
        held = self._held[key, copy] = []
        try:
            for wanted in loading_order(key, self._depends_on):
                place = (wanted, copy if wanted == key else -1)
                resident = self._present.get(place)
                if resident is None:
                    resident = _Resident(place, self._loaded(wanted, key))
                    self._present[place] = resident
                resident.users += 1
                held.append(resident)
        except BaseException:
            self.release(key, copy)
            raise
        return held[-1].runner

    def _loaded(self, wanted: Key, key: Key) -> Runner:
        try:
            return self._load(wanted)
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            if wanted == key:
                raise
            problem = str(error) if isinstance(error, RunnerError) else said(error)
            name = wanted[1] or wanted[0]
            raise DependencyError(f"{name}, which it depends on: {problem}") from None

    def release(self, key: Key, copy: int = -1) -> None:
        """Unload a runner and then what it depends on, as far as nobody else needs that."""
        for resident in reversed(self._held.pop((key, copy), [])):
            resident.users -= 1
            if not resident.users:
                del self._present[resident.key]
                self._unload(resident.runner)
