"""GP601: a step that no runner of the plan does (reported for ``--task``)."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import ROUNDS, ROUNDS_TASK, plan
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP601",
    name="missing-step",
    severity=Severity.ERROR,
    summary="A step of the task is missing: no runner of the plan does it.",
    why="The plan cannot do what it was asked to do, whatever happens.",
    fix="add a runner for the step, at its place in the order",
    bad=plan(*ROUNDS[:-1]),
    good=plan(*ROUNDS),
    options=ROUNDS_TASK,
)
