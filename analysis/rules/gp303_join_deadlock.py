"""GP303: a parallel_all that can wait for ever."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.decisions.joins import deadlock_claim
from gpsfsm.analysis.on_engine import Ending, ending
from gpsfsm.analysis.rules.base import Rule, control, go, look, plan, say
from gpsfsm.analysis.rules.names import either
from gpsfsm.analysis.words import listed
from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.story import Sentence, Statement

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.analysis.causes import Waiting
    from gpsfsm.analysis.context import Context

_MOST_NAMES = 3
_SEVERITIES = {
    "stuck": Severity.ERROR,
    "absorbed": Severity.INFO,
    "escalated": Severity.INFO,
}
_THEN = {
    "stuck": "the plan is then stuck",
    "give_up": "nothing handles that: the plan gives up",
    "absorbed": "the rest of the plan does not depend on it",
    "escalated": "then a recovery takes over",
}
_CLOSINGS = {
    "stuck": Statement.STUCK,
    "give_up": Statement.UNHANDLED,
    "absorbed": Statement.GOES_ON,
    "escalated": Statement.RECOVERED,
}
_HINTS = {
    "stuck": (
        "make the runner that may hang or not start fail after some time (gpsfsm run --timeout), "
        "and give it a recovery"
    ),
    "give_up": (
        "give each of these units a recovery, put one after the parallel_all, or use "
        "parallel_any if one unit is enough"
    ),
    "absorbed": "nothing to do if the unit beside it is meant to be enough",
    "escalated": "nothing to do if the recovery is meant for this",
}


def find(context: Context) -> Iterator[Finding]:
    """One finding per waiting join; dangling failures inside are listed under it."""
    for waiting in context.waiting:
        yield _finding(context, waiting)


def _finding(context: Context, waiting: Waiting) -> Finding:
    effect = waiting.deadlock.effect
    element = context.plan.elements[context.automaton.blocks[waiting.deadlock.block].element]
    places = [context.place(context.element_of(unit)) for unit in waiting.guilty]
    total = len(context.units.children[waiting.unit])
    related = [
        context.related(context.runner(number), "nothing handles its failure")
        for number in waiting.dangling
    ]
    related += [
        context.related(context.element_of(unit), "can never succeed then either")
        for unit in waiting.outer
    ]
    scenario = context.scenario(
        RULE.code,
        deadlock_claim(context.automaton, waiting.deadlock),
        Sentence(
            Statement.WAITS_FOR_EVER if effect == "stuck" else Statement.CANNOT_SUCCEED,
            arguments=(context.place(element),),
            element=context.plan.path(element),
        ),
        _CLOSINGS[effect],
    )
    end = (
        ending(context, scenario) if effect == "give_up" else Ending(_SEVERITIES[effect], scenario)
    )
    return RULE.finding(
        f"{_message(effect, places, total)}{end.note}",
        context.plan.location(element),
        severity=end.severity,
        hint=_HINTS[effect],
        related=tuple(related),
        scenario=end.scenario,
    )


def _message(effect: str, places: Sequence[str], total: int) -> str:
    """The units of a join that can keep it from its success, and what happens then."""
    units = f"{len(places)} of its {total} units"
    if effect == "stuck":
        names = listed(places)
        what = f"waits for ever unless all its units succeed, and {units} may not ({names})"
    else:
        which = either(places) if len(places) <= _MOST_NAMES else f"one of {listed(places)}"
        what = f"can never succeed once {which} fails ({units} can fail)"
    return f"this parallel_all {what}; {_THEN[effect]}"


RULE = Rule(
    code="GP303",
    name="join-deadlock",
    severity=Severity.INFO,
    summary="A parallel_all can never succeed, because one of its units has failed.",
    why=(
        "A parallel_all continues only when all its units have succeeded. Once one has "
        "failed, its join waits in vain: the steps after it never run, and the work of the "
        "other units is wasted. If the plan then gives up, that is a failure like any other "
        "(GP302)."
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
        "error if the plan is then stuck, even if an engine deviates from the paper; else info"
    ),
    find=find,
)
