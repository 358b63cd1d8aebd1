"""GP105: an element that no plan has."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import control, go, plan, say
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP105",
    name="unknown-element",
    severity=Severity.ERROR,
    summary="An element is neither `<Plan>`, `<Control>` nor `<Runner>`.",
    why=(
        "A plan knows three elements only, written exactly so. Language models often mix in words "
        "of behaviour trees, such as `<Sequence>`. No executor knows what they mean, so nothing "
        "more can be said about the plan."
    ),
    fix="write <Control> and <Runner> elements instead; names are case-sensitive",
    bad=plan("<Sequence>", "    " + go(2.0, -0.5), "    " + say("Hall checked."), "</Sequence>"),
    good=plan(control("sequential", go(2.0, -0.5), say("Hall checked."))),
)
