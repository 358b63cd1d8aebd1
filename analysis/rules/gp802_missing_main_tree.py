"""GP802: nothing says which tree runs, or the tree that is named does not exist."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.trees import tree
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP802",
    name="missing-main-tree",
    severity=Severity.ERROR,
    summary="Nothing says which tree runs, or the tree that is named does not exist.",
    why=(
        "A file may hold several trees. BehaviorTree.CPP runs the one that "
        "main_tree_to_execute names and refuses the file if there is none of that name. If "
        "only one tree is not used by others, it is checked all the same."
    ),
    fix=("name one of the trees of the file in main_tree_to_execute"),
    bad=tree("<DriveHome/>").replace('ID="Main"', 'ID="Patrol"'),
    good=tree("<DriveHome/>"),
)
