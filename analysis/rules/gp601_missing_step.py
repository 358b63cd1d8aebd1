"""GP601: a step that no runner of the plan does (reported for ``--task``)."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import control, go, plan
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP601",
    name="missing-step",
    severity=Severity.ERROR,
    summary="A step of the task is missing: no runner of the plan does it.",
    why="The plan cannot do what it was asked to do, whatever happens.",
    fix="add a runner for the step, at its place in the order",
    bad=plan(
        go(4.0, 1.0),
        go(6.5, 3.0),
        control("recovery", go(6.5, 5.0)),
    ),
    good=plan(
        go(4.0, 1.0),
        go(6.5, 3.0),
        control("recovery", go(6.5, 5.0)),
        go(0.5, 3.0),
    ),
    options=("--task", "docs/examples/rounds.yaml"),
)
