"""The options of the analyses: which scenarios there are, and how much work decides about a plan.

The unit of work is a step of z3, which is the same on every machine, and so is what runs out of
them: no plan keeps a check busy.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from gpsfsm.late import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterable

SolverChoice = Literal["auto", "z3", "structural"]

DEFAULT_RLIMIT = 50_000_000
"""z3 steps per question: some seconds on an ordinary machine."""

DEFAULT_TOTAL_RLIMIT = 500_000_000
"""z3 steps per plan: some minutes on an ordinary machine."""

MAX_RLIMIT = 2**32 - 1
"""z3 counts in 32 bits."""

MAX_TOTAL_RLIMIT = 10**15

MAX_TOLERATED = 1_000_000
"""Failures that can be demanded to be tolerated."""

DEFAULT_MAX_SCENARIOS = 100
"""Scenarios per rule and plan."""


@dataclass(frozen=True, slots=True)
class AnalysisOptions:
    """The scenarios that a check considers (semantics, section 4) and how it decides.

    - ``solver``: ``auto`` uses the structural pass where it is exact and z3 elsewhere; z3 also
      proves the answers of the structural pass.
    - ``second_opinion``: up to this number of runners, z3 also answers the questions itself that
      are not put to it as refutations, and searches for scenarios that only it can find.
    - ``rlimit``, ``total_rlimit``: z3's steps per question and for the whole plan.
    - ``max_scenarios``: the scenarios per rule and plan.
    - ``require_proof``: a plan is undecided unless all answers are proved.
    - ``deadline_s``, ``energy_limit_j``: the seconds and joules that a run may take; None: no
      limit.
    - ``tolerate``: the number of failures that must not end the plan; 0: any failure may.
    - ``allowance_s``: the seconds that a real run adds to the declared durations, once at its
      beginning and once for each action.
    """

    faults: tuple[str, ...] = ()
    consistent: bool = False
    assumptions: tuple[str, ...] = ()
    solver: SolverChoice = "auto"
    rlimit: int = DEFAULT_RLIMIT
    total_rlimit: int = DEFAULT_TOTAL_RLIMIT
    second_opinion: int = 200
    max_scenarios: int = DEFAULT_MAX_SCENARIOS
    require_proof: bool = False
    deadline_s: float | None = None
    energy_limit_j: float | None = None
    tolerate: int = 0
    allowance_s: float = 0.0


def check_assumptions(texts: Iterable[str]) -> None:
    """Raise AssumptionError for the first that does not parse; without any, load no parser."""
    for text in texts:
        from gpsfsm.analysis.assumptions import parse_assumption

        parse_assumption(text)


SECOND_OPINION = 5_000_000
"""Steps for a second opinion, without which an answer stands as well.

Ten times what plans of 200 runners take; trees with a counting Parallel may take more.
"""


class InconclusiveError(Exception):
    """A limit of steps was reached: the question is undecided."""


class Purse:
    """Steps that are left for one purpose; several problems may share them."""

    def __init__(self, steps: int) -> None:
        self.left = steps

    def pay(self, steps: int) -> None:
        """Take steps out; it may come out empty, and then gives nothing any more."""
        self.left -= steps

    @property
    def empty(self) -> bool:
        """True if nothing is left."""
        return self.left <= 0

    def require(self, steps: int = 0) -> None:
        """Pay for what comes now; raises InconclusiveError if nothing was left before."""
        if self.empty:
            raise InconclusiveError
        self.pay(steps)


class Budget:
    """The steps for one plan, ``total`` in all.

    ``deciding``: for what the verdict rests on, and the ``second`` opinion about it;
    ``scenarios``: for those that are shown, so that no search for them leaves a verdict undecided.
    """

    def __init__(self, total: int) -> None:
        quarter = total // 4
        second = min(quarter, SECOND_OPINION)
        self.scenarios = Purse(quarter)
        self.second = Purse(second)
        self.deciding = Purse(total - quarter - second)
