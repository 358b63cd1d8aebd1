"""Hover: the finding under the mouse, and what is known of the name there."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lsprotocol.types import TEXT_DOCUMENT_HOVER, Hover, HoverParams

from gpsfsm.lsp.cursor import Cursor, Where, cursor_at
from gpsfsm.lsp.diagnostics import span
from gpsfsm.lsp.features import Feature
from gpsfsm.lsp.words import (
    CONTROLS,
    ELEMENTS,
    LABELS,
    provider_of,
    tell_interface,
    tell_parameter,
    tell_provider,
    writable,
)

if TYPE_CHECKING:
    from gpsfsm.capabilities.library import Library
    from gpsfsm.lsp.prose import Prose
    from gpsfsm.lsp.session import Session
    from gpsfsm.lsp.texts import Text
    from gpsfsm.model.finding import Finding

__all__ = ["FEATURE"]

_MOST = 5
_MOST_STEPS = 20


async def hover(session: Session, params: HoverParams) -> Hover | None:
    """What is to be said about a place."""
    text = session.text(params.text_document.uri)
    if text is None:
        return None
    offset = text.places.offset(params.position)
    prose = session.prose()
    for finding in _findings(session, text, offset):
        if prose:
            prose.rule()
        _tell_finding(prose, finding)
    cursor = cursor_at(text.content, offset)
    setting = await session.setting(text)
    about = session.prose()
    _tell_name(about, cursor, setting.library)
    if about:
        if prose:
            prose.rule()
        prose.join(about)
    return Hover(prose.written()) if prose else None


def _findings(session: Session, text: Text, offset: int) -> list[Finding]:
    """Those at a place, as far as the text has not changed since it was checked."""
    checked = session.checking.latest(text.uri)
    if checked is None or checked.text is not text:
        return []
    found = []
    for finding in checked.report.findings:
        start, end = span(finding.location, finding.length, text)
        if start <= offset < max(end, start + 1):
            found.append(finding)
    return found[:_MOST]


def _tell_finding(prose: Prose, finding: Finding) -> None:
    from gpsfsm.analysis.rules import rule  # noqa: PLC0415  (loads all rules)

    prose.title(f"{finding.rule} {finding.name}", f"({finding.severity.value})")
    prose.text(finding.message)
    if finding.scenario is not None:
        prose.text(f"A run that ends {finding.scenario.ends.value}:")
        prose.items(finding.scenario.story[:_MOST_STEPS], numbered=True)
    if finding.hint:
        prose.text(f"What to do: {finding.hint}")
    prose.text(rule(finding.rule).why)


def _tell_name(prose: Prose, cursor: Cursor, library: Library) -> None:
    tag, attribute = cursor.tag, cursor.attribute
    if cursor.where is Where.TAG and tag is not None and tag.name in ELEMENTS:
        prose.title(f"<{tag.name}>").text(ELEMENTS[tag.name])
        if tag.name == "Control":
            _tell_control(prose, tag.value("type"))
        elif tag.name == "Runner":
            tell_interface(prose, tag.value("interface"), library)
    if tag is None or attribute is None:
        return
    if tag.name == "Control" and attribute.name == "type":
        _tell_control(prose, attribute.value)
    elif tag.name == "Runner" and attribute.name == "interface":
        tell_interface(prose, attribute.value, library)
    elif tag.name == "Runner" and attribute.name == "provider":
        provider = provider_of(library, tag.value("interface"), attribute.value)
        if provider is not None:
            tell_provider(prose, provider)
    elif attribute.name in LABELS:
        prose.title(attribute.name).text(LABELS[attribute.name])
    elif tag.name == "Runner":
        provider = provider_of(library, tag.value("interface"), tag.value("provider"))
        for known in [] if provider is None else writable(provider):
            if provider is not None and attribute.name in (known.name, *known.aliases):
                tell_parameter(prose, known, provider)


def _tell_control(prose: Prose, kind: str) -> None:
    if kind in CONTROLS:
        prose.title(kind).text(CONTROLS[kind])


FEATURE = Feature(TEXT_DOCUMENT_HOVER, hover)
