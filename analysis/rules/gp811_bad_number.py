"""GP811: a number of rounds, successes or failures is missing, no number, or impossible."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.trees import tree
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP811",
    name="bad-number",
    severity=Severity.ERROR,
    summary="A number of rounds, successes or failures is missing, no number, or impossible.",
    why=("BehaviorTree.CPP stops with an exception when it ticks such a node."),
    fix=("write a whole number that fits"),
    bad=tree('<Repeat num_cycles="twice"><Sweep/></Repeat>'),
    good=tree('<Repeat num_cycles="2"><Sweep/></Repeat>'),
)
