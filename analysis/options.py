"""The options that choose the scenarios and the way of deciding."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = [
    "DEFAULT_MAX_SCENARIOS",
    "DEFAULT_RLIMIT",
    "DEFAULT_TOTAL_RLIMIT",
    "MAX_RLIMIT",
    "MAX_TOTAL_RLIMIT",
    "AnalysisOptions",
    "SolverChoice",
    "check_assumptions",
]

SolverChoice = Literal["auto", "z3", "structural"]

DEFAULT_RLIMIT = 50_000_000
"""z3 steps per question: some seconds on an ordinary machine."""

DEFAULT_TOTAL_RLIMIT = 500_000_000
"""z3 steps per plan: some minutes on an ordinary machine."""

MAX_RLIMIT = 2**32 - 1
"""z3 counts in 32 bits."""

MAX_TOTAL_RLIMIT = 10**15

DEFAULT_MAX_SCENARIOS = 100
"""Scenarios per rule and plan."""


@dataclass(frozen=True, slots=True)
class AnalysisOptions:
    """Scenario options (semantics, section 4) and how to decide.

    ``solver``: ``auto`` takes the structural pass where it is exact, with z3 as the second
    opinion on plans of up to ``second_opinion`` runners, and z3 elsewhere; scenarios of runs that
    exceed a limit are looked for up to there too. ``rlimit`` bounds z3's steps per question,
    ``total_rlimit`` those for the whole plan (see ``gpsfsm.analysis.budget``);
    ``max_scenarios`` the scenarios per rule and plan. ``deadline_s`` (seconds)
    and ``energy_limit_j`` (joules) are what a run may take; None: no limit. ``allowance_s`` is what
    a real run adds to the declared durations, once as it begins and once for each action; 0: they
    are taken as they are.
    """

    faults: tuple[str, ...] = ()
    consistent: bool = False
    assumptions: tuple[str, ...] = ()
    solver: SolverChoice = "auto"
    rlimit: int = DEFAULT_RLIMIT
    total_rlimit: int = DEFAULT_TOTAL_RLIMIT
    second_opinion: int = 200
    max_scenarios: int = DEFAULT_MAX_SCENARIOS
    deadline_s: float | None = None
    energy_limit_j: float | None = None
    allowance_s: float = 0.0


def check_assumptions(texts: Iterable[str]) -> None:
    """Raise AssumptionError for the first that does not parse; without any, load no parser."""
    for text in texts:
        from gpsfsm.analysis.assumptions import parse_assumption  # noqa: PLC0415

        parse_assumption(text)
