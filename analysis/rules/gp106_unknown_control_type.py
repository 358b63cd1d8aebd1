"""GP106: a type of control that does not exist."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import control, go, plan, say
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP106",
    name="unknown-control-type",
    severity=Severity.ERROR,
    summary="The type of a control is none of the four that exist.",
    why=(
        "The type says how the children run: one after the other, as a recovery, or at the same "
        "time. With another word the plan has no meaning, so nothing more can be said about it."
    ),
    fix="use sequential, recovery, parallel_any or parallel_all, in small letters",
    bad=plan(control("parallel", go(2.0, -0.5), say("On my way."))),
    good=plan(control("parallel_all", go(2.0, -0.5), say("On my way."))),
)
