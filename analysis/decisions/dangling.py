"""Dangling events: outcomes for which the machine does not say what happens next."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from gpsfsm.analysis import witness
from gpsfsm.analysis.claims import Claim
from gpsfsm.analysis.encode import FALSE, conjunction, negation
from gpsfsm.analysis.graph import Leads
from gpsfsm.analysis.registry import Analysis
from gpsfsm.model.automaton import Automaton, Signal
from gpsfsm.model.event import End, Event, Outcome
from gpsfsm.model.report import Dangling

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.analysis.solver import Solver
    from gpsfsm.analysis.structure import Structure
    from gpsfsm.compile import Compiled

__all__ = ["ANALYSIS", "DanglingEvent", "dangling_claim"]

Effect = Literal["give_up", "dont_care"]


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
    """A failure gives up where nothing around it can still save the plan."""
    found = []
    for number, event in _candidates(structure.compiled.automaton):
        unit = structure.unit_of[number]
        if structure.reached[unit]:
            ends = structure.fails_plan[unit] and structure.can_fail[unit]
            found.append(DanglingEvent(number, event, "give_up" if ends else "dont_care"))
    return tuple(found)


def by_solver(solver: Solver) -> Answer:
    """Compare each run that gives up with the one in which the instance succeeds instead."""
    encoding, automaton = solver.encoding, solver.automaton
    candidates = _candidates(automaton)
    nodes = [automaton.runners[number].index for number, _ in candidates]
    reached = solver.decide([encoding.triggered(node) for node in nodes])
    ends = solver.decide(questions(solver))
    earlier: deque[witness.Scenario] = deque(maxlen=2)
    return tuple(
        DanglingEvent(
            number,
            event,
            "give_up" if ended and _decides(solver, number, event, earlier) else "dont_care",
        )
        for (number, event), there, ended in zip(candidates, reached, ends, strict=True)
        if there
    )


def _ends(solver: Solver, node: int, event: Event) -> str:
    """The instance emits the event and the plan gives up."""
    give_up = solver.encoding.triggered(solver.automaton.give_up)
    return conjunction((solver.encoding.happens(Signal(node, event)), give_up))


def questions(solver: Solver) -> list[str]:
    """Whether the event comes and the plan gives up, for each that may dangle."""
    runners = solver.automaton.runners
    return [
        _ends(solver, runners[number].index, event)
        for number, event in _candidates(solver.automaton)
    ]


def _decides(solver: Solver, number: int, event: Event, earlier: deque[witness.Scenario]) -> bool:
    """Whether in some scenario the plan gives up because this event comes.

    ``earlier`` keeps the last scenarios that convinced, for the next instance.
    """
    signal = Signal(solver.automaton.runners[number].index, event)
    claim = Claim(happens=(signal,), ends=End.GAVE_UP)
    if event is Event.FAILED:
        for outcomes in witness.candidates(solver, claim, number, tuple(earlier)):
            flipped = (*outcomes[:number], Outcome.SUCCEEDED, *outcomes[number + 1 :])
            run = solver.evaluator.run(outcomes.__getitem__)
            saved = solver.evaluator.run(flipped.__getitem__).ends is not End.GAVE_UP
            if run.happens(signal) and run.ends is End.GAVE_UP and saved:
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
        Signal(node, Event.STARTED): triggered,
        Signal(node, event): FALSE,
    }
    variant = encoding.variant(changed)
    solver.tell(variant.definitions)
    return negation(variant.triggered(automaton.give_up))


def facts(answer: Answer | None, compiled: Compiled) -> Mapping[str, Any]:
    """The fact ``dangling``."""
    plan = compiled.automaton.plan
    return {
        "dangling": tuple(
            Dangling(plan.path(plan.runners[number]), event, effect)
            for number, event, effect in answer or ()
        )
    }


def dangling_claim(automaton: Automaton, found: DanglingEvent) -> Claim:
    """The instance fails; if that is its effect, the plan gives up because of it."""
    node = automaton.runners[found.runner].index
    happens = (Signal(node, found.event),)
    if found.event is Event.SUCCEEDED:  # only in behaviour trees, which z3 decides then
        gives_up = found.effect == "give_up"
        return Claim(
            happens=happens,
            ends=End.GAVE_UP if gives_up else None,
            more=(lambda solver: _saved(solver, found.runner, found.event)) if gives_up else None,
            failing=lambda s: s.failing_before(s.unit_of[found.runner]),
        )
    if found.effect == "dont_care":
        return Claim(
            happens=happens,
            failing=lambda s: (found.runner, *s.failing_before(s.unit_of[found.runner])),
        )
    return Claim(
        happens=happens,
        ends=End.GAVE_UP,
        more=lambda solver: _saved(solver, found.runner),
        failing=lambda s: (
            found.runner,
            *s.failing_before(s.unit_of[found.runner]),
            *s.failing_beside(s.unit_of[found.runner]),
        ),
    )


ANALYSIS = Analysis("dangling", by_structure, by_solver, facts, questions)
