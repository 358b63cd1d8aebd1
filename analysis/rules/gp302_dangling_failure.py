"""GP302: an event for which the plan does not say what happens next."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.decisions.dangling import DanglingEvent, dangling_claim
from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import control, go, plan, say
from gpsfsm.compile import UnitKind
from gpsfsm.model.event import Event
from gpsfsm.model.finding import Finding, Severity

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.analysis.context import Context

__all__ = ["RULE"]


_NEVER_ALONE = "none of them alone ever decides whether the plan gives up"
_NOT_ALONE = "how the plan ends does not depend on this failure alone"
_NO_REPAIR = "a recovery for it alone would change nothing; see what else fails in the scenario"


def find(context: Context) -> Iterator[Finding]:
    """One finding per cause.

    A failure that is listed under a waiting join is not told again. The units of a parallel_any
    must all fail before anything happens: that is one cause, told at the parallel_any.
    """
    listed = {number for block in context.waiting for number in block.dangling}
    groups: dict[tuple[int, str], list[DanglingEvent]] = {}
    for found in context.answers["dangling"] or ():
        if found.runner in listed:
            continue
        if found.effect == "dont_care" and not context.possible_event(found):
            continue  # what leads nowhere and never happens either is no finding
        block = _parallel_any(context, found.runner)
        if block < 0:
            yield _finding(context, found)
        else:
            groups.setdefault((block, found.effect), []).append(found)
    for (block, _), events in groups.items():
        yield _block_finding(context, block, events)


def _parallel_any(context: Context, number: int) -> int:
    """The outermost parallel_any of several units around a runner, or -1."""
    units = context.units
    found = -1
    for unit in context.around(context.unit_of_runner[number]):
        if units.kinds[unit] is UnitKind.ANY and len(units.children[unit]) > 1:
            found = unit
    return found


def _finding(context: Context, found: DanglingEvent) -> Finding:
    runner = context.runner(found.runner)
    place = context.place(runner)
    what = "success" if found.event is Event.SUCCEEDED else "failure"
    if found.effect == "dont_care":
        message = (
            f"the {what} of {place} leads nowhere, but it alone never decides "
            "whether the plan gives up"
        )
        closing = _NOT_ALONE
        hint = _NO_REPAIR
    elif found.event is Event.SUCCEEDED:  # below an Inverter
        message = f"if {place} succeeds, nothing handles that: the plan gives up"
        closing = "nothing handles this success: the plan gives up"
        hint = (
            "put the Inverter into a <Fallback> with another way to do it, or accept that the tree "
            "fails then"
        )
    elif _in_recovery(context, found.runner):
        message = f"{place} is the last step of its recovery: if it fails too, the plan gives up"
        closing = "no further recovery is left: the plan gives up"
        hint = "add another step to the recovery if there is one worth trying"
    else:
        message = f"nothing handles a failure of {place}: the plan gives up"
        closing = "nothing handles this failure: the plan gives up"
        hint = (
            'add a <Control type="recovery"> right after it, or accept that a new plan has to be '
            "generated then"
        )
    return RULE.finding(
        message,
        context.plan.location(runner),
        severity=Severity.INFO if found.effect == "dont_care" else Severity.WARNING,
        hint=hint,
        scenario=context.scenario(RULE.code, dangling_claim(context.automaton, found), (closing,)),
    )


def _block_finding(context: Context, block: int, events: Sequence[DanglingEvent]) -> Finding:
    units = len(context.units.children[block])
    gives_up = events[0].effect == "give_up"
    if gives_up:
        message = (
            f"nothing handles it if all {units} units of this parallel_any fail: the plan gives up"
        )
        closing = "all units have failed and nothing handles that: the plan gives up"
        hint = (
            "add a recovery right after the parallel_any, or accept that a new plan has to be "
            "generated then"
        )
    else:
        message = f"failures in this parallel_any lead nowhere, but {_NEVER_ALONE}"
        closing = _NOT_ALONE
        hint = _NO_REPAIR
    return RULE.finding(
        message,
        context.plan.location(context.units.elements[block]),
        severity=Severity.WARNING if gives_up else Severity.INFO,
        hint=hint,
        related=tuple(
            context.related(context.runner(event.runner), "nothing handles its failure")
            for event in events
        ),
        scenario=context.scenario(
            RULE.code, dangling_claim(context.automaton, events[0]), (closing,)
        ),
    )


def _in_recovery(context: Context, number: int) -> bool:
    """Whether the runner is the last step of a recovery."""
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
