"""The kernel of machines: what an outcome leads to is decided by ``Instants``, visit after visit.

The instants are those of semantics 9.2, and the configuration is what they say: an instance counts
as active from the instant of its trigger to that of its outcome or its stop. What takes time in a
real run happens within that, or behind it:

    trigger          its runner is loaded if it is not, then it acts; if that fails, it has failed
    stop             it is asked to stop, and is idle from that instant on; what it does until it
                     has stopped has no effect
    stop, trigger    what is triggered at the instant of a stop starts once that has stopped; so
                     does what was stopped before, and is triggered again
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.compile.instants import AT_FIRST, COMPLETED, GAVE_UP, GOING, STARTED, STOPPED, Instants
from gpsfsm.compile.units import MachinePlan
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.records import Kind, Start, Status

if TYPE_CHECKING:
    from gpsfsm.compile import Compiled
    from gpsfsm.compile.instants import Instant
    from gpsfsm.execution.records import RunValue

_ENDS = {COMPLETED: Status.COMPLETED, GAVE_UP: Status.GAVE_UP}


class MachineKernel(Kernel):
    """One run of a machine.

    ``visits_of`` counts how often each instance has been triggered. With ``most_visits`` the run
    is cancelled at the instant at which more than so many visits would have begun. Runners stay
    loaded until the run ends, for any of them may be needed again.
    """

    _prunes = False

    def __init__(self, compiled: Compiled, *, most_visits: int | None = None) -> None:
        super().__init__(compiled)
        self.instants = Instants(compiled.automaton)
        self.configuration = AT_FIRST
        self.visits_of = [0] * len(compiled.automaton.runners)
        self._most_visits = most_visits
        self._stopping: dict[int, None] = {}  # active instances that the machine has stopped
        self._stopped_now: set[int] = set()  # by the instant that happens now
        # triggered instances, with their parameters and those that they wait for to have stopped
        self._behind: dict[int, tuple[dict[str, RunValue], set[int]]] = {}

    def is_stopping(self, number: int) -> bool:
        """True if an active instance has been asked to stop while the run goes on."""
        return number in self._stopping or number in self.overdue

    def _is_still(self) -> bool:
        return not self.configuration.active

    # -- instants ---------------------------------------------------------------------------

    def _emit_outcome(self, node: int, succeeded: bool) -> None:
        super()._emit_outcome(node, succeeded)
        self._follow(self._queue.popleft())  # before anything else is: an instant has one outcome

    def _follow(self, signal: int) -> None:
        """Let an instant happen: the first one, or that of an outcome."""
        node, event = divmod(signal, 4)
        if self._outcome is not None:
            return
        if node in self.automaton.starts:
            self._happen(self.instants.first(), signal)
        else:
            number = self.automaton.runner_number(node)
            self._happen(self.instants.after(self.configuration, number, event), signal)

    def _happen(self, instant: Instant, signal: int) -> None:
        self.visits += len(instant.events)
        self.configuration = instant.configuration
        if instant.configuration.ended != GOING:
            self._record_joins(instant)
            self._outcome = _ENDS[instant.configuration.ended]
            return
        begun = sum(vertex % 4 == STARTED for vertex in instant.events)
        if self._most_visits is not None and sum(self.visits_of) + begun > self._most_visits:
            reason = f"{self._most_visits:,} visits have begun, and --max-visits allows no more"
            self._record(Kind.CANCEL, message=reason)
            self._outcome = Status.CANCELLED
            return
        outputs = self._outputs.get(signal >> 2, {})
        handed = dict.fromkeys(self._targets.get(signal, ()), outputs)
        for vertex in instant.events:
            if vertex % 4 == STOPPED:
                self._stop(self.automaton.runner_number(vertex // 4))
        self._record_joins(instant)
        for vertex in instant.events:
            if vertex % 4 == STARTED:
                node = vertex // 4
                self._arriving[node] = handed.get(node, {})
                self._trigger(self.automaton.runner_number(node))
        self._stopped_now.clear()

    def _record_joins(self, instant: Instant) -> None:
        for vertex in instant.events:
            if self._is_join[vertex // 4]:
                self._record(Kind.JOINED, vertex // 4)

    # -- instances --------------------------------------------------------------------------

    def _trigger(self, number: int) -> None:
        self.visits_of[number] += 1
        if self.visits_of[number] > 1:
            self._visits[number] = f"visit {self.visits_of[number]:,}"
        self._outputs.pop(self.automaton.runner_node(number), None)
        super()._trigger(number)

    def _resume(self) -> None:
        self._stopped_now = set(self._stopping)
        super()._resume()
        self._stopped_now = set()

    def _launch(self, number: int, parameters: dict[str, RunValue]) -> None:
        waits = self._stopped_now.copy()
        if number in self.active:
            assert number in self._stopping, "what is active is not triggered"
            waits.add(number)
        if waits:
            self._behind[number] = parameters, waits
        else:
            super()._launch(number, parameters)

    def _start(self, number: int, parameters: dict[str, RunValue]) -> None:
        self.active[number] = None
        node = self.automaton.runner_node(number)
        self._record(Kind.STARTED, node, message=self._visits.get(number, ""))
        runner, visit = self.runner_of[number], self.visits_of[number]
        self._commands.append(Start(number, runner, parameters.copy(), visit))

    def _not_started(self, number: int) -> None:
        if self._outcome is None:
            super()._not_started(number)
        else:  # the run has ended since
            node = self.automaton.runner_node(number)
            self._record(Kind.STOPPED, node, message="never started")

    def _stop(self, number: int) -> None:
        """The machine stops an instance, which acts or is about to."""
        node = self.automaton.runner_node(number)
        never_started = (
            self._waiting.pop(number, None) is not None
            or self._behind.pop(number, None) is not None
        )
        if number in self._held:
            self._held.remove(number)
            never_started = True
        for waiting in (self._refused, self._loading.get(self.runner_of[number], [])):
            if number in waiting:
                waiting.remove(number)
        if never_started:
            self._record(Kind.STOPPED, node, message="never started")
            return
        assert number in self.active, "only what is active emits STOPPED"
        self._stopping[number] = None
        self._stopped_now.add(number)
        if self.overdue.pop(number, None) is None:
            self._ask_to_stop(number)

    def _stopped(self, number: int, message: str) -> None:
        self._stopping.pop(number, None)
        super()._stopped(number, message)
        for waiting, (parameters, waits) in [*self._behind.items()]:
            waits.discard(number)
            if not waits and self._outcome is None:
                del self._behind[waiting]
                super()._launch(waiting, parameters)

    def _stop_all(self) -> None:
        for number in reversed(self._behind):
            self._record(Kind.STOPPED, self.automaton.runner_node(number), message="never started")
        self._behind.clear()
        super()._stop_all()


def kernel_of(compiled: Compiled, *, apart: bool = False, most_visits: int | None = None) -> Kernel:
    """The kernel of one run of a plan or of a machine; ``most_visits`` are those of a machine."""
    if isinstance(compiled.automaton.plan, MachinePlan):
        return MachineKernel(compiled, most_visits=most_visits)
    return Kernel(compiled, apart=apart)
