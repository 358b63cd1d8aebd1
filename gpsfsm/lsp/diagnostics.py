"""Findings as an editor shows them, each with a link to the page of its rule.

The pages are those of docs/rules; they are written when they are asked for, into a folder that is
gone when the server ends.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
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
    from gpsfsm.lsp.texts import Text
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.plan import Location as Place

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
    findings = checked.report.findings[:_MOST]
    return [
        _diagnostic(number, finding, checked.text, pages, related)
        for number, finding in enumerate(findings)
    ]


def span(place: Place, length: int, text: Text) -> tuple[int, int]:
    """The offsets of a finding. Of none that is to be seen, the next character."""
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
    places = [
        (other.location, other.message or other.location.element or "see also")
        for other in finding.related
    ]
    return [
        DiagnosticRelatedInformation(
            Location(text.uri, text.places.range(*span(place, 0, text))), clip(message, _LONGEST)
        )
        for place, message in places[:_MOST_RELATED]
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


class Pages:
    """The pages that were asked for, by the code of the rule."""

    def __init__(self) -> None:
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._addresses: dict[str, str | None] = {}

    def address(self, code: str) -> str | None:
        """The address of the page; None if it cannot be written."""
        if code not in self._addresses:
            try:
                self._addresses[code] = self._write(code)
            except OSError:
                self._addresses[code] = None
        return self._addresses[code]

    def close(self) -> None:
        """Remove them."""
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None
        self._addresses.clear()

    def _write(self, code: str) -> str:
        from gpsfsm.analysis.rules import rule
        from gpsfsm.report._rule_docs import rule_markdown

        if self._folder is None:
            self._folder = tempfile.TemporaryDirectory(prefix="gpsfsm-rules-")
        file = Path(self._folder.name, f"{code}.md")
        file.write_text(rule_markdown(rule(code)), encoding="utf-8")
        return file.as_uri()
