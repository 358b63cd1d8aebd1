"""GP807: a node, a tree or a port that needs a name has none."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.trees import tree
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP807",
    name="missing-id",
    severity=Severity.ERROR,
    summary="A node, a tree or a port that needs a name has none.",
    why=(
        "<Action/>, <Condition/> and <SubTree/> say with their ID which node or tree they "
        "are. Without it there is nothing to run."
    ),
    fix=("add the ID"),
    bad=tree('<Action goal="dock"/>'),
    good=tree('<Action ID="DriveTo" goal="dock"/>'),
)
