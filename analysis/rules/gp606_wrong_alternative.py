"""GP606: an alternative that is not the task's (reported for ``--task``)."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import ROUNDS, ROUNDS_TASK, control, go, plan
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP606",
    name="wrong-alternative",
    severity=Severity.ERROR,
    summary=("The plan tries another alternative than that of the task, or one that is not due."),
    why=(
        "When the step fails, something else is done than what was asked for; or the "
        "alternative is done though the step has not failed."
    ),
    fix="put the alternative of the task, and nothing else, into the recovery of the step",
    bad=plan(
        go(4.0, 1.0),
        go(6.5, 3.0),
        control("recovery", go(9.0, 9.0)),
        go(0.5, 3.0),
    ),
    good=plan(*ROUNDS),
    options=ROUNDS_TASK,
)
