"""Findings as rows of the view document."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.model.finding import Finding
    from gpsfsm.model.plan import Location

__all__ = ["finding_row", "rules_of"]


def finding_row(finding: Finding, elements: Mapping[str, int], play: int) -> dict[str, Any]:
    """A finding; ``elements`` are the rows by element path, ``play`` is that of its scenario."""
    place = finding.location
    return {
        "rule": finding.rule,
        "severity": finding.severity.value,
        "message": finding.message,
        "hint": finding.hint,
        "line": place.line,
        "column": place.column,
        "length": finding.length,
        "element": _element(place, elements),
        "related": [
            {
                "element": _element(other.location, elements),
                "line": other.location.line,
                "column": other.location.column,
                "message": other.message,
            }
            for other in finding.related
        ],
        "confidence": finding.confidence.value,
        "suppressed": finding.suppressed_by,
        "justification": finding.justification,
        "play": play,
        "ends": "" if finding.scenario is None else finding.scenario.ends.value,
        "story": [] if finding.scenario is None or play >= 0 else list(finding.scenario.story),
    }


def _element(place: Location, elements: Mapping[str, int]) -> int:
    """The row of an element; of one that is not there, the nearest one around it."""
    path = place.element
    while path:
        if path in elements:
            return elements[path]
        path = path.rpartition("/")[0]
    return -1


def rules_of(codes: set[str]) -> dict[str, dict[str, str]]:
    """What the rules with these codes find, and why that matters."""
    from gpsfsm.analysis.rules import rule  # noqa: PLC0415  (loads all of them)

    return {
        code: {"name": found.name, "summary": found.summary, "why": found.why}
        for code in sorted(codes)
        for found in (rule(code),)
    }
