"""Dangling events: outcomes for which the machine does not say what happens next."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from gpsfsm.analysis import counterexamples
from gpsfsm.analysis.claims import Claim
from gpsfsm.analysis.decisions import Analysis
from gpsfsm.analysis.encode import FALSE, conjunction, negation
from gpsfsm.model.automaton import Automaton, NodeKind, Signal
from gpsfsm.model.event import End, Event, Outcome
from gpsfsm.model.report import Dangling

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from gpsfsm.analysis.proof.refutation import Refutation
    from gpsfsm.analysis.proof.witnesses import Witnesses
    from gpsfsm.analysis.solver import Solver
    from gpsfsm.analysis.structure import Structure
    from gpsfsm.compile import Compiled

Effect = Literal["give_up", "stuck", "dont_care"]


class Leads:
    """Tells of a signal whether it leads, through joins, to a runner or to completion."""

    def __init__(self, automaton: Automaton) -> None:
        self._automaton = automaton
        self._to_runner = self._joins_before(NodeKind.RUNNER)
        self._to_complete = self._joins_before(NodeKind.COMPLETE)

    def to_runner(self, signal: Signal | None) -> bool:
        """True if some runner instance is connected to the signal, perhaps through joins."""
        return self._leads(signal, NodeKind.RUNNER, self._to_runner)

    def to_complete(self, signal: Signal | None) -> bool:
        """True if ``complete`` is connected to the signal, perhaps through joins."""
        return self._leads(signal, NodeKind.COMPLETE, self._to_complete)

    def dangles(self, signal: Signal) -> bool:
        """True if the event is connected to no runner instance and not to ``complete``."""
        return not self.to_runner(signal) and not self.to_complete(signal)

    def _leads(self, signal: Signal | None, kind: NodeKind, joins: frozenset[int]) -> bool:
        if signal is None:
            return False
        targets = self._automaton.outputs.get(signal, ())
        nodes = self._automaton.nodes
        return any(nodes[target].kind is kind or target in joins for target in targets)

    def _joins_before(self, kind: NodeKind) -> frozenset[int]:
        """The joins from which a node of this kind can be reached through joins only."""
        # By hand, since each check asks: 0.1 s for 100,000 runners; networkx, which would get a
        # graph of the joins for it, takes 0.3 to 1 s.
        nodes, inputs = self._automaton.nodes, self._automaton.inputs
        joins: set[int] = set()
        pending = [node.index for node in nodes if node.kind is kind]
        while pending:
            for source, event in inputs[pending.pop()]:
                if (
                    nodes[source].kind is NodeKind.JOIN
                    and event is Event.SUCCEEDED
                    and source not in joins
                ):
                    joins.add(source)
                    pending.append(source)
        return frozenset(joins)


class DanglingEvent(NamedTuple):
    """``runner`` is the number of the instance."""

    runner: int
    event: Event
    effect: Effect


Answer = tuple[DanglingEvent, ...]

_CONSIDERED = (Event.SUCCEEDED, Event.FAILED)


def _candidates(automaton: Automaton) -> list[tuple[int, Event]]:
    """The events that are connected to no runner instance and not to completion."""
    leads = Leads(automaton)
    return [
        (number, event)
        for number, node in enumerate(automaton.runners)
        for event in _CONSIDERED
        if leads.dangles(Signal(node.index, event))
    ]


def by_structure(structure: Structure) -> Answer:
    """An event gives up where nothing around it can still save the plan."""
    danglers = []
    for number, event in _candidates(structure.compiled.automaton):
        unit = structure.unit_of[number]
        if structure.reached[unit]:
            if event is Event.FAILED:
                ends = structure.fails_plan[unit] and structure.can_fail[unit]
            else:
                ends = structure.success_fails_plan[unit] and structure.can_succeed[unit]
            danglers.append(DanglingEvent(number, event, "give_up" if ends else "dont_care"))
    return tuple(danglers)


def by_solver(solver: Solver) -> Answer:
    """Compare each run that gives up with the one in which the instance succeeds instead."""
    encoding, automaton = solver.encoding, solver.automaton
    candidates = _candidates(automaton)
    nodes = [automaton.runners[number].index for number, _ in candidates]
    reached = solver.decide([encoding.triggered(node) for node in nodes])
    ends = solver.decide(questions(solver))
    earlier: deque[counterexamples.Scenario] = deque(maxlen=2)
    lost: Effect = "give_up" if automaton.traits.gives_up else "stuck"
    return tuple(
        DanglingEvent(
            number,
            event,
            lost if ended and _decides(solver, number, event, earlier) else "dont_care",
        )
        for (number, event), there, ended in zip(candidates, reached, ends, strict=True)
        if there
    )


def _lost(automaton: Automaton) -> End:
    """The end of a run that nothing saves; without give-up, it hangs."""
    return End.GAVE_UP if automaton.traits.gives_up else End.HANG


def _ends(solver: Solver, node: int, event: Event) -> str:
    """The instance emits the event and the plan gives up."""
    return conjunction((solver.encoding.happens(Signal(node, event)), solver.encoding.lost))


def questions(solver: Solver) -> list[str]:
    """True if the event comes and the plan gives up, for each that may dangle."""
    runners = solver.automaton.runners
    return [
        _ends(solver, runners[number].index, event)
        for number, event in _candidates(solver.automaton)
    ]


def _decides(
    solver: Solver, number: int, event: Event, earlier: deque[counterexamples.Scenario]
) -> bool:
    """True if in some scenario the plan gives up because this event comes.

    ``earlier`` keeps the last scenarios that convinced, for the next instance.
    """
    signal = Signal(solver.automaton.runners[number].index, event)
    lost = _lost(solver.automaton)
    claim = Claim(happens=(signal,), ends=lost)
    if event is Event.FAILED:
        for outcomes in counterexamples.candidates(solver, claim, number, tuple(earlier)):
            flipped = (*outcomes[:number], Outcome.SUCCEEDED, *outcomes[number + 1 :])
            run = solver.play().run(outcomes.__getitem__)
            saved = solver.evaluator.run(flipped.__getitem__).ends is not lost
            if run.happens(signal) and run.ends is lost and saved:
                earlier.append(outcomes)
                return True
    return solver.decide([conjunction((claim.term(solver), _saved(solver, number, event)))])[0]


def _saved(solver: Solver, number: int, event: Event = Event.FAILED) -> str:
    """Had this instance ended the other way, in the same scenario, the plan would not give up."""
    encoding, automaton = solver.encoding, solver.automaton
    node = automaton.runners[number].index
    triggered = encoding.triggered(node)
    other = Event.SUCCEEDED if event is Event.FAILED else Event.FAILED
    changed = {
        Signal(node, other): triggered,
        Signal(node, Event.STARTED): FALSE if node in automaton.traits.silent else triggered,
        Signal(node, event): FALSE,
    }
    variant = encoding.variant(changed)
    solver.tell(variant.definitions)
    return negation(variant.lost)


def facts(answer: Answer | None, compiled: Compiled) -> Mapping[str, Any]:
    """The fact ``dangling``."""
    plan = compiled.automaton.plan
    return {
        "dangling": tuple(
            Dangling(plan.path(plan.runners[number]), event, effect)
            for number, event, effect in answer or ()
        )
    }


def dangling_claim(automaton: Automaton, dangler: DanglingEvent) -> Claim:
    """The event happens; if that is its effect, the plan gives up because of it."""
    node = automaton.runners[dangler.runner].index
    happens = (Signal(node, dangler.event),)
    fails = dangler.event is Event.FAILED
    ends = None if dangler.effect == "dont_care" else _lost(automaton)

    def failing(structure: Structure) -> Iterator[int]:
        unit = structure.unit_of[dangler.runner]
        yield from structure.failing(unit) if fails else structure.succeeding(unit)
        if ends is None:
            yield from structure.failing_before(unit)
        else:
            yield from structure.failing_around(unit, same=fails)

    return Claim(
        happens=happens,
        ends=ends,
        more=(lambda solver: _saved(solver, dangler.runner, dangler.event)) if ends else None,
        failing=failing,
    )


def refute(answer: Answer, refutation: Refutation) -> None:
    """No event without effect makes the plan give up that would not give up with the other one."""
    idle = [dangler for dangler in answer if dangler.effect == "dont_care"]
    if not idle:
        return
    circuit, automaton = refutation.circuit, refutation.automaton
    flips = {dangler.runner: circuit.fresh() for dangler in idle}
    refutation.at_most_one(flips.values())
    flipped = refutation.flipped(flips)
    lost = refutation.over, refutation.gave_up, -flipped.fired[automaton.give_up]
    comes = (
        (flips[runner], refutation.snapshot.happens(Signal(automaton.runner_node(runner), event)))
        for runner, event, _ in idle
    )
    refutation.never(circuit.all((*lost, circuit.any(map(circuit.all, comes)))))


def show(answer: Answer, witnesses: Witnesses) -> None:
    """A run that gives up with the event, and its twin that does not with the other one."""
    automaton = witnesses.automaton
    for dangler in answer:
        if dangler.effect == "dont_care":
            continue
        claim = dangling_claim(automaton, dangler)
        failing = frozenset(claim.failing(witnesses.structure))
        end = automaton.give_up
        witnesses.expect(witnesses.lane(failing), happens=claim.happens, triggered=(end,))
        spared = dangler.runner if dangler.event is Event.FAILED else None
        other = witnesses.lane(failing ^ {dangler.runner}, spared=spared)
        witnesses.expect(other, absent=(end,))


ANALYSIS = Analysis("dangling", by_structure, by_solver, facts, questions, refute, show)
