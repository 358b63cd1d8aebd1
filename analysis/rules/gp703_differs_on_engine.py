"""GP703: the plan does something else on the engine. Decided by comparing both (gpsfsm.tasks)."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import control, go, look, plan, say
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP703",
    name="differs-on-engine",
    severity=Severity.ERROR,
    summary="The plan does something else on this engine than the paper says.",
    why=(
        "The published engines do not connect controls as the paper draws them, and they have no "
        "give-up. What was checked, simulated and agreed on is then not what the robot does. The "
        "scenario is the first in which the difference can be seen; that a plan hangs where it "
        "should give up is no difference of its own, since the engine knows no other way."
    ),
    fix=(
        "on these engines, let runners follow each other, each with at most one recovery of "
        "runners right behind it; gpsfsm port rewrites the plan so"
    ),
    bad=plan(go(1.0, 2.0), control("parallel_all", look("Is the door open?"), say("Hello."))),
    good=plan(go(1.0, 2.0), control("recovery", go(0.0, 2.0)), say("Hello.")),
    options=("--engine", "fabric-v2"),
)
