"""GP905: a suppression that suppresses nothing."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import go, plan
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP905",
    name="unused-suppression",
    severity=Severity.WARNING,
    summary="A suppression comment suppresses nothing.",
    why=(
        "The finding is gone, the comment gives no reason, or it does not name single rules by "
        "their codes or names. A stale suppression hides the next real finding."
    ),
    fix="remove the comment, or name the rule in it and say why it does not matter",
    bad="<Plan>\n    <!-- gpsfsm: ignore GP303 because I say so -->\n"
    + plan(go(1.0, 1.0)).removeprefix("<Plan>\n"),
    good="<Plan>\n    <!-- gpsfsm: ignore GP302 because an operator is there -->\n"
    + plan(go(1.0, 1.0)).removeprefix("<Plan>\n"),
)
