"""GP707: a join that never fires on the engine."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.on_engine import Loss
from gpsfsm.analysis.rules.base import Rule, control, go, look, plan, say
from gpsfsm.analysis.words import listed
from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.finding import Finding, Severity

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.on_engine import OnEngine


def find(engine: OnEngine) -> Iterator[Finding]:
    """One finding per join that never fires although an input of it can come.

    A join at which two inputs abort the engine is told by GP704.
    """
    context, automaton = engine.context, engine.context.automaton
    solver = context.deciders.solver
    # A join that needs one input fires with the first that comes.
    joins = [node.index for node in automaton.nodes if node.kind is NodeKind.JOIN and node.need > 1]
    encoding = solver.encoding
    fires = solver.decide([encoding.triggered(join) for join in joins])
    for join, fired in zip(joins, fires, strict=True):
        inputs = automaton.inputs[join]
        if fired or not inputs:
            continue
        came = solver.decide([encoding.happens(signal) for signal in inputs])
        deadly = join in automaton.traits.breaking and sum(came) > 1
        if any(came) and not deadly:
            yield _finding(engine, join, sum(came))


def _finding(engine: OnEngine, join: int, inputs: int) -> Finding:
    context = engine.context
    node = context.automaton.nodes[join]
    control = context.plan.elements[node.origin]
    lost = [
        number
        for cause, numbers in engine.lost.items()
        if cause.loss is Loss.JOIN_WAITS and cause.node == join
        for number in numbers
    ]
    behind = ""
    if lost:
        names = listed([context.place(context.runner(number)) for number in lost])
        behind = f"; it never reaches {names}"
    which = "only one can come" if inputs == 1 else f"only {inputs} can come"
    return RULE.finding(
        f"on {engine.name} the join of {context.place(control)} waits for {node.need} successes, "
        f"of which {which}: the plan hangs there{behind}",
        context.plan.location(control),
        related=tuple(context.related(context.runner(number), "never runs") for number in lost),
    )


RULE = Rule(
    code="GP707",
    name="waits-on-engine",
    severity=Severity.ERROR,
    summary="A join of the engine waits for more successes than can come.",
    why=(
        "These engines count every success in the whole plan that leads nowhere yet as an input "
        "of the next join, also those from before the control, and wire them all to it. Nothing "
        "ends the wait: the plan stays running, and all plans behind it wait too."
    ),
    fix="run the units one after the other on this engine; gpsfsm port says what that changes",
    bad=plan(go(1.0, 2.0), control("parallel_all", look("Is the door open?"), say("Hello."))),
    good=plan(go(1.0, 2.0), look("Is the door open?"), say("Hello.")),
    options=("--engine", "fabric-v2"),
    find_on_engine=find,
)
