"""GP602: an action that the task does not ask for (reported for ``--task``)."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import ROUNDS, ROUNDS_TASK, go, plan
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP602",
    name="extra-action",
    severity=Severity.ERROR,
    summary="The plan does something that the task does not ask for.",
    why=(
        "The robot goes where nobody sent it. What the task is silent about is refused, "
        "unless it says 'others: allowed' or names the action below 'allow'."
    ),
    fix="remove the runner, or allow it in the task",
    bad=plan(*ROUNDS, go(0.0, 0.0)),
    good=plan(*ROUNDS),
    options=ROUNDS_TASK,
)
