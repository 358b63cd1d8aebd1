"""GP706: a part of the plan that the engine connects to nothing that ever happens."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.on_engine import Cause, Loss
from gpsfsm.analysis.rules.base import Rule, control, go, plan, say
from gpsfsm.analysis.words import listed
from gpsfsm.model.finding import Finding, Severity

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.on_engine import OnEngine

_CAUSES = (Loss.JOIN_EVENT, Loss.UNCONNECTED)


def find(engine: OnEngine) -> Iterator[Finding]:
    """One finding per cause; what waits for a join that never fires is told by GP707."""
    context = engine.context
    for cause, numbers in engine.lost.items():
        if cause.loss not in _CAUSES:
            continue
        first = context.runner(numbers[0])
        names = listed([context.place(context.runner(number)) for number in numbers])
        yield RULE.finding(
            f"{engine.name} never reaches {names}: {_reason(engine, cause)}",
            context.plan.location(first),
            related=tuple(
                context.related(context.runner(number), "never runs") for number in numbers[1:]
            ),
        )


def _reason(engine: OnEngine, cause: Cause) -> str:
    context = engine.context
    if cause.loss is Loss.UNCONNECTED:
        return "nothing that happens is connected to it"
    join = context.plan.elements[context.automaton.nodes[cause.node].origin]
    return (
        f"that waits for an event of the join of {context.place(join)} which a join never emits, "
        "because one control stands right behind another"
    )


RULE = Rule(
    code="GP706",
    name="cut-off-on-engine",
    severity=Severity.ERROR,
    summary="The engine never reaches a part of the plan that the paper reaches.",
    why=(
        "These engines connect what follows a control to its last runner or join. Right behind "
        "another control that is an event that joins never emit: everything from there on, and "
        "the completion of the plan, is out of reach."
    ),
    fix="put a runner between controls that follow each other, or merge them; gpsfsm port does it",
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
