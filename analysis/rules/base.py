"""What a rule is: documentation, metadata, and for many how verdicts become findings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.model.finding import Confidence, Finding, Problem, Related, Scenario, Severity

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from gpsfsm.analysis.context import Context
    from gpsfsm.analysis.on_engine import OnEngine
    from gpsfsm.model.plan import Location

__all__ = ["Rule"]


@dataclass(frozen=True, slots=True)
class Rule:
    """A rule of the catalogue.

    ``code`` and ``name`` are stable; the name reads as "allow <name>". ``summary`` says in one
    line what is found, ``why`` why it matters, ``fix`` what to do. ``bad`` and ``good`` are plans:
    a test checks that the rule finds something in the first and nothing in the second, with
    ``options`` (command line words such as ``--consistent``) where the rule needs them.
    ``severities`` explains when another severity than ``severity`` is used. Only rules of
    GP2xx to GP5xx have ``find``, and most of GP7xx ``find_on_engine``; the others are reported
    where their cause is met.
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
    find_on_engine: Callable[[OnEngine], Iterable[Finding]] | None = None

    def finding(
        self,
        message: str,
        location: Location,
        *,
        severity: Severity | None = None,
        hint: str = "",
        related: tuple[Related, ...] = (),
        scenario: Scenario | None = None,
        length: int = 0,
        unless: str = "",
    ) -> Finding:
        """A finding of this rule; ``severity`` and ``hint`` default to the rule's own.

        ``unless``: the rule that tells the same; the finding is for those who do not see that one.
        """
        return Finding(
            rule=self.code,
            name=self.name,
            severity=severity or self.severity,
            message=message,
            location=location,
            hint=hint or self.fix,
            length=length or _tag_length(location.element),
            related=related,
            scenario=scenario,
            confidence=self.confidence,
            unless=unless,
        )

    def finding_of(self, problem: Problem) -> Finding:
        """The finding for a problem that the front end reported."""
        return self.finding(
            problem.message,
            problem.location,
            hint=problem.hint,
            related=problem.related,
            length=problem.length,
        )


def _tag_length(element: str) -> int:
    """The length of ``<Runner`` for ``/Plan/Runner[2]``: what is underlined."""
    tag = element.rpartition("/")[2].partition("[")[0]
    return len(tag) + 1 if tag else 0
