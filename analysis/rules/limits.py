"""Limits on a whole plan: the findings, and the claims that a run takes more (GP502, GP503)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.claims import Claim
from gpsfsm.analysis.counterexamples import canonical_scenario
from gpsfsm.analysis.decisions.energy import over_limit
from gpsfsm.analysis.decisions.makespan import overdue
from gpsfsm.analysis.encode import conjunction
from gpsfsm.analysis.solver import InconclusiveError
from gpsfsm.analysis.timing.amounts import UNBOUNDED
from gpsfsm.analysis.timing.clocks import RealSolver, arrival, times
from gpsfsm.analysis.words import listed
from gpsfsm.late import dataclass
from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import Event, Outcome

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from gpsfsm.analysis.context import Context
    from gpsfsm.analysis.evaluate import Evaluator
    from gpsfsm.analysis.rules.base import Rule
    from gpsfsm.analysis.solver import Solver
    from gpsfsm.analysis.timing.amounts import Amounts, Number
    from gpsfsm.model.finding import Finding, Scenario


@dataclass(frozen=True, slots=True)
class Limit:
    """The most that a run may take, and the words for it.

    ``name`` is what users call it, ``beyond`` what takes more, such as ``longer than the
    deadline``; ``bound`` is what a capability file may declare. ``hint`` says what to declare where
    nothing bounds the plan. ``allowance`` is what comes on top of the greatest amount, and
    ``reason`` what it is for.
    """

    most: float
    unit: str
    name: str
    beyond: str
    bound: str
    hint: str
    allowance: float = 0.0
    reason: str = ""

    def said(self, amount: float) -> str:
        """An amount with its unit."""
        return f"{amount:.6g} {self.unit}"

    @property
    def unguaranteed(self) -> str:
        """The beginning of a message where nothing bounds what the plan takes."""
        return f"nothing guarantees the {self.name} of {self.said(self.most)}"


def excess(
    rule: Rule,
    context: Context,
    limit: Limit,
    amounts: Amounts | None,
    span: tuple[float, float | None] | None,
    *,
    unknown: Callable[[], str],
    scenario: Callable[[Amounts], Scenario | None],
) -> Iterator[Finding]:
    """At most one finding: that a run can take more than the limit.

    ``span`` is what the plan takes at least and at most. Where that is not known, ``unknown``
    says why, "" if there is nothing to say.
    """
    message = unknown() if span is None else _message(context, limit, amounts, span)
    if message:
        unbounded = span is None or span[1] is None
        yield rule.finding(
            message,
            context.plan.location(0),
            hint=limit.hint if unbounded else "",
            scenario=None if span is None or amounts is None else scenario(amounts),
        )


def _message(
    context: Context, limit: Limit, amounts: Amounts | None, span: tuple[float, float | None]
) -> str:
    """The message, "" if nothing is wrong."""
    least, most = span
    this = f"this {context.terms.whole}"
    at_least, over = limit.said(least), f"{limit.beyond} of {limit.said(limit.most)}"
    if least > limit.most:
        range_ = f"at least {at_least}" if most is None else f"{at_least} to {limit.said(most)}"
        return f"every run of {this} takes {over}: {range_}"
    if most is None:
        return (
            f"{limit.unguaranteed}: {this} takes at least {at_least}, and "
            f"{endless(context, limit, amounts)}"
        )
    if most > limit.most:
        return f"{this} can take {over}: {at_least} to {limit.said(most)}"
    if most > limit.most - limit.allowance:
        return (
            f"{this} can take {over}: {at_least} to {limit.said(most)} as declared, plus "
            f"{limit.said(limit.allowance)} {limit.reason}"
        )
    return ""


def endless(context: Context, limit: Limit, amounts: Amounts | None) -> str:
    """The runners that may take any amount, in words."""
    unit_of = context.unit_of_runner
    names = [
        context.place(runner)
        for number, runner in enumerate(context.plan.runners)
        if (amounts is None or amounts.ranges[number][1] == UNBOUNDED)
        and context.reached[unit_of[number]]
    ]
    return f"no capability file declares a {limit.bound} for {listed(names)}"


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
    except InconclusiveError:
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
    instants = times(automaton, run, duration.__getitem__)
    end = automaton.complete if automaton.complete in instants else automaton.give_up
    events: list[Signal] = []
    absent: list[int] = []
    seen = {end}
    pending = [end]
    while pending:
        node = pending.pop()
        came = [signal for signal in automaton.inputs[node] if run.happens(signal)]
        if automaton.nodes[node].need > 1:
            arrivals = [
                arrival(automaton, instants, signal, duration.__getitem__) for signal in came
            ]
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
    return events, absent, instants[end]
