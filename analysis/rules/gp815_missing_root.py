"""GP815: there is no <root> around the trees."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.trees import tree
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP815",
    name="missing-root",
    severity=Severity.ERROR,
    summary="There is no <root> around the trees.",
    why=(
        "BehaviorTree.CPP reads files whose outermost element is <root>. Language models "
        "leave it out where the prompt does not mention it. The tree is checked all the same."
    ),
    fix=('put <root BTCPP_format="4"> around the trees'),
    bad='<BehaviorTree ID="Main">\n    <DriveHome/>\n</BehaviorTree>\n',
    good=tree("<DriveHome/>"),
)
