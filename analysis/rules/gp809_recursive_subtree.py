"""GP809: a tree holds itself."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.trees import tree
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP809",
    name="recursive-subtree",
    severity=Severity.ERROR,
    summary="A tree holds itself.",
    why=(
        "The tree would be put into itself for ever. BehaviorTree.CPP runs out of memory "
        "when it loads such a file."
    ),
    fix=("take the SubTree out; to do something again, use Repeat or RetryUntilSuccessful"),
    bad=tree(
        '<SubTree ID="Dock"/>', Dock='<Fallback><DriveToDock/><SubTree ID="Dock"/></Fallback>'
    ),
    good=tree(
        '<SubTree ID="Dock"/>',
        Dock='<RetryUntilSuccessful num_attempts="2"><DriveToDock/></RetryUntilSuccessful>',
    ),
)
