"""GP704: a join gets a second input, at which the engine dies."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.claims import Claim
from gpsfsm.analysis.rules.base import Rule, control, go, plan, say
from gpsfsm.model.event import End
from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.story import Statement

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.on_engine import OnEngine


def find(engine: OnEngine) -> Iterator[Finding]:
    """One finding per join."""
    if engine.same:
        return
    context = engine.context
    joins = sorted(context.automaton.traits.breaking)
    solver = context.deciders.solver
    broken = solver.decide([solver.encoding.breaks(join) for join in joins])
    for join, aborts in zip(joins, broken, strict=True):
        if aborts:
            yield _finding(engine, join)


def _finding(engine: OnEngine, join: int) -> Finding:
    context = engine.context
    control = context.plan.elements[context.automaton.nodes[join].origin]
    early = join in context.automaton.deadly
    if join in context.automaton.traits.looping:
        what = (
            f"{engine.name} dies when {context.place(control)} is done: its join is connected to "
            "itself, because another control follows right behind it"
        )
        closing = Statement.JOIN_LOOPS
    else:
        what = (
            f"{engine.name} dies when a second success arrives at the join of "
            f"{context.place(control)}"
        )
        what += "" if early else ", after the plan has completed"
        closing = Statement.SECOND_INPUT
    return RULE.finding(
        what,
        context.plan.location(control),
        scenario=context.scenario(
            RULE.code, Claim(breaks=join, ends=End.ABORT if early else None), closing
        ),
    )


RULE = Rule(
    code="GP704",
    name="aborts-engine",
    severity=Severity.ERROR,
    summary="The engine dies while it runs the plan.",
    why=(
        "A join of these engines starts a thread for each input and does not wait for the one "
        "before: the second input ends the process of the server. Robots keep their last command, "
        "and the queue of plans is lost."
    ),
    fix=(
        "put a runner between two controls that follow each other, and use recovery or "
        "sequential instead of parallel controls; gpsfsm port does it"
    ),
    bad=plan(
        go(1.0, 2.0),
        control("recovery", go(0.0, 2.0)),
        control("recovery", go(0.0, 0.0)),
        say("Hello."),
    ),
    good=plan(go(1.0, 2.0), control("recovery", go(0.0, 2.0), go(0.0, 0.0)), say("Hello.")),
    options=("--engine", "fabric-v2"),
    find_on_engine=find,
)
