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
        "The finding is gone, or the code is misspelt. "
        "A stale suppression hides the next real finding."
    ),
    fix="remove the comment, or correct the code in it",
    bad="<Plan>\n    <!-- gpsfsm: ignore GP303 -->\n" + plan(go(1.0, 1.0)).removeprefix("<Plan>\n"),
    good="<Plan>\n    <!-- gpsfsm: ignore GP302 -->\n"
    + plan(go(1.0, 1.0)).removeprefix("<Plan>\n"),
)
