"""Findings as an editor shows them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lsprotocol.types import (
    CodeDescription,
    Diagnostic,
    DiagnosticRelatedInformation,
    DiagnosticSeverity,
    DiagnosticTag,
    Location,
    Range,
)

from gpsfsm.model.finding import Severity
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from gpsfsm.lsp.checking import Checked
    from gpsfsm.lsp.pages import Pages
    from gpsfsm.lsp.texts import Text
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.plan import Location as Place

__all__ = ["SOURCE", "diagnostics", "span"]

SOURCE = "gpsfsm"
_SEVERITIES = {
    Severity.ERROR: DiagnosticSeverity.Error,
    Severity.WARNING: DiagnosticSeverity.Warning,
    Severity.INFO: DiagnosticSeverity.Information,
}
_TAGS = {
    "GP301": DiagnosticTag.Unnecessary,
    "GP307": DiagnosticTag.Unnecessary,
    "GP905": DiagnosticTag.Unnecessary,
    "GP209": DiagnosticTag.Deprecated,
}
"""What never runs or has no effect is shown faded, what is outdated struck out."""
_MOST = 1_000
_MOST_RELATED = 50
_LONGEST = 4_000


def diagnostics(checked: Checked, pages: Pages | None, *, related: bool = True) -> list[Diagnostic]:
    """One for each finding, in their order.

    ``pages`` has a page for each rule; None if the editor cannot show links. ``related``: whether
    it can show further places.
    """
    if checked.setting.error:
        return [_unusable(checked)]
    found = checked.report.findings[:_MOST]
    return [
        _diagnostic(number, finding, checked.text, pages, related)
        for number, finding in enumerate(found)
    ]


def span(place: Place, length: int, text: Text) -> tuple[int, int]:
    """Where a finding stands: its offsets. Of none that is to be seen, the next character."""
    places = text.places
    start = places.at(place.line, place.column + (place.line == 1 and text.marked))
    return start, min(start + max(length, 1), max(places.line_end(start), start))


def _diagnostic(
    number: int, finding: Finding, text: Text, pages: Pages | None, related: bool
) -> Diagnostic:
    page = None if pages is None else pages.address(finding.rule)
    tag = _TAGS.get(finding.rule)
    hint = f"\nhint: {clip(finding.hint, _LONGEST)}" if finding.hint else ""
    return Diagnostic(
        range=text.places.range(*span(finding.location, finding.length, text)),
        message=clip(finding.message, _LONGEST) + hint,
        severity=_SEVERITIES[finding.severity],
        code=finding.rule,
        code_description=None if page is None else CodeDescription(page),
        source=SOURCE,
        tags=None if tag is None else [tag],
        related_information=_related(finding, text) if related else None,
        data={"finding": number, "version": text.version},
    )


def _related(finding: Finding, text: Text) -> list[DiagnosticRelatedInformation] | None:
    found = [
        (other.location, other.message or other.location.element or "see also")
        for other in finding.related
    ]
    return [
        DiagnosticRelatedInformation(
            Location(text.uri, text.places.range(*span(place, 0, text))), clip(message, _LONGEST)
        )
        for place, message in found[:_MOST_RELATED]
    ] or None


def _unusable(checked: Checked) -> Diagnostic:
    """The configuration does not fit, so nothing is checked."""
    start = checked.text.places.position(0)
    return Diagnostic(
        range=Range(start, start),
        message=f"the plan is not checked: {clip(checked.setting.error, _LONGEST)}",
        severity=DiagnosticSeverity.Error,
        source=SOURCE,
    )
