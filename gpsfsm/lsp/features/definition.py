"""Definition: from the name of a capability to the file that describes it."""

from __future__ import annotations

import asyncio
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from lsprotocol.types import TEXT_DOCUMENT_DEFINITION, DefinitionParams, Location, Position, Range

from gpsfsm.lsp.cursor import Cursor, Where, cursor_at
from gpsfsm.lsp.features import Feature
from gpsfsm.lsp.positions import Encoding, Places
from gpsfsm.lsp.words import provider_of
from gpsfsm.model.plan import NOT_PARAMETERS

if TYPE_CHECKING:
    from gpsfsm.capabilities.library import Library
    from gpsfsm.capabilities.reading import Node, Table
    from gpsfsm.lsp.session import Session
    from gpsfsm.model.capability import Provider

__all__ = ["FEATURE"]

_BUILTIN = "runners/"


async def define(session: Session, params: DefinitionParams) -> Location | None:
    """Where what is named here is described."""
    text = session.text(params.text_document.uri)
    if text is None:
        return None
    cursor = cursor_at(text.content, text.places.offset(params.position))
    setting = await session.setting(text)
    found = _described(cursor, setting.library)
    if found is None:
        return None
    origin, parameter = found
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
    found = library.interface(library.translation(name) or name)
    return None if found is None else (found.origin, "")


def _own_name(name: str, provider: Provider) -> str:
    found = provider.parameter(name)
    return name if found is None else found.name


def _place(origin: str, parameter: str, encoding: Encoding) -> Location | None:
    """The place in the file, where its name or that of the parameter stands."""
    from gpsfsm.capabilities.defects import Notes  # noqa: PLC0415  (loads a YAML parser)
    from gpsfsm.capabilities.files import read_bytes  # noqa: PLC0415
    from gpsfsm.capabilities.reading import read_table  # noqa: PLC0415

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
    """Where the entry of the parameter is, else where the file says its name."""
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


FEATURE = Feature(TEXT_DOCUMENT_DEFINITION, define)
