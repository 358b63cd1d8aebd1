"""GP804: a tree or a node of one's own has a name that is taken."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.trees import tree
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP804",
    name="reserved-name",
    severity=Severity.ERROR,
    summary="A tree or a node of one's own has a name that is taken.",
    why=(
        "The names of the built-in nodes, and 'root', have a meaning of their own. "
        "BehaviorTree.CPP refuses them or takes the built-in node instead."
    ),
    fix=("choose another ID"),
    bad=tree("<DriveHome/>").replace("Main", "root"),
    good=tree("<DriveHome/>"),
)
