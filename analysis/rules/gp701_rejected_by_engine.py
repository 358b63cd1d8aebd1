"""GP701: the engine refuses the plan. Reported where the plan is read for the engine."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import go, plan
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP701",
    name="rejected-by-engine",
    severity=Severity.ERROR,
    summary="The engine does not accept the text of the plan.",
    why=(
        "The engines read plans with a parser and a check of their own. What they refuse is never "
        "run: the plan gets no identifier, or it stands as failed in the list. Behind 'it says' "
        "stands the message that the engine itself gives."
    ),
    fix="write the plan so that the engine takes it",
    bad=plan(go(1.0, 2.0)) + "That is all.\n",
    good=plan(go(1.0, 2.0)),
    options=("--engine", "fabric-v2"),
)
