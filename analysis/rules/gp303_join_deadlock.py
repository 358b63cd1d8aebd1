"""GP303: a parallel_all that can wait for ever."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.decisions.joins import deadlock_claim
from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import control, go, look, plan, say
from gpsfsm.analysis.words import listed
from gpsfsm.model.finding import Finding, Severity

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.blocks import Waiting
    from gpsfsm.analysis.context import Context

__all__ = ["RULE"]

_SEVERITIES = {
    "stuck": Severity.ERROR,
    "give_up": Severity.WARNING,
    "absorbed": Severity.INFO,
    "escalated": Severity.INFO,
}
_EFFECTS = {
    "stuck": "the plan is stuck",
    "give_up": "the plan gives up",
    "absorbed": "the rest of the plan does not depend on it",
    "escalated": "a recovery takes over",
}


def find(context: Context) -> Iterator[Finding]:
    """One finding per waiting join; dangling failures inside are listed under it."""
    for waiting in context.waiting:
        yield _finding(context, waiting)


def _finding(context: Context, waiting: Waiting) -> Finding:
    effect = waiting.deadlock.effect
    block = context.automaton.blocks[waiting.deadlock.block]
    element = context.plan.elements[block.element]
    guilty = [context.element_of(unit) for unit in waiting.guilty]
    names = listed([context.place(unit) for unit in guilty])
    total = len(context.units.children[waiting.unit])
    verb = "succeed" if effect == "stuck" else "fail"
    trouble = (
        f"{len(guilty)} of its {total} units may not succeed"
        if verb == "succeed"
        else (f"{len(guilty)} of its {total} units can fail")
    )
    related = [
        context.related(context.runner(number), "nothing handles its failure")
        for number in waiting.dangling
    ]
    related += [
        context.related(context.element_of(unit), "waits for ever too, because of it")
        for unit in waiting.outer
    ]
    closing = (f"{context.place(element)} waits for ever: {_EFFECTS[effect]}",)
    return RULE.finding(
        f"this parallel_all can wait for ever, then {_EFFECTS[effect]}: {trouble} ({names})",
        context.plan.location(element),
        severity=_SEVERITIES[effect],
        hint=_hint(effect),
        related=tuple(related),
        scenario=context.scenario(
            RULE.code, deadlock_claim(context.automaton, waiting.deadlock), closing
        ),
    )


def _hint(effect: str) -> str:
    if effect == "escalated":
        return "nothing to do, if the recovery is meant for that"
    if effect == "absorbed":
        return "nothing to do, if the other unit of the parallel_any is meant to be enough"
    return (
        "give each of these units a recovery, put one after the parallel_all, or use parallel_any "
        "if one unit is enough"
    )


RULE = Rule(
    code="GP303",
    name="join-deadlock",
    severity=Severity.WARNING,
    summary="A parallel_all waits for a unit that never succeeds.",
    why=(
        "A parallel_all goes on only when all its units have succeeded. If one fails, its join "
        "waits for ever: nothing after it runs, and the units that did succeed did so for nothing."
    ),
    fix="give each unit that can fail a recovery",
    bad=plan(control("parallel_all", go(2.0, 0.5), look("Is the door open?")), say("Done.")),
    good=plan(
        control(
            "parallel_all",
            go(2.0, 0.5),
            control("recovery", say("The way is blocked.")),
            look("Is the door open?"),
            control("recovery", say("I cannot see.")),
        ),
        say("Done."),
    ),
    options=("--assume", "SpeechRunner never fails"),
    severities=(
        "error if the plan is then stuck, warning if it gives up, info if a recovery takes over "
        "or the rest of the plan does not depend on it"
    ),
    find=find,
)
