"""GP112: an attribute that has no effect."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import control, go, plan
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP112",
    name="foreign-attribute",
    severity=Severity.WARNING,
    summary="An attribute has no effect where it stands.",
    why=(
        "Plans take a name, controls a type and a name; parameters are for runners. What is "
        "written elsewhere is silently ignored, although the author counted on it."
    ),
    fix="move the attribute to the runner that needs it, or remove it",
    bad=plan(control("sequential", go(2.0, -0.5)).replace(">", ' timeout="30">', 1)),
    good=plan(control("sequential", go(2.0, -0.5).replace("/>", ' timeout="30"/>'))),
)
