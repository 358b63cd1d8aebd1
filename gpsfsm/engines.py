"""Text → plan → automaton as an original engine does it (docs/engines.md)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from gpsfsm.capabilities.library import bind
from gpsfsm.compile.engine import compile_connections
from gpsfsm.compile.fabric import PROFILES
from gpsfsm.model.engine import EnginePlan, Rejected
from gpsfsm.model.plan import Kind
from gpsfsm.reading import read_connections
from gpsfsm.syntax import DEFAULT_LIMITS, Limits

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.capabilities.library import Library
    from gpsfsm.compile import Compiled
    from gpsfsm.model.engine import Parameter
    from gpsfsm.model.plan import Element, Plan
    from gpsfsm.reading import EngineText

__all__ = ["EngineReading", "read_for_engine"]


@dataclass(frozen=True, slots=True, eq=False)
class EngineReading:
    """A plan that an engine accepts.

    ``plan`` holds the elements that the engine sees, with their places in the text; ``compiled`` is
    what it makes of them. ``parameters`` are, per runner instance, its attributes as the engine
    stores them.
    """

    plan: Plan
    connections: EnginePlan
    compiled: Compiled
    parameters: tuple[tuple[Parameter, ...], ...]


def read_for_engine(
    text: str | bytes,
    engine: str,
    file: str,
    library: Library,
    limits: Limits = DEFAULT_LIMITS,
) -> EngineReading | EngineText:
    """What the engine (fabric-v1 or fabric-v2) makes of a text; EngineText if it refuses it.

    ``library`` describes the runners. Raises InputError for a text that is too large to be read.

    >>> from gpsfsm.capabilities.library import Library
    >>> found = read_for_engine("<Plan/> bye", "fabric-v2", "plan.xml", Library())
    >>> found.result.reason
    'XML_ERROR_PARSING_TEXT: no element follows this text'
    """
    reading = read_connections(text, engine, file=file, limits=limits)
    plan, result = reading.plan, reading.result
    if plan is None or reading.places is None or not isinstance(result, EnginePlan):
        return reading
    if PROFILES[engine].checked and not all(each.source.named for each in result.connections):
        return _unmatched(reading, result, plan)
    compiled = compile_connections(plan, result, reading.places, bind(plan, library))
    parameters = {
        reading.places[each.source.element]: each.source.parameters
        for each in result.connections
        if each.source.element is not None
    }
    return EngineReading(
        plan,
        result,
        compiled,
        tuple(parameters.get(runner.index, ()) for runner in plan.runners),
    )


def _unmatched(reading: EngineText, result: EnginePlan, plan: Plan) -> EngineText:
    """An entry without an interface: the engine looks for it in vain."""
    entries = result.connections
    gap = next(place for place, each in enumerate(entries) if not each.source.named)
    node, index = entries[gap].source, reading.element(entries[gap])
    if index is not None:
        place, reason = plan.elements[index], "the interface of this runner is empty"
    else:
        place = _empty_control(plan, filter(None, map(reading.element, entries[gap + 1 :])))
        reason = "an empty control takes a place among the connections without being a runner"
    message = f"Unmatched interface: {node.interface} provider: {node.provider} combination"
    refused = Rejected(message, place.start, reason)
    return replace(reading, result=refused, plan=None, line=place.line, column=place.column)


def _empty_control(plan: Plan, behind: Iterator[int]) -> Element:
    """The empty control that leaves a gap ahead of these elements."""
    empty = (
        element
        for element in reversed(plan.elements[: next(behind, None)])
        if element.kind is Kind.CONTROL and not element.children
    )
    return next(empty, plan.elements[0])
