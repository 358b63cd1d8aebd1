"""What an engine makes of a plan, as data that can be written as JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

from gpsfsm.model.engine import Crashed, EngineNode, OptionType, Rejected

if TYPE_CHECKING:
    from gpsfsm.compile.fabric.profiles import Profile
    from gpsfsm.model.engine import Connection, EngineResult

__all__ = ["listing"]

_Row: TypeAlias = dict[str, Any]


def listing(result: EngineResult, profile: Profile) -> list[_Row] | _Row:
    """The connections of a plan, one row per connection, or its rejection or crash.

    A row names targets by their instance. Parameters are pairs of value and type; of the version
    without types only those that it sets itself are listed.
    """
    if isinstance(result, Crashed):
        return {"crash": result.signal}
    if isinstance(result, Rejected):
        row: _Row = {"error": result.message}
        if result.elements is not None:
            row["rejected"] = len(result.elements)
        return row
    return [_row(connection, typed=profile.typed) for connection in result.connections]


def _row(connection: Connection, *, typed: bool) -> _Row:
    source = connection.source
    return {
        "id": connection.id,
        "interface": source.interface,
        "inst": source.instance,
        "start": _target(connection.on_start),
        "success": _target(connection.on_success),
        "failure": _target(connection.on_failure),
        "desc": connection.description,
        "params": {
            parameter.name: [parameter.text if typed else parameter.value, int(parameter.type)]
            for parameter in source.parameters
            if parameter.type is not OptionType.UNCONVERTED
        },
    }


def _target(node: EngineNode | None) -> int | None:
    """The instance of a target; None for what the engine takes for none."""
    return node.instance if node is not None and node.named else None
