"""GP806: two trees, or two descriptions of nodes, have the same ID."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.trees import tree
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP806",
    name="duplicate-tree",
    severity=Severity.ERROR,
    summary="Two trees, or two descriptions of nodes, have the same ID.",
    why=("Only one of them can be meant where the ID is used. The first is taken for the check."),
    fix=("give one of the two another ID, or remove it"),
    bad=tree('<SubTree ID="Dock"/>', Dock="<DriveToDock/>").replace(
        "</root>", '<BehaviorTree ID="Dock"><Beep/></BehaviorTree></root>'
    ),
    good=tree('<SubTree ID="Dock"/>', Dock="<DriveToDock/>"),
)
