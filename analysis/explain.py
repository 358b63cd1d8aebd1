"""From a full scenario to the decisions that matter.

The idea is that of Lohmann and Fahland ("Where did I go wrong?", BPM 2014): report the decisions
that lead to the problem, not the path. Here they are what remains of the run when it is followed
backwards from the claim: an event needs its runner's outcome and trigger, a join the inputs that
made it fire, and a node that never comes the inputs that it would have needed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.errors import InternalError
from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import End, Event

if TYPE_CHECKING:
    from gpsfsm.analysis.claims import Claim
    from gpsfsm.analysis.evaluate import Evaluator, OutcomeOf, Run

__all__ = ["Explanation", "explain"]


@dataclass(frozen=True, slots=True)
class Explanation:
    """``decisions``: runner numbers whose outcome matters; ``trace``: needed events in order.

    The first ``told`` events of the trace make the story; what follows only brings the run to its
    end.
    """

    decisions: tuple[int, ...]
    trace: tuple[Signal, ...]
    told: int
    ends: End
    steps: int  # the events of the whole run: what it cost to find out


def explain(
    claim: Claim, evaluator: Evaluator, outcome_of: OutcomeOf, *, no_start: bool
) -> Explanation:
    """The decisions and events that the claim rests on; ``no_start``: runners may not start.

    Raises InternalError if the scenario lacks an event of the claim.
    """
    run = claim.run(evaluator, outcome_of)
    if not all(map(run.happens, claim.happens)):
        raise InternalError("a scenario does not replay as it was claimed")
    search = _Search(evaluator, run, outcome_of, no_start)
    automaton = evaluator.automaton
    for signal in claim.happens:
        search.event(signal)
    for node in claim.absent:
        search.absence(node)
    if claim.outlives is not None:
        node = automaton.runner_node(claim.outlives)
        search.active(node)
    if claim.breaks is not None:
        search.breaking(claim.breaks)
    if run.ends is End.COMPLETED:
        search.node(automaton.complete)
    elif run.ends is End.GAVE_UP:
        search.node(automaton.give_up)
    elif run.ends is End.ABORT:
        deadly = run.broken.intersection(automaton.deadly)
        if claim.breaks not in deadly:
            search.breaking(min(deadly))
    else:
        search.absence(automaton.complete)
        search.absence(automaton.give_up)
    search.finish()
    decisions, trace = search.decisions, tuple(sorted(search.trace, key=run.place))
    if claim.through is not None:  # how long anything takes may matter for what is claimed
        decisions |= _all_triggered(evaluator, run).difference(claim.withheld)
    told = len(trace)
    if claim.meet:
        meeting = _meeting(claim, evaluator, outcome_of, no_start)
        decisions |= meeting.decisions
        first = sorted(meeting.trace, key=meeting.run.place)
        trace = (*first, *(signal for signal in trace if signal not in meeting.trace))
        told = len(first if claim.held is None else trace)
    return Explanation(
        decisions=tuple(sorted(decisions)),
        trace=trace,
        told=told,
        ends=run.ends,
        steps=len(run),
    )


def _all_triggered(evaluator: Evaluator, run: Run) -> set[int]:
    """The numbers of all runners that a run triggers."""
    automaton = evaluator.automaton
    return {
        automaton.runner_number(node)
        for node in run.triggered
        if automaton.nodes[node].kind is NodeKind.RUNNER
    }


def _meeting(claim: Claim, evaluator: Evaluator, outcome_of: OutcomeOf, no_start: bool) -> _Search:
    """Why the runners of ``claim.meet`` are active at once."""
    held = evaluator.run(outcome_of, withheld=claim.held_back)
    search = _Search(evaluator, held, outcome_of, no_start)
    for number in claim.meet:
        node = evaluator.automaton.runner_node(number)
        if node not in held.triggered:
            raise InternalError("a scenario does not replay as it was claimed")
        search.active(node)
    search.finish()
    return search


class _Search:
    def __init__(
        self, evaluator: Evaluator, run: Run, outcome_of: OutcomeOf, no_start: bool
    ) -> None:
        self.evaluator = evaluator
        self.automaton = evaluator.automaton
        self.run = run
        self.outcome_of = outcome_of
        self.no_start = no_start
        self.decisions: set[int] = set()
        self.trace: set[Signal] = set()
        self._seen: set[tuple[int, bool]] = set()
        self._pending: list[tuple[int, bool]] = []

    def node(self, node: int) -> None:
        """Ask why the node is triggered."""
        self._push(node, True)

    def absence(self, node: int) -> None:
        """Ask why the node is never triggered."""
        self._push(node, False)

    def breaking(self, join: int) -> None:
        """Ask why a second input comes at the join."""
        came = sorted(filter(self.run.happens, self.automaton.inputs[join]), key=self.run.place)
        loops = join in self.automaton.traits.looping  # then it is its own second input
        for signal in came[: 1 if loops and self.automaton.nodes[join].need == 1 else 2]:
            self.event(signal)

    def _push(self, node: int, present: bool) -> None:
        if (node, present) not in self._seen:
            self._seen.add((node, present))
            self._pending.append((node, present))

    def finish(self) -> None:
        """Follow everything backwards to the start."""
        while self._pending:
            node, present = self._pending.pop()
            inputs = self.automaton.inputs[node]
            need = self.automaton.nodes[node].need or 1
            if node in self.automaton.traits.breaking:  # and with two it would break
                need = min(need, 2)
            if present:
                came = sorted(
                    (signal for signal in inputs if self.run.happens(signal)), key=self.run.place
                )
                for signal in came[:need]:
                    self.event(signal)
            else:
                missing = [signal for signal in inputs if not self.run.happens(signal)]
                for signal in missing[: max(0, len(inputs) - need + 1)]:
                    self._missing(signal)

    def event(self, signal: Signal) -> None:
        """Ask why the event happens."""
        kind = self.automaton.nodes[signal.node].kind
        if kind is NodeKind.START:
            return
        if kind is NodeKind.RUNNER:
            self.trace.add(signal)
            if signal.event is not Event.STARTED or self.no_start:
                self.decisions.add(self.automaton.runner_number(signal.node))
            self.active(signal.node)
            return
        self.node(signal.node)

    def active(self, node: int) -> None:
        """Ask why the runner is triggered. Its STARTED, if it came, belongs to the trace."""
        started = Signal(node, Event.STARTED)
        if self.run.happens(started):
            self.trace.add(started)
        self.node(node)

    def _missing(self, signal: Signal) -> None:
        """Ask why the event never happens."""
        if self.automaton.nodes[signal.node].kind is not NodeKind.RUNNER:
            self.absence(signal.node)
            return
        if signal.node not in self.run.triggered:
            self.absence(signal.node)  # so its outcome does not matter
            return
        number = self.automaton.runner_number(signal.node)
        self.decisions.add(number)
        for event in self.automaton.emitted(signal.node, self.outcome_of(number)):
            if self.run.happens(Signal(signal.node, event)):
                self.trace.add(Signal(signal.node, event))
        self.active(signal.node)
