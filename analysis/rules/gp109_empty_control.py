"""GP109: a control with nothing inside."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import control, go, plan
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP109",
    name="empty-control",
    severity=Severity.WARNING,
    summary="A control, or the whole plan, holds nothing.",
    why=(
        "An empty control does nothing and succeeds at once; an empty recovery recovers nothing. "
        "That is hardly what was meant: something was forgotten, or was left over."
    ),
    fix="put runners into it, or remove it",
    bad=plan(go(2.0, -0.5), control("recovery")),
    good=plan(go(2.0, -0.5), control("recovery", go(0.0, 0.0))),
)
