"""GP813: a node means something that the automaton cannot express."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.trees import tree
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP813",
    name="inexpressible-node",
    severity=Severity.ERROR,
    summary="A node means something that the automaton cannot express.",
    why=(
        "A verdict holds for all runs, so nothing may be left out of the tree. Reactive "
        "nodes, loops without a bound, time limits and conditions on blackboard values are "
        "such nodes. The verdict is error: gpsfsm has not decided."
    ),
    fix=(
        "use nodes whose results alone decide what comes next; docs/behaviour-trees.md lists them"
    ),
    bad=tree('<Timeout msec="5000"><DriveHome/></Timeout>'),
    good=tree("<DriveHome/>"),
)
