"""GP805: a node has too many or too few children."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.trees import tree
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP805",
    name="wrong-child-count",
    severity=Severity.ERROR,
    summary="A node has too many or too few children.",
    why=(
        "A tree and a decorator have exactly one child, a control node at least one, an "
        "action or a condition none. BehaviorTree.CPP refuses anything else when the file is "
        "loaded."
    ),
    fix=("put several children into one Sequence; remove nodes without children"),
    bad=tree("<Inverter><DoorOpen/><DoorLocked/></Inverter>"),
    good=tree("<Inverter><Fallback><DoorOpen/><DoorLocked/></Fallback></Inverter>"),
)
