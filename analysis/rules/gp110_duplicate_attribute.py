"""GP110: the same attribute twice."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import go, plan
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP110",
    name="duplicate-attribute",
    severity=Severity.ERROR,
    summary="An element has the same attribute twice.",
    why=(
        "XML forbids it, and an executor that reads the plan nevertheless takes one of the values: "
        'which one, nobody knows. A robot that is sent to x="2.0" x="20.0" may go to either.'
    ),
    fix="keep one of them. The first one is used for the rest of the check",
    bad=plan(go(2.0, -0.5).replace('x="2.0"', 'x="2.0" x="20.0"')),
    good=plan(go(2.0, -0.5)),
)
