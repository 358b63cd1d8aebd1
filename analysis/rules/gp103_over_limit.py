"""GP103: a text beyond the limits."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import control, go, plan
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP103",
    name="over-limit",
    severity=Severity.ERROR,
    summary="The text is larger or more deeply nested than gpsfsm reads.",
    why=(
        "Limits keep broken or hostile input from taking all time and memory. They admit a hundred "
        "thousand elements; a text beyond them is rarely a plan. gpsfsm stops reading there and "
        "decides nothing about it."
    ),
    fix=(
        "make the plan smaller, or raise the limit that the message names if the plan is meant to "
        "be like this"
    ),
    bad=plan(control("sequential", go(2.0, -0.5), control("recovery", go(0.0, 0.0)))),
    good=plan(go(2.0, -0.5), control("recovery", go(0.0, 0.0))),
    options=("--max-depth", "3"),
)
