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
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context

__all__ = ["RULE"]


def find(context: Context) -> Iterator[Finding]:
    """One finding per dangling event, unless it is listed under a waiting join."""
    listed = {number for block in context.waiting for number in block.dangling}
    for found in context.answers["dangling"] or ():
        if found.runner in listed:
            continue
        claim = dangling_claim(context.automaton, found)
        if found.effect == "dont_care" and not context.possible(claim):
            continue  # it leads nowhere, but it never happens either
        yield _finding(context, found)


def _finding(context: Context, found: DanglingEvent) -> Finding:
    runner = context.runner(found.runner)
    what = "success" if found.event is Event.SUCCEEDED else "failure"
    gives_up = found.effect == "give_up"
    if gives_up:
        message = f"nothing handles a failure of {context.place(runner)}: the plan gives up"
        closing = ("nothing handles this failure: the plan gives up",)
        hint = (
            'add a <Control type="recovery"> right after it, or accept that a new plan has to be '
            "generated then"
        )
        if _in_recovery(context, found.runner):
            message = (
                f"{context.place(runner)} is the last resort of its recovery: "
                "if it fails too, the plan gives up"
            )
            closing = ("no further recovery is left: the plan gives up",)
            hint = "add another step to the recovery if there is one worth trying"
    else:
        message = (
            f"the {what} of {context.place(runner)} leads nowhere, "
            "but it never decides whether the plan gives up"
        )
        closing = ("the plan does not give up because of it",)
        hint = "nothing to do, if that is what you mean"
    return RULE.finding(
        message,
        context.plan.location(runner),
        severity=Severity.WARNING if gives_up else Severity.INFO,
        hint=hint,
        scenario=context.scenario(RULE.code, dangling_claim(context.automaton, found), closing),
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
        "warning if the failure makes the plan give up, info if it never decides about that "
        "(another unit of a parallel_any must fail first and cannot, for instance)"
    ),
    find=find,
)
