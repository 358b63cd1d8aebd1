"""What a rule is: documentation, metadata and, for most, how verdicts become findings."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.model.finding import Confidence, Finding, Problem, Severity

if TYPE_CHECKING:
    from gpsfsm.analysis.context import Context

__all__ = ["Rule"]


@dataclass(frozen=True, slots=True)
class Rule:
    """A rule of the catalogue.

    ``code`` and ``name`` are stable; the name reads as "allow <name>". ``summary`` says in one
    line what is found, ``why`` why it matters, ``fix`` what to do. ``bad`` and ``good`` are plans:
    a test checks that the rule finds something in the first and nothing in the second, with
    ``options`` (command line words such as ``--consistent``) where the rule needs them.
    ``severities`` explains when another severity than ``severity`` is used.
    """

    code: str
    name: str
    severity: Severity
    summary: str
    why: str
    fix: str
    bad: str
    good: str
    options: tuple[str, ...] = ()
    severities: str = ""
    confidence: Confidence = Confidence.PROVED
    find: Callable[[Context], Iterable[Finding]] | None = None

    def finding_of(self, problem: Problem) -> Finding:
        """The finding for a problem that the front end reported."""
        return Finding(
            rule=self.code,
            name=self.name,
            severity=self.severity,
            message=problem.message,
            location=problem.location,
            hint=problem.hint or self.fix,
            length=problem.length,
            related=problem.related,
            confidence=self.confidence,
        )
