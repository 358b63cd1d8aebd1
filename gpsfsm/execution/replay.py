"""Replays of journaled runs: events compared, runs simulated again, and runs gone on with."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace
from typing import TYPE_CHECKING, Protocol

from gpsfsm.errors import InternalError, UsageError
from gpsfsm.execution.host import Host
from gpsfsm.execution.journal_errors import DamagedJournalError, ReplayDivergence
from gpsfsm.execution.journal_rows import RowMaker, input_of, line
from gpsfsm.execution.records import MARKS, Input, Kind, Left, Start, Status

if TYPE_CHECKING:
    from collections.abc import Container, Iterable, Sequence

    from gpsfsm.execution.host import Sink
    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.execution.kernel import Kernel
    from gpsfsm.execution.records import Record


class Comparing:
    """A sink that compares what comes with what is journaled, and then appends.

    For runs in virtual time: they are simulated once more from their beginning. Without a
    ``writer`` nothing may come that is not in the journal. ``is_new`` says whether what was written
    last was not in the journal before.
    """

    def __init__(self, kernel: Kernel, rows: Iterable[Row], writer: Sink | None = None) -> None:
        self._maker = RowMaker(kernel)
        self._rows = iter(rows)
        self._writer = writer
        self.next: Row | None = next(self._rows, None)
        self.is_new = False

    def write(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        """Raises ReplayDivergence at the first event that differs."""
        self.is_new = self.next is None
        if self.next is None and self._writer is not None:
            self._writer.write(at_us, happened, records)
            return
        for row in self._maker.make(at_us, happened, records):
            got, expected = line(row), "" if self.next is None else line(self.next)
            if got != expected:
                raise ReplayDivergence(row.seq, expected, got)
            self.next = next(self._rows, None)


def replay(kernel: Kernel, rows: Iterable[Row]) -> Left:
    """Take a fresh kernel through the events of a run, without acting.

    Returns what the run has left to do; for a run that has ended, nothing. Raises
    ReplayDivergence at the first event that differs, DamagedJournalError for impossible ones.
    """
    sink = Comparing(kernel, rows)
    starts: dict[int, Start] = {}
    loading: dict[int, None] = {}
    at_us = 0
    while (row := sink.next) is not None:
        if not row.input:
            raise ReplayDivergence(row.seq, line(row), "")
        at_us = row.at_us
        happened = input_of(row, len(kernel.runner_of), len(kernel.runners))
        sink.write(at_us, happened, _follow(kernel, happened, row, (starts, loading)))
    return Left(
        at_us=at_us,
        active=tuple(starts[number] for number in kernel.active),
        loaded=tuple(kernel.loaded),
        loading=() if kernel.status.ended else tuple(loading),
    )


def _follow(
    kernel: Kernel,
    happened: Input,
    row: Row,
    left: tuple[dict[int, Start], dict[int, None]],
) -> Sequence[Record]:
    """The records that the kernel makes of an input; starts and loads are noted in ``left``."""
    if happened.kind in MARKS:
        return ()
    starts, loading = left
    try:
        records, commands = kernel.step(happened)
    except InternalError as error:
        raise DamagedJournalError(f"event {row.seq} cannot have happened: {error}") from error
    loading.pop(happened.runner, None)
    for command in commands:
        if isinstance(command, Start):
            starts[command.number] = command
    for record in records:
        if record.kind is Kind.LOADING:
            loading[record.runner] = None
    return records


_FROM_OUTSIDE = (Kind.PAUSE, Kind.RESUME, Kind.CANCEL, Kind.NOTE)
"""Inputs that do not come by themselves when a run is simulated again."""


class Simulation(Protocol):
    """A driver in virtual time, as far as replays need it."""

    kernel: Kernel

    def now_us(self) -> int:
        """The virtual time."""

    def pass_to(self, at_us: int) -> None:
        """Let time pass, if nothing happens until then."""

    def deliver(self, happened: Input) -> None:
        """Take in an input."""

    def mark(self, happened: Input) -> None:
        """Write down what changes nothing in the run."""

    def advance(self) -> bool:
        """Let the next event happen; False if there is none."""

    def abandon(self) -> None:
        """Stop all that still acts."""


def simulate_again(driver: Simulation, sink: Comparing) -> None:
    """Run a plan in virtual time to its end; ``sink`` is the driver's and knows what happened.

    What came from outside (pause, cancel, …) comes again at the same time. Raises
    ReplayDivergence if anything else differs. A run that paused when its process ended goes on.
    """
    past = sink.next is not None
    try:
        _intervene(driver, sink)
        driver.deliver(Input(Kind.BEGIN))
        _intervene(driver, sink)
        while not driver.kernel.status.ended:
            if past and sink.next is None:
                past = False
                _unpause(driver)
            elif not driver.advance():
                if driver.kernel.status is not Status.RUNNING:
                    raise InternalError("a run that is to stop does not end")
                driver.deliver(Input(Kind.SILENCE))
            _intervene(driver, sink)
    finally:
        driver.abandon()
    if sink.next is not None:
        raise ReplayDivergence(sink.next.seq, line(sink.next), "")


def _intervene(driver: Simulation, sink: Comparing) -> None:
    """Bring in again what came from outside at this time."""
    kernel = driver.kernel
    while (row := sink.next) is not None:
        if not row.input or row.kind not in _FROM_OUTSIDE:
            return
        driver.pass_to(row.at_us)
        if row.at_us > driver.now_us():
            return
        happened = input_of(row, len(kernel.runner_of), len(kernel.runners))
        if happened.kind in MARKS:
            driver.mark(happened)
        elif not kernel.status.ended:
            driver.deliver(happened)
        else:
            return


_ENDED = "its process has ended"


class Adopting(Host):
    """A host that can go on with a run of another process."""

    @abstractmethod
    def adopt(self, left: Left) -> None:
        """Set the clock, load what was loaded, then ``take_up`` the run and ``settle`` it."""

    def drop(self, start: Start) -> None:
        """An instance that was active is not needed any more: deliver STOPPED."""
        self.deliver(Input(Kind.STOPPED, start.number, message=_ENDED))


def _unpause(host: Simulation | Host) -> None:
    """Go on: whoever wanted the pause was the process that has ended."""
    if host.kernel.paused and host.kernel.status is Status.RUNNING:
        host.deliver(Input(Kind.RESUME))


def resume_into(host: Adopting, rows: Iterable[Row], cancel: str = "") -> None:
    """Go on with a run in real time; the kernel of ``host`` is fresh, ``rows`` is what happened.

    ``cancel``: nothing more of it may act, for this reason; what is left of it is brought to its
    end. The sink of ``host`` must be the ``RunWriter`` that ``Journal.go_on`` gives. Nothing is
    done for a run that has ended. Raises ReplayDivergence or DamagedJournalError if the journal
    does not fit.
    """
    if host.kernel.status is not Status.QUEUED:
        raise UsageError("a run can be resumed only into a kernel that has not begun")
    left = replay(host.kernel, rows)
    if not host.kernel.status.ended:
        host.adopt(replace(left, cancel=cancel))


def take_up(host: Adopting, left: Left) -> None:
    """Write down that a run goes on here, or is cancelled here (for ``adopt``)."""
    host.mark(Input(Kind.CONTINUED))
    if left.cancel and host.kernel.ending is None:
        host.deliver(Input(Kind.CANCEL, message=left.cancel))
    if host.kernel.status is Status.QUEUED:
        host.deliver(Input(Kind.BEGIN))


def is_wanted(kernel: Kernel, start: Start) -> bool:
    """True if an instance that was active when its process ended is to have an outcome yet."""
    return kernel.status is Status.RUNNING and not kernel.is_stopping(start.number)


def settle(host: Adopting, left: Left, repeatable: Container[int]) -> None:
    """See to the instances of a run that was taken up, once the runners are ready (for ``adopt``).

    ``repeatable`` are the instances that may be asked again. Those are started again with the same
    key, unless the run does not need them any more; the others have failed.
    Runners that were being loaded are loaded. What was to stop has stopped with its process; if
    that was because its time was over, it has failed.
    """
    kernel, again = host.kernel, []
    for start in left.active:
        number = start.number
        if kernel.is_stopping(number):
            host.deliver(Input(Kind.STOPPED, number, message=_ENDED))
        elif is_wanted(kernel, start) and number in repeatable:
            again.append(start)
        elif kernel.status is Status.RUNNING:
            message = "the process ended while it was active"
            host.deliver(Input(Kind.FAILED, number, message=message))
        elif number in kernel.active:
            host.drop(start)
    for start in again:
        number = start.number
        if number not in kernel.active:
            continue
        if kernel.status is Status.RUNNING and not kernel.is_stopping(number):
            host.mark(Input(Kind.RESTARTED, number))
            host.start(start)
        else:
            host.drop(start)
    for runner in left.loading:
        if kernel.status is Status.RUNNING:
            host.load(runner)
        elif not kernel.status.ended:  # a run that is to stop waits for those, too
            host.deliver(Input(Kind.NOT_LOADED, runner=runner, message=_ENDED))
    _unpause(host)
