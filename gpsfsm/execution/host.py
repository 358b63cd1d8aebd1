"""What all drivers share: the way from an input to its effects.

An input goes into the kernel, what follows is journaled, and only then is anything done.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from typing import TYPE_CHECKING, Protocol

from gpsfsm.execution.records import MARKS, Input, Kind, Load, Start, Stop, Unload

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from gpsfsm.execution.kernel import Kernel
    from gpsfsm.execution.records import Record


class Sink(Protocol):
    """Where a run is written: a journal, a list, a terminal."""

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
