"""Scenarios in which a run takes too long or too much: the canonical one, and why it does.

z3 finds the scenario. What it rests on is read off the clocks: the event that comes last before a
join of all, all events of a join of the first.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.claims import Claim
from gpsfsm.analysis.decisions.energy import over_limit
from gpsfsm.analysis.decisions.makespan import overdue
from gpsfsm.analysis.encode import conjunction
from gpsfsm.analysis.minimal import canonical_scenario
from gpsfsm.analysis.solver import Inconclusive
from gpsfsm.analysis.timing.clocks import RealSolver, arrival, times, topological
from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import Event, Outcome

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from gpsfsm.analysis.context import Context
    from gpsfsm.analysis.evaluate import Evaluator
    from gpsfsm.analysis.solver import Solver
    from gpsfsm.analysis.timing.amounts import Amounts, Number

__all__ = ["late_claim", "thirsty_claim"]

_RLIMIT = 3_000_000
"""z3 steps per question. To find the fewest failures whose delays add up can take very long."""


def late_claim(context: Context, amounts: Amounts, deadline: float) -> tuple[Claim, Number] | None:
    """A run that can end after ``deadline`` seconds, and when it can end at the latest (in units).

    None if the plan is too large, or the solver reached its limit.
    """
    outcomes = _scenario(context, lambda real: overdue(real, amounts, deadline))
    if outcomes is None:
        return None
    longest = [most for _, most in amounts.ranges]
    events, absent, end = _delays(context.deciders.evaluator, outcomes, longest)
    return _claim(context, outcomes, events, absent), end


def thirsty_claim(context: Context, amounts: Amounts, limit: float) -> tuple[Claim, Number] | None:
    """A run that can take more than ``limit`` joules, and how much it can take (in units).

    None if the plan is too large, or the solver reached its limit.
    """
    outcomes = _scenario(context, lambda real: over_limit(real, amounts, limit))
    if outcomes is None:
        return None
    evaluator = context.deciders.evaluator
    run = evaluator.run(outcomes.__getitem__)
    node = evaluator.automaton.runner_node
    taking = [number for number in amounts.declared if node(number) in run.triggered]
    taking.sort(key=lambda number: -amounts.ranges[number][1])  # stable: then by number
    taken: Number = 0
    decisive: list[Signal] = []
    for number in taking:
        if not amounts.exceeds(taken, limit):
            decisive += evaluator.automaton.inputs[node(number)]  # what triggers it
        taken += amounts.ranges[number][1]
    return _claim(context, outcomes, decisive, ()), taken


def _scenario(context: Context, term: Callable[[Solver], str]) -> tuple[Outcome, ...] | None:
    deciders = context.deciders
    if not deciders.asks_solver or len(context.plan.runners) > context.options.second_opinion:
        return None
    rlimit = min(_RLIMIT, context.options.rlimit)
    try:
        real = RealSolver(deciders.fresh_solver(), rlimit=rlimit)
        return canonical_scenario(real, term(real))
    except Inconclusive:
        return None


def _claim(
    context: Context,
    outcomes: Sequence[Outcome],
    happens: Sequence[Signal],
    absent: Sequence[int],
) -> Claim:
    run = context.deciders.evaluator.run(outcomes.__getitem__)
    failing = [
        number for number, outcome in enumerate(outcomes) if outcome is not Outcome.SUCCEEDED
    ]
    return Claim(
        happens=tuple(dict.fromkeys(happens)),
        absent=tuple(dict.fromkeys(absent)),
        ends=run.ends,
        more=lambda solver: conjunction(
            solver.encoding.outcome(number, (outcome,)) for number, outcome in enumerate(outcomes)
        ),
        failing=lambda _: failing,
    )


def _delays(
    evaluator: Evaluator, outcomes: Sequence[Outcome], duration: Sequence[Number]
) -> tuple[list[Signal], list[int], Number]:
    """The events that the end of a run waits for, the nodes that do not help it, and its time."""
    automaton = evaluator.automaton
    run = evaluator.run(outcomes.__getitem__)
    known = times(automaton, topological(automaton), run, duration.__getitem__)
    end = automaton.complete if automaton.complete in known else automaton.give_up
    events: list[Signal] = []
    absent: list[int] = []
    seen = {end}
    pending = [end]
    while pending:
        node = pending.pop()
        came = [signal for signal in automaton.inputs[node] if run.happens(signal)]
        if automaton.nodes[node].need > 1:
            arrivals = [arrival(automaton, known, signal, duration.__getitem__) for signal in came]
            came = [came[arrivals.index(max(arrivals))]]
        else:
            missing = [signal for signal in automaton.inputs[node] if not run.happens(signal)]
            for signal in missing:
                if signal.node not in run.triggered:
                    absent.append(signal.node)
                else:  # a runner with another outcome; one that hangs has no event to name
                    outcome = outcomes[automaton.runner_number(signal.node)]
                    events += (
                        Signal(signal.node, event)
                        for event in automaton.emitted(signal.node, outcome)
                        if event is not Event.STARTED
                    )
        for signal in came:
            if automaton.nodes[signal.node].kind is NodeKind.RUNNER:
                events.append(signal)
            if signal.node not in seen:
                seen.add(signal.node)
                pending.append(signal.node)
    return events, absent, known[end]
