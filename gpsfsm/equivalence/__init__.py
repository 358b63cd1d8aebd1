"""Equivalence of plans: do two plans act alike, whatever the outcomes (docs/tasks.md)."""

from __future__ import annotations

from gpsfsm.equivalence.comparison import (
    Decider,
    UndecidedError,
    compare,
    convert_plan,
    targets,
)
from gpsfsm.equivalence.pairs import Difference, Pair, Step

__all__ = [
    "Decider",
    "Difference",
    "Pair",
    "Step",
    "UndecidedError",
    "compare",
    "convert_plan",
    "targets",
]
