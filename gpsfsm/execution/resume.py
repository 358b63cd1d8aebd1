"""Going on with a run whose process has ended.

In virtual time the run is simulated once more from its beginning: everything up to the last event
must come again, and then it goes on. In real time nothing can be repeated: the journaled inputs
are replayed without acting, and then each instance that was active is asked again or has failed.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, Protocol

from gpsfsm.errors import InternalError, UsageError
from gpsfsm.execution.host import Host
from gpsfsm.execution.journal_errors import ReplayDivergence
from gpsfsm.execution.journal_rows import input_of, line
from gpsfsm.execution.records import MARKS, Input, Kind, Status
from gpsfsm.execution.replay import replay

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.execution.kernel import Kernel
    from gpsfsm.execution.records import Left
    from gpsfsm.execution.replay import Comparing

__all__ = ["Adopting", "Simulation", "resume_into", "settle", "simulate_again"]

_FROM_OUTSIDE = (Kind.PAUSE, Kind.RESUME, Kind.CANCEL, Kind.NOTE)
"""Inputs that do not come by themselves when a run is simulated again."""


class Simulation(Protocol):
    """What a driver in virtual time must offer."""

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


class Adopting(Host):
    """A host that can go on with a run of another process."""

    @abstractmethod
    def adopt(self, left: Left) -> None:
        """Set the clock, load what was loaded, then let ``settle`` see to the instances."""


def _unpause(host: Simulation | Host) -> None:
    """Go on: whoever wanted the pause was the process that has ended."""
    if host.kernel.paused and host.kernel.status is Status.RUNNING:
        host.deliver(Input(Kind.RESUME))


def resume_into(host: Adopting, rows: Iterable[Row]) -> None:
    """Go on with a run in real time; the kernel of ``host`` is fresh, ``rows`` is what happened.

    The sink of ``host`` must be the ``RunWriter`` that ``Journal.go_on`` gives. Nothing is done for
    a run that has ended. Raises ReplayDivergence or DamagedJournalError if the journal does not
    fit.
    """
    if host.kernel.status is not Status.QUEUED:
        raise UsageError("a run can be resumed only into a kernel that has not begun")
    left = replay(host.kernel, rows)
    if not host.kernel.status.ended:
        host.adopt(left)


def settle(host: Host, left: Left, idempotent: Callable[[int], bool]) -> None:
    """See to what another process left, once clock and runners are ready (for ``adopt``).

    ``idempotent`` tells of a runner whether it may be asked again. Those instances are started
    again with the same key, unless the run does not need them any more; the others have failed.
    Runners that were being loaded are loaded. What was to stop has stopped with its process; if
    that was because its time was over, it has failed.
    """
    kernel = host.kernel
    host.mark(Input(Kind.CONTINUED))
    if kernel.status is Status.QUEUED:
        host.deliver(Input(Kind.BEGIN))
        _unpause(host)
        return
    again = []
    for start in left.active:
        number = start.number
        if number in kernel.overdue:
            host.deliver(Input(Kind.STOPPED, number, message="its process has ended"))
        elif kernel.status is Status.RUNNING and idempotent(start.runner):
            again.append(start)
        elif kernel.status is Status.RUNNING:
            message = "the process ended while it was active"
            host.deliver(Input(Kind.FAILED, number, message=message))
        elif number in kernel.active:
            host.deliver(Input(Kind.STOPPED, number, message="its process has ended"))
    for start in again:
        number = start.number
        if number not in kernel.active:
            continue
        if kernel.status is Status.RUNNING:
            host.mark(Input(Kind.RESTARTED, number))
            host.start(start)
        else:
            host.deliver(Input(Kind.STOPPED, number, message="its process has ended"))
    for runner in left.loading:
        if kernel.status is Status.RUNNING:
            host.load(runner)
    _unpause(host)
