"""GP814: an element stands where BehaviorTree.CPP does not read it."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.trees import tree
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP814",
    name="ignored-element",
    severity=Severity.WARNING,
    summary="An element stands where BehaviorTree.CPP does not read it.",
    why=(
        "It has no effect, though whoever wrote it meant something: a node outside of a "
        "tree, for instance, never runs."
    ),
    fix=("move it to where it belongs, or remove it"),
    bad=tree("<DriveHome/>").replace("</root>", "<Beep/></root>"),
    good=tree("<Sequence><DriveHome/><Beep/></Sequence>"),
)
