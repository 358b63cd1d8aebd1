"""GP901: an input that cannot be read."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import go, plan
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP901",
    name="unreadable-input",
    severity=Severity.ERROR,
    summary="The input cannot be read.",
    why="What could not be read was not checked, and what was not checked must not be dispatched.",
    fix="give the path of a readable plan, of a folder with plans, or - for standard input",
    bad="",
    good=plan(go(1.0, 1.0)),
)
