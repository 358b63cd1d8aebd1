"""GP605: an alternative that is not tried (reported for ``--task``)."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import ROUNDS, ROUNDS_TASK, go, plan
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP605",
    name="skipped-alternative",
    severity=Severity.ERROR,
    summary=("A step fails, and the plan does not try the alternative of the task."),
    why=(
        "The task says what to do when the step fails. The plan goes on without it, or "
        "gives up though there was something left to try."
    ),
    fix="guard the runner of the step with a recovery that holds the alternative",
    bad=plan(
        go(4.0, 1.0),
        go(6.5, 3.0),
        go(0.5, 3.0),
    ),
    good=plan(*ROUNDS),
    options=ROUNDS_TASK,
)
