"""GP302: an event for which the plan does not say what happens next."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.decisions.dangling import DanglingEvent, dangling_claim
from gpsfsm.analysis.on_engine import Ending, ending
from gpsfsm.analysis.rules.base import Rule, control, go, plan, say
from gpsfsm.compile import UnitKind
from gpsfsm.model.event import Event
from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.story import Statement, Terms

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.analysis.context import Context


def find(context: Context) -> Iterator[Finding]:
    """One finding per cause.

    A failure that is listed under a waiting join is not told again. The units of a parallel_any
    must all fail before anything happens: that is one cause, told at the parallel_any.
    """
    listed = {number for block in context.waiting for number in block.dangling}
    groups: dict[tuple[int, str], list[DanglingEvent]] = {}
    for dangler in context.answers["dangling"] or ():
        if dangler.runner in listed:
            continue
        if dangler.effect == "dont_care" and not context.possible_event(dangler):
            continue  # what leads nowhere and never happens either is no finding
        block = _parallel_any(context, dangler.runner)
        if block < 0:
            yield _finding(context, dangler)
        else:
            groups.setdefault((block, dangler.effect), []).append(dangler)
    for (block, _), events in groups.items():
        yield _block_finding(context, block, events)


def _parallel_any(context: Context, number: int) -> int:
    """The outermost parallel_any of several units around a runner, or -1."""
    units = context.units
    block = -1
    for unit in context.around(context.unit_of_runner[number]):
        if units.kinds[unit] is UnitKind.ANY and len(units.children[unit]) > 1:
            block = unit
    return block


def _finding(context: Context, event: DanglingEvent) -> Finding:
    runner, terms = context.runner(event.runner), context.terms
    place, gives_up = context.place(runner), f"the {terms.whole} {terms.gives_up}"
    if event.effect == "dont_care":
        what = "success" if event.event is Event.SUCCEEDED else "failure"
        message = (
            f"the {what} of {place} leads nowhere, but it alone never decides whether {gives_up}"
        )
        closing, hint = Statement.NOT_ALONE, _no_repair(terms)
    elif event.event is Event.SUCCEEDED:  # below an Inverter
        message = f"if {place} succeeds, nothing handles that: {gives_up}"
        closing = Statement.UNHANDLED_SUCCESS
        hint = (
            "put the Inverter into a <Fallback> with another way to do it, or accept that "
            f"{terms.after_giving_up}"
        )
    elif _in_recovery(context, event.runner):
        message = f"{place} is {terms.last_attempt}: if it fails too, {gives_up}"
        closing = Statement.NO_ATTEMPT_LEFT
        hint = f"{terms.add_attempt} if there is one worth trying"
    else:
        message = f"nothing handles a failure of {place}: {gives_up}"
        closing = Statement.UNHANDLED_FAILURE
        hint = f"{terms.guard_it}, or accept that {terms.after_giving_up}"
    scenario = context.scenario(RULE.code, dangling_claim(context.automaton, event), closing)
    location = context.plan.location(runner)
    if event.effect == "dont_care":
        return RULE.finding(message, location, severity=Severity.INFO, hint=hint, scenario=scenario)
    end = ending(context, scenario)
    return RULE.finding(
        message + end.note, location, severity=end.severity, hint=hint, scenario=end.scenario
    )


def _block_finding(context: Context, block: int, events: Sequence[DanglingEvent]) -> Finding:
    terms = context.terms
    gives_up = events[0].effect == "give_up"
    claim = dangling_claim(context.automaton, events[0])
    if gives_up:
        units = len(context.units.children[block])
        end = ending(context, context.scenario(RULE.code, claim, Statement.ALL_UNITS_FAILED))
        message = (
            f"nothing handles it if all {units} units of this {terms.parallel_any} fail: "
            f"the {terms.whole} {terms.gives_up}{end.note}"
        )
        hint = f"{terms.guard_parallel_any}, or accept that {terms.after_giving_up}"
    else:
        end = Ending(Severity.INFO, context.scenario(RULE.code, claim, Statement.NOT_ALONE))
        message = (
            f"failures in this {terms.parallel_any} lead nowhere, but none of them alone ever "
            f"decides whether the {terms.whole} {terms.gives_up}"
        )
        hint = _no_repair(terms)
    return RULE.finding(
        message,
        context.plan.location(context.units.elements[block]),
        severity=end.severity,
        hint=hint,
        related=tuple(
            context.related(context.runner(event.runner), "nothing handles its failure")
            for event in events
        ),
        scenario=end.scenario,
    )


def _no_repair(terms: Terms) -> str:
    return f"{terms.guard_alone} would change nothing; see what else fails in the scenario"


def _in_recovery(context: Context, number: int) -> bool:
    """True if the runner is the last step of a recovery."""
    unit = context.unit_of_runner[number]
    parent = context.units.parents[unit]
    return context.units.kinds[parent] is UnitKind.GUARD and context.units.positions[unit] > 0


RULE = Rule(
    code="GP302",
    name="dangling-failure",
    severity=Severity.WARNING,
    summary="A runner can fail and the plan does not say what happens then.",
    why=(
        "The event leads nowhere: the machine is only partially specified there. In the paper's "
        "semantics the plan gives up and a new one is generated; the original engines wait for "
        "ever. A recovery costs one line."
    ),
    fix="add a recovery right after the runner",
    bad=plan(go(2.0, 0.5), say("I am here.")),
    good=plan(go(2.0, 0.5), control("recovery", say("I cannot get there."))),
    options=("--assume", "SpeechRunner never fails"),
    severities=(
        "warning if the failure makes the plan give up (with --engine an error, since these "
        "engines cannot give up), info if the plan never gives up because of it (a "
        "unit beside it in a parallel_any cannot fail, for instance)"
    ),
    find=find,
)
