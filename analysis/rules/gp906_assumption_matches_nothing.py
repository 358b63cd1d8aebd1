"""GP906: an assumption that speaks of no runner of the plan."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import go, plan
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP906",
    name="assumption-matches-nothing",
    severity=Severity.INFO,
    summary="An assumption matches no runner of this plan.",
    why=(
        "It restricts nothing here. That is fine when many plans are checked with one assumption, "
        "and a misspelt interface when it is meant for this plan."
    ),
    fix="check the spelling of the interface and its parameters",
    bad=plan(go(1.0, 1.0), go(2.0, 2.0)),
    good=plan(go(1.0, 1.0)).replace("WaypointRunner", "SpeechRunner"),
    options=("--assume", "never fails: SpeechRunner"),
)
