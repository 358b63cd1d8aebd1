"""GP303: a parallel_all that can wait for ever."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.decisions.joins import deadlock_claim
from gpsfsm.analysis.on_engine import Ending, ending
from gpsfsm.analysis.rules.base import Rule, control, go, look, plan, say
from gpsfsm.analysis.words import listed
from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.story import Sentence, Statement

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.causes import Waiting
    from gpsfsm.analysis.context import Context

_SEVERITIES = {
    "stuck": Severity.ERROR,
    "absorbed": Severity.INFO,
    "escalated": Severity.INFO,
}
_MESSAGES = {
    "stuck": "this parallel_all can wait for ever, and the plan is stuck then",
    "give_up": "if a unit of this parallel_all fails, it waits for ever and the plan gives up",
    "absorbed": (
        "if a unit of this parallel_all fails, it waits for ever, but the rest of the plan does "
        "not depend on it"
    ),
    "escalated": (
        "if a unit of this parallel_all fails, it waits for ever, and a recovery takes over"
    ),
}
_CLOSINGS = {
    "stuck": Statement.STUCK,
    "give_up": Statement.UNHANDLED,
    "absorbed": Statement.GOES_ON,
    "escalated": Statement.RECOVERED,
}
_HINTS = {
    "stuck": (
        "give the runner that may hang or not start a timeout, so that it fails instead, and a "
        "recovery"
    ),
    "give_up": (
        "give each of these units a recovery, put one after the parallel_all, or use "
        "parallel_any if one unit is enough"
    ),
    "absorbed": "nothing to do, if the unit beside it is meant to be enough",
    "escalated": "nothing to do, if the recovery is meant for that",
}


def find(context: Context) -> Iterator[Finding]:
    """One finding per waiting join; dangling failures inside are listed under it."""
    for waiting in context.waiting:
        yield _finding(context, waiting)


def _finding(context: Context, waiting: Waiting) -> Finding:
    effect = waiting.deadlock.effect
    element = context.plan.elements[context.automaton.blocks[waiting.deadlock.block].element]
    names = listed([context.place(context.element_of(unit)) for unit in waiting.guilty])
    total = len(context.units.children[waiting.unit])
    trouble = "may not succeed" if effect == "stuck" else "can fail"
    related = [
        context.related(context.runner(number), "nothing handles its failure")
        for number in waiting.dangling
    ]
    related += [
        context.related(context.element_of(unit), "waits for ever too, because of it")
        for unit in waiting.outer
    ]
    scenario = context.scenario(
        RULE.code,
        deadlock_claim(context.automaton, waiting.deadlock),
        Sentence(Statement.WAITS_FOR_EVER, arguments=(context.place(element),)),
        _CLOSINGS[effect],
    )
    end = (
        ending(context, scenario) if effect == "give_up" else Ending(_SEVERITIES[effect], scenario)
    )
    return RULE.finding(
        f"{_MESSAGES[effect]}: {len(waiting.guilty)} of its {total} units {trouble} "
        f"({names}){end.note}",
        context.plan.location(element),
        severity=end.severity,
        hint=_HINTS[effect],
        related=tuple(related),
        scenario=end.scenario,
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
        "error if the plan is then stuck, warning if it gives up (with --engine an "
        "error), info if a recovery takes over or "
        "the rest of the plan does not depend on it"
    ),
    find=find,
)
