"""GP907: an assumption that cannot be applied to the plan."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import go, plan
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP907",
    name="unusable-assumption",
    severity=Severity.ERROR,
    summary="An assumption names a line or an element that the plan does not have.",
    why="An assumption about the wrong place would change the verdict without anybody noticing.",
    fix="name a line that holds a runner, or select runners by interface and parameters",
    bad=plan(go(1.0, 1.0)),
    good=plan(go(1.0, 1.0), go(2.0, 2.0)),
    options=("--assume", "line 3 never fails"),
)
