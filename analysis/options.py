"""The options that choose the scenarios and the way of deciding."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

__all__ = ["DEFAULT_RLIMIT", "AnalysisOptions", "SolverChoice"]

SolverChoice = Literal["auto", "z3", "structural"]

DEFAULT_RLIMIT = 50_000_000
"""z3 steps per question: some seconds on an ordinary machine."""


@dataclass(frozen=True, slots=True)
class AnalysisOptions:
    """Scenario options (semantics, section 4) and how to decide.

    ``solver``: ``auto`` takes the structural pass where it is exact, with z3 as the second
    opinion on plans of up to ``second_opinion`` runners, and z3 elsewhere. ``rlimit`` bounds z3's
    steps per question; ``max_scenarios`` the scenarios per rule and plan.
    """

    faults: tuple[str, ...] = ()
    consistent: bool = False
    assumptions: tuple[str, ...] = ()
    solver: SolverChoice = "auto"
    rlimit: int = DEFAULT_RLIMIT
    second_opinion: int = 200
    max_scenarios: int = 100
