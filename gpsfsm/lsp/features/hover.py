"""Hover and definition: finding and name under the mouse, and the file that describes it."""

from __future__ import annotations

import asyncio
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from lsprotocol.types import (
    TEXT_DOCUMENT_DEFINITION,
    TEXT_DOCUMENT_HOVER,
    DefinitionParams,
    Hover,
    HoverParams,
    Location,
    Position,
    Range,
)

from gpsfsm.lsp.diagnostics import span
from gpsfsm.lsp.features import Feature
from gpsfsm.lsp.texts import Cursor, Encoding, Places, Where, cursor_at
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
from gpsfsm.model.plan import NOT_PARAMETERS

if TYPE_CHECKING:
    from gpsfsm.capabilities.library import Library
    from gpsfsm.capabilities.reading import Node, Table
    from gpsfsm.lsp.session import Session
    from gpsfsm.lsp.texts import Text
    from gpsfsm.lsp.words import Prose
    from gpsfsm.model.capability import Provider
    from gpsfsm.model.finding import Finding

_MOST = 5
_MOST_STEPS = 20


async def hover(session: Session, params: HoverParams) -> Hover | None:
    """The text about a place."""
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
    findings = []
    for finding in checked.report.findings:
        start, end = span(finding.location, finding.length, text)
        if start <= offset < max(end, start + 1):
            findings.append(finding)
    return findings[:_MOST]


def _tell_finding(prose: Prose, finding: Finding) -> None:
    from gpsfsm.analysis.rules import rule

    prose.title(f"{finding.rule} {finding.name}", f"({finding.severity.value})")
    prose.text(finding.message)
    if finding.scenario is not None:
        prose.text(f"Scenario in which {finding.scenario.ending}:")
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
        for entry in [] if provider is None else writable(provider):
            if provider is not None and attribute.name in (entry.name, *entry.aliases):
                tell_parameter(prose, entry, provider)


def _tell_control(prose: Prose, kind: str) -> None:
    if kind in CONTROLS:
        prose.title(kind).text(CONTROLS[kind])


FEATURE = Feature(TEXT_DOCUMENT_HOVER, hover)


_BUILTIN = "runners/"


async def define(session: Session, params: DefinitionParams) -> Location | None:
    """The place where the capability that is named here is described."""
    text = session.text(params.text_document.uri)
    if text is None:
        return None
    cursor = cursor_at(text.content, text.places.offset(params.position))
    setting = await session.setting(text)
    described = _described(cursor, setting.library)
    if described is None:
        return None
    origin, parameter = described
    return await asyncio.to_thread(_place, origin, parameter, text.encoding)


def _described(cursor: Cursor, library: Library) -> tuple[str, str] | None:
    """The file, and the parameter in it ("": all of the file)."""
    tag, attribute = cursor.tag, cursor.attribute
    if tag is None or tag.name != "Runner":
        return None
    interface = tag.value("interface")
    provider = provider_of(library, interface, tag.value("provider"))
    name = "" if attribute is None else attribute.name
    if name == "interface" or (cursor.where is Where.TAG and not name):
        return _of_interface(interface, library)
    if provider is None or not name or name in NOT_PARAMETERS - {"provider"}:
        return None
    return provider.origin, "" if name == "provider" else _own_name(name, provider)


def _of_interface(name: str, library: Library) -> tuple[str, str] | None:
    for semantic in library.semantic:
        if semantic.name == name:
            return semantic.origin, ""
    interface = library.interface(library.translation(name) or name)
    return None if interface is None else (interface.origin, "")


def _own_name(name: str, provider: Provider) -> str:
    entry = provider.parameter(name)
    return name if entry is None else entry.name


def _place(origin: str, parameter: str, encoding: Encoding) -> Location | None:
    """The place in the file, where its name or that of the parameter stands."""
    from gpsfsm.capabilities.defects import Notes
    from gpsfsm.capabilities.files import read_bytes
    from gpsfsm.capabilities.reading import read_table

    file = _file(origin)
    notes = Notes(str(file))
    content = read_bytes(str(file), notes)
    if content is None:
        return None
    table = read_table(content, notes)
    place = (1, 1) if table is None else _in_table(table, parameter)
    places = Places(content.decode("utf-8-sig", "replace"), encoding)
    at = places.at(*place)
    position = places.position(at) if table is not None else Position(0, 0)
    return Location(file.resolve().as_uri(), Range(position, position))


def _file(origin: str) -> Path:
    """The file of a capability; those of the built-in library come with gpsfsm."""
    if origin.startswith(_BUILTIN):
        built_in = Path(str(resources.files("gpsfsm.runners"))) / origin.removeprefix(_BUILTIN)
        if built_in.is_file():
            return built_in
    return Path(origin)


def _in_table(table: Table, parameter: str) -> tuple[int, int]:
    """The place of the parameter's entry, else of the name of the file's capability."""
    waiting: list[Node] = [table] if parameter else []
    while waiting:
        node = waiting.pop(0)
        if isinstance(node, list):
            waiting += node
        elif isinstance(node, dict):
            name = node.get("name")
            if node is not table and getattr(name, "text", None) == parameter:
                return getattr(name, "place", node.place)
            if parameter in node.places and node is not table:
                return node.places[parameter]
            waiting += node.values()
    return table.places.get("name", (1, 1))


FURTHER = (Feature(TEXT_DOCUMENT_DEFINITION, define),)
