"""GP705: runners of a parallel control that the engine silently skips."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.on_engine import Loss
from gpsfsm.analysis.rules.base import Rule, control, go, look, plan, say
from gpsfsm.analysis.words import listed
from gpsfsm.model.finding import Finding, Severity

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.on_engine import OnEngine


def find(engine: OnEngine) -> Iterator[Finding]:
    """One finding per runner whose missing STARTED skips others."""
    context = engine.context
    for cause, numbers in engine.lost.items():
        if cause.loss is not Loss.NO_STARTED:
            continue
        first = context.runner(context.automaton.runner_number(cause.node))
        trigger = engine.trigger(context.automaton.runner_number(cause.node))
        assert trigger is not None
        before = context.runner(context.automaton.runner_number(trigger.node))
        names = listed([context.place(context.runner(number)) for number in numbers])
        yield RULE.finding(
            f"{engine.name} never runs {names}: it starts a unit of a parallel control with the "
            f"STARTED of the runner before it, {context.place(before)}, which emits none",
            context.plan.location(first.parent),
            related=tuple(
                context.related(context.runner(number), "never runs") for number in numbers
            ),
        )


RULE = Rule(
    code="GP705",
    name="skipped-on-engine",
    severity=Severity.ERROR,
    summary="The engine silently skips runners of a parallel control.",
    why=(
        "fabric-v2 starts each unit of a parallel control with the STARTED of the runner before "
        "it, but its runners no longer emit STARTED; only those that wait for a topic do. A "
        "parallel_any then goes on without its units, a parallel_all waits for ever."
    ),
    fix="run the units one after the other on this engine; gpsfsm port says what that changes",
    bad=plan(go(1.0, 2.0), control("parallel_any", look("Is the door open?"), say("Hello."))),
    good=plan(go(1.0, 2.0), look("Is the door open?"), say("Hello.")),
    options=("--engine", "fabric-v2"),
    find_on_engine=find,
)
