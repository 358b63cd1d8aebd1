"""GP607: a plan that ends in the middle of its task (reported for ``--task``)."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import control, go, plan, say
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
            control(
                "sequential",
                go(4.0, 1.0),
                go(6.5, 3.0),
                control("recovery", go(6.5, 5.0)),
                go(0.5, 3.0),
            ),
            say("On my way."),
        ),
    ),
    good=plan(
        go(4.0, 1.0),
        go(6.5, 3.0),
        control("recovery", go(6.5, 5.0)),
        go(0.5, 3.0),
    ),
    options=("--task", "docs/examples/rounds.yaml"),
)
