"""Digests: for which plan, capabilities, options and version a verdict holds."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

from gpsfsm.capabilities.table import dump
from gpsfsm.errors import InternalError
from gpsfsm.gating.verdicts import Digests
from gpsfsm.version import VERSION

if TYPE_CHECKING:
    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.gating.verdicts import GateOptions

__all__ = ["digests_of"]

_APART = "capabilities"
"""The option that has a digest of its own."""


def digests_of(text: str | bytes | None, options: GateOptions) -> Digests:
    """The digests of a plan and of what it is checked with; None for a plan that was not read.

    >>> from gpsfsm.gating.verdicts import GateOptions
    >>> digests_of(b"<Plan/>", GateOptions()).plan[:16]
    '99679fa55cbe78bd'
    """
    content = text.encode("utf-8", "surrogatepass") if isinstance(text, str) else text
    parts = (
        "" if content is None else hashlib.sha256(content).hexdigest(),
        _of_capabilities(options.check.described),
        _of_options(options),
        VERSION,
    )
    return Digests(*parts, all=_digest("\n".join(parts)))


@lru_cache(maxsize=8)
def _of_capabilities(capabilities: Capabilities) -> str:
    return _digest("\n".join((dump(capabilities.library), *capabilities.defects)))


@lru_cache(maxsize=8)
def _of_options(options: GateOptions) -> str:
    """All options as JSON, but the capabilities. New options are in it without anybody's doing."""
    check = {
        each.name: _plain(getattr(options.check, each.name))
        for each in fields(options.check)
        if each.name != _APART
    }
    values = {each.name: _plain(getattr(options, each.name)) for each in fields(options)} | {
        "check": check
    }
    return _digest(json.dumps(values, sort_keys=True, separators=(",", ":")))


def _plain(value: object) -> object:
    """A value for JSON.

    Raises InternalError for one that has no form of its own: its digest would mean nothing.
    """
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, frozenset):
        return sorted(map(str, value))
    if isinstance(value, tuple):
        return [_plain(each) for each in value]
    if isinstance(value, Mapping):
        return [[_plain(key), _plain(each)] for key, each in value.items()]
    if is_dataclass(value) and not isinstance(value, type):
        parts = {each.name: _plain(getattr(value, each.name)) for each in fields(value)}
        return {"": type(value).__name__, **parts}
    raise InternalError(f"there is no digest of a {type(value).__name__} among the options")


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
