"""What the tests of the oracle share: places, and facts to compare with."""

from __future__ import annotations

from typing import Any

R1, R2 = "/Plan/Runner[1]", "/Plan/Runner[2]"
C1, C2 = "/Plan/Control[1]", "/Plan/Control[2]"

# What holds of a plan that always completes without more to say; tests name the differences.
PLAIN: dict[str, Any] = {
    "completes": "always",
    "gives_up": "never",
    "stuck": "never",
    "unreachable": [],
    "dangling": [],
    "join_deadlocks": [],
    "orphans": [],
    "fewest_failures_to_give_up": None,
}


def fails(*paths: str, effect: str = "give_up") -> list[dict[str, str]]:
    return [{"runner": path, "event": "FAILED", "effect": effect} for path in paths]


SOMETIMES = {"completes": "sometimes", "gives_up": "sometimes"}
