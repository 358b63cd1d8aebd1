"""What the gate is asked, and what it says: frozen data."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING

from gpsfsm.checking import CheckOptions
from gpsfsm.model.finding import Finding, Severity

if TYPE_CHECKING:
    from gpsfsm.model.report import PlanReport

__all__ = ["Decision", "Digests", "GateOptions", "Reason", "Verdict"]


class Decision(StrEnum):
    """What the gate says."""

    ACCEPT = "accept"
    REFUSE = "refuse"


class Reason(StrEnum):
    """Why. ``inconclusive``: it could not be decided, within the limits or at all."""

    PASSED = "passed"
    FINDINGS = "findings"
    EMPTY = "empty"
    INCONCLUSIVE = "inconclusive"
    UNREADABLE = "unreadable"

    @property
    def exit_code(self) -> int:
        """0: accepted; 1: refused for what is in the plan; 2: refused since it was not decided."""
        if self is Reason.PASSED:
            return 0
        return 1 if self in (Reason.FINDINGS, Reason.EMPTY) else 2


@dataclass(frozen=True, slots=True)
class GateOptions:
    """What the gate asks for.

    ``check`` says how plans are checked (behaviour trees are no plans unless it says so),
    ``fail_on`` from which severity on a finding refuses a plan. ``allow_suppressions``: comments in
    the plan may excuse findings; else who writes a plan cannot. ``allow_empty``: a plan in which
    nothing is done passes.
    """

    check: CheckOptions = field(default_factory=lambda: CheckOptions(trees=False))
    fail_on: Severity = Severity.ERROR
    allow_suppressions: bool = False
    allow_empty: bool = False


@dataclass(frozen=True, slots=True)
class Digests:
    """For what a verdict holds: SHA-256 of the plan, the capabilities and the options, in hex.

    ``plan`` is that of the bytes of the plan, "" where they could not be read. ``all`` is one
    digest over those and the version of gpsfsm. The time budget is in none of them: it can make a
    verdict a refusal, never an acceptance.
    """

    plan: str
    capabilities: str
    options: str
    version: str
    all: str


@dataclass(frozen=True, slots=True)
class Verdict:
    """What the gate says about one plan; it is true if the plan may run.

    ``findings`` are those for which it is refused. ``report`` is what was found in all, as the gate
    sees it: what refuses the plan has the level error.
    """

    decision: Decision
    reason: Reason
    message: str
    digests: Digests
    findings: tuple[Finding, ...] = ()
    report: PlanReport | None = None

    @property
    def accepted(self) -> bool:
        """Whether the plan may run."""
        return self.decision is Decision.ACCEPT and self.reason is Reason.PASSED

    def __bool__(self) -> bool:
        return self.accepted

    def __str__(self) -> str:
        return "accepted" if self.accepted else f"refused: {self.reason.value}"
