"""Short ways into what is tested."""

from __future__ import annotations

from typing import Any

from gpsfsm.compile.fabric import PROFILES, compile_document, listing
from gpsfsm.syntax.tinyxml import parse_document

__all__ = ["NAMES", "listed"]

NAMES = {1: "fabric-v1", 2: "fabric-v2", 3: "fabric-v3"}


def listed(version: int, text: str) -> Any:
    """What a version makes of a text, as data."""
    profile = PROFILES[NAMES[version]]
    return listing(compile_document(parse_document(text), profile), profile)
