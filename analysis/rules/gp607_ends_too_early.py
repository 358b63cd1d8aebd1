"""GP607: a plan that ends in the middle of its task (reported for ``--task``)."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import ROUNDS, ROUNDS_TASK, control, plan, say
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP607",
    name="ends-too-early",
    severity=Severity.ERROR,
    summary=("The plan completes or gives up though a step is due that it could do."),
    why=(
        "The robot stops in the middle of its task, or reports a failure where everything is done."
    ),
    fix="let the plan go on to the next step",
    bad=plan(
        control(
            "parallel_any",
            control("sequential", *ROUNDS),
            say("On my way."),
        ),
    ),
    good=plan(*ROUNDS),
    options=ROUNDS_TASK,
)
