"""GP808: the file does not say which format its trees have."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.trees import tree
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP808",
    name="tree-format",
    severity=Severity.WARNING,
    summary="The file does not say which format its trees have.",
    why=(
        "Versions 3 and 4 of BehaviorTree.CPP read some nodes and ports in different ways. "
        "Without BTCPP_format both readings are accepted, and BehaviorTree.CPP 4 warns."
    ),
    fix=('write BTCPP_format="4" (or "3") in <root>'),
    bad=tree("<DriveHome/>").replace(' BTCPP_format="4"', ""),
    good=tree("<DriveHome/>"),
)
