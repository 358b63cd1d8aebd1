"""GP603: an action that is done again (reported for ``--task``)."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import control, go, plan
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
    bad=plan(
        go(4.0, 1.0),
        go(6.5, 3.0),
        control("recovery", go(6.5, 5.0)),
        go(0.5, 3.0),
        go(4.0, 1.0),
    ),
    good=plan(
        go(4.0, 1.0),
        go(6.5, 3.0),
        control("recovery", go(6.5, 5.0)),
        go(0.5, 3.0),
    ),
    options=("--task", "docs/examples/rounds.yaml"),
)
