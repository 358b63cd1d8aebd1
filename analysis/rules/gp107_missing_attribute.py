"""GP107: an attribute that must be there."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import go, plan
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP107",
    name="missing-attribute",
    severity=Severity.ERROR,
    summary="A runner lacks its interface or provider, or a control its type.",
    why=(
        "A runner without an interface names no capability, and one without a provider names "
        "nobody who could do it; the executor cannot start either. A control without a type does "
        "not say how its children run. An attribute of blanks counts as missing."
    ),
    fix="add the attribute that the message names",
    bad=plan('<Runner interface="nav2_capabilities/WaypointRunner" x="2.0" y="-0.5"/>'),
    good=plan(go(2.0, -0.5)),
)
