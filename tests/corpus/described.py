"""The built-in library in the form of the oracle, read a second time from its table.

Only what facts depend on: declared outcomes, durations and energies.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tests.oracle.capabilities import Described, Parameter

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["AMOUNTS", "described", "parameter_name"]

_TABLE = json.loads((Path(__file__).parents[2] / "runners" / "library.json").read_text("utf-8"))
_NAMES = {
    name: interface["name"]
    for interface in _TABLE["interfaces"]
    for name in (interface["name"], *interface.get("formerly", ()))
}
_PROVIDERS: Mapping[str, Mapping[str, Any]] = {one["name"]: one for one in _TABLE["providers"]}
AMOUNTS = {
    name
    for one in _TABLE["providers"]
    for kind in ("duration", "energy")
    for name in one.get(kind, {}).values()
    if isinstance(name, str)
}
"""The parameters that hold a duration or an energy."""


def _provider(interface: str, provider: str) -> Mapping[str, Any] | None:
    """The provider that a plan means; each interface of the library has the one of its name."""
    meant = _NAMES.get(provider, provider)
    if _NAMES.get(interface) != meant or meant not in _PROVIDERS:
        return None
    entry = _PROVIDERS[meant]
    return entry if entry.get("described") else None


def described(interface: str, provider: str) -> Described | None:
    """What is known about a runner of these names, as the plan spells them."""
    entry = _provider(interface, provider)
    if entry is None:
        return None
    outcomes = entry.get("outcomes", {})
    return Described(
        interface,
        provider,
        parameters=tuple(
            Parameter(
                one["name"], one.get("required", False), one.get("default"), one.get("type", "")
            )
            for one in entry.get("configuration", ())
        ),
        duration=_bounds(entry.get("duration")),
        energy=_bounds(entry.get("energy")),
        never_fails=outcomes.get("never_fails", False),
        never_succeeds=outcomes.get("never_succeeds", False),
        may_hang=outcomes.get("may_hang", False),
        unless=tuple((name, value) for name, value in outcomes.get("unless", ())),
        achieves=entry.get("achieves", False),
    )


def _bounds(span: Mapping[str, Any] | None) -> tuple[float | str, float | str | None] | None:
    return None if span is None else (span.get("minimum", 0.0), span.get("maximum"))


def parameter_name(interface: str, provider: str, name: str) -> str:
    """The name of the parameter that an attribute sets, if by another name of it."""
    entry = _provider(interface, provider) or {}
    for one in entry.get("configuration", ()):
        if name in one.get("aliases", ()):
            return str(one["name"])
    return name
