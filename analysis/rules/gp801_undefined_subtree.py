"""GP801: a SubTree stands for a tree that the file does not have."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.trees import tree
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP801",
    name="undefined-subtree",
    severity=Severity.ERROR,
    summary="A SubTree stands for a tree that the file does not have.",
    why=(
        "BehaviorTree.CPP refuses the file when it is loaded, and a language model that "
        "names a tree often forgets to write it. What the tree would do there is not known, "
        "so nothing is decided."
    ),
    fix=("add a BehaviorTree with this ID, or correct the ID"),
    bad=tree('<SubTree ID="Dock"/>'),
    good=tree('<SubTree ID="Dock"/>', Dock="<DriveToDock/>"),
)
