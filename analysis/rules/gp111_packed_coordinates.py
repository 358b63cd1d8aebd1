"""GP111: several numbers in one attribute."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import go, plan
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP111",
    name="packed-coordinates",
    severity=Severity.WARNING,
    summary="One attribute packs two or three numbers.",
    why=(
        'Fabric types each attribute on its own, and goal="2.0,-0.5" is a text, not a position. A '
        "navigation runner looks for x and y and does not find them."
    ),
    fix="write one attribute per number, with the names that the capability expects",
    bad=plan(go(2.0, -0.5).replace('x="2.0" y="-0.5"', 'goal="2.0,-0.5"')),
    good=plan(go(2.0, -0.5)),
)
