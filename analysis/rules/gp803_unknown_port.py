"""GP803: a node is given a port that its model does not have."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.trees import MOVE_TO, tree
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP803",
    name="unknown-port",
    severity=Severity.ERROR,
    summary="A node is given a port that its model does not have.",
    why=(
        "BehaviorTree.CPP refuses the file when it is loaded. A misspelt port is a value "
        "that never arrives."
    ),
    fix=("use the ports that the TreeNodesModel names"),
    bad=tree('<MoveTo goal="kitchen"/>', model=MOVE_TO),
    good=tree('<MoveTo location="kitchen"/>', model=MOVE_TO),
)
