"""GP812: a node is neither built in nor in the TreeNodesModel."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.trees import MOVE_TO, tree
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP812",
    name="unknown-node",
    severity=Severity.WARNING,
    summary="A node is neither built in nor in the TreeNodesModel.",
    why=(
        "BehaviorTree.CPP refuses a node that nobody has registered. Where the file has a "
        "TreeNodesModel, it should describe all nodes that are not built in; without one, "
        "only what looks like a misspelt built-in node is told, and nodes of another version."
    ),
    fix=("correct the name, or describe the node in the TreeNodesModel"),
    bad=tree('<MoveBase location="kitchen"/>', model=MOVE_TO),
    good=tree('<MoveTo location="kitchen"/>', model=MOVE_TO),
)
