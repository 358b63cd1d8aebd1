"""GP113: a completion runner at the end of the plan."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import go, plan
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP113",
    name="explicit-completion",
    severity=Severity.INFO,
    summary="The plan names its completion runner as its last element.",
    why=(
        "A plan completes by itself after its last element. Naming the completion runner is not "
        "wrong, but unnecessary, and elsewhere than at the end it would complete the plan too "
        "early. The check leaves it out."
    ),
    fix="remove the completion runner",
    bad=plan(
        go(2.0, -0.5),
        '<Runner interface="fabric_capabilities/FabricCompletionRunner" '
        'provider="fabric_capabilities/FabricCompletionRunner"/>',
    ),
    good=plan(go(2.0, -0.5)),
)
