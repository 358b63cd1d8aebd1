"""GP810: a built-in node is given a port that it does not have."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.trees import tree
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP810",
    name="unknown-builtin-port",
    severity=Severity.ERROR,
    summary="A built-in node is given a port that it does not have.",
    why=(
        "BehaviorTree.CPP refuses the file when it is loaded. Often the port is that of "
        "another version, or of another node."
    ),
    fix=("use the ports that the node has"),
    bad=tree('<RetryUntilSuccessful attempts="3"><Dock/></RetryUntilSuccessful>'),
    good=tree('<RetryUntilSuccessful num_attempts="3"><Dock/></RetryUntilSuccessful>'),
)
