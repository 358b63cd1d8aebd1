"""Grading: how good the answers of language models are, one by one and in tables.

``grader`` grades an answer (docs/tasks.md), ``rewards`` are for trainers (docs/rewards.md), and
docs/experiments.md gives the formulas of the tables and the layouts of recorded experiments.
Names are looked up when they are needed: a trainer's process need not load the analyses.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gpsfsm.grading.grader import Grade, Graded, Grader

__all__ = ["Grade", "Graded", "Grader"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'gpsfsm.grading' has no attribute '{name}'")
    return getattr(importlib.import_module("gpsfsm.grading.grader"), name)
