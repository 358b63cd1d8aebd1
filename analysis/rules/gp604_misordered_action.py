"""GP604: an action that is done too early (reported for ``--task``)."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import ROUNDS, ROUNDS_TASK, control, go, plan
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP604",
    name="misordered-action",
    severity=Severity.ERROR,
    summary="The plan does a step too early, or two steps at once.",
    why=(
        "The task gives an order. In some run, or in some order of events beside each "
        "other, the plan does not keep it."
    ),
    fix="put the runners into the order of the task, one after the other",
    bad=plan(
        go(6.5, 3.0),
        control("recovery", go(6.5, 5.0)),
        go(4.0, 1.0),
        go(0.5, 3.0),
    ),
    good=plan(*ROUNDS),
    options=ROUNDS_TASK,
)
