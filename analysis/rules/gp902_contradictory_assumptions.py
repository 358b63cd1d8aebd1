"""GP902: assumptions that admit no scenario."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import go, plan
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP902",
    name="contradictory-assumptions",
    severity=Severity.ERROR,
    summary="The assumptions and options admit no scenario.",
    why=(
        "Of no scenario everything can be said, that the plan is safe as well as that it is "
        "not. So nothing is said."
    ),
    fix="drop or correct one of the assumptions",
    bad=plan(go(1.0, 1.0), go(1.0, 1.0)),
    good=plan(go(1.0, 1.0), go(2.0, 2.0)),
    options=("--consistent", "--assume", "line 2 succeeds and line 3 fails"),
)
