"""GP603: an action that is done again (reported for ``--task``)."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import ROUNDS, ROUNDS_TASK, go, plan
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP603",
    name="repeated-action",
    severity=Severity.ERROR,
    summary="The plan does again what it has done already.",
    why=(
        "What was asked for once happens twice in some run: an alternative and its step, "
        "or a step copied by mistake."
    ),
    fix="remove one of the runners, or add a step to the task",
    bad=plan(*ROUNDS, go(4.0, 1.0)),
    good=plan(*ROUNDS),
    options=ROUNDS_TASK,
)
