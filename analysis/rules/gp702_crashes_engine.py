"""GP702: the engine dies while it reads the plan. Reported where it is read for the engine."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import control, go, plan
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP702",
    name="crashes-engine",
    severity=Severity.ERROR,
    summary="The engine dies while it reads the plan.",
    why=(
        "Some texts lead the engine's server to read what is not there. The whole process ends, "
        "and with it all plans that wait in its queue."
    ),
    fix="leave out what the engine cannot read",
    bad=plan(go(1.0, 2.0), control("sequential", "<!-- nothing to do -->")),
    good=plan(go(1.0, 2.0)),
    options=("--engine", "fabric-v2"),
)
