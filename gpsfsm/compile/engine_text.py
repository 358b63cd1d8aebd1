"""Text → automaton as an original engine does it, in five steps that go one way (docs/engines.md).

1. ``syntax/tinyxml`` parses the text into the elements that the engine's parser sees.
2. ``compile/fabric`` makes connections of them, or a rejection, or a crash.
3. ``syntax/tinyxml`` makes a plan of the elements that the connections speak of (``EngineText``).
4. ``capabilities`` bind its runners; an entry that names none is a rejection after all.
5. ``compile/engine.py`` makes the automaton, with the engine's traits (``EngineReading``).

fabric-v3 then validates what the connections hand over (``compile/validation.py``), which may be a
rejection after all.

``checking/engine_check.py`` goes on from there: it decides and finds.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from gpsfsm.capabilities.library import bind
from gpsfsm.compile.engine import compile_connections
from gpsfsm.compile.fabric import PROFILES, compile_document
from gpsfsm.compile.validation import Validation, reads_plan
from gpsfsm.errors import InputError, UsageError
from gpsfsm.model.engine import EngineDocument, EnginePlan, Rejected
from gpsfsm.model.plan import Kind
from gpsfsm.syntax import DEFAULT_LIMITS, Limits
from gpsfsm.syntax.tinyxml import parse_document, plan_of, position

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from gpsfsm.capabilities.library import Library
    from gpsfsm.compile import Compiled
    from gpsfsm.model.engine import Connection, EngineResult, Parameter
    from gpsfsm.model.plan import Element, Plan


@dataclass(frozen=True, slots=True, eq=False)
class EngineText:
    """A text as an original engine reads it: connections, a rejection or a crash.

    ``engine`` is the name of its profile. ``plan`` is None where ``result`` is no EnginePlan. For a
    rejection or a crash, (``line``, ``column``) is the place that it is about; else they are 1.
    ``places`` leads from the engine's elements to those of ``plan``.
    """

    file: str
    engine: str
    result: EngineResult
    plan: Plan | None = None
    line: int = 1
    column: int = 1
    places: Mapping[int, int] | None = None

    def element(self, connection: Connection) -> int | None:
        """The plan's element behind a connection: a runner, or the control that a join closes.

        None for the runner that the engine appends, and for an entry that stands for nothing.
        """
        element = (
            connection.control if connection.control is not None else connection.source.element
        )
        return None if element is None or self.places is None else self.places[element]


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
    """All five steps: the plan as the engine runs it; EngineText if the engine refuses the text.

    ``engine`` is fabric-v1 or fabric-v2; ``library`` describes the runners. Raises InputError for a
    text that is too large to be read.

    >>> from gpsfsm.capabilities.library import Library
    >>> reading = read_for_engine("<Plan/> bye", "fabric-v2", "plan.xml", Library())
    >>> reading.result.reason
    'XML_ERROR_PARSING_TEXT: no element follows this text'
    """
    reading = read_connections(text, engine, file=file, limits=limits)
    plan, result = reading.plan, reading.result
    if plan is None or reading.places is None or not isinstance(result, EnginePlan):
        return reading
    if PROFILES[engine].checked and not all(each.source.named for each in result.connections):
        return _unmatched(reading, result, plan)
    compiled = compile_connections(plan, result, reading.places, bind(plan, library))
    if PROFILES[engine].validated:
        refused = _invalid(reading, compiled, library)
        if refused is not None:
            return refused
    parameters = {
        reading.places[each.source.element]: each.source.parameters
        for each in result.connections
        if each.source.element is not None
    }
    assert len(compiled.automaton.runners) == len(plan.runners)
    return EngineReading(
        plan,
        result,
        compiled,
        tuple(parameters.get(runner.index, ()) for runner in plan.runners),
    )


def read_connections(
    text: str | bytes, engine: str, *, file: str = "<text>", limits: Limits = DEFAULT_LIMITS
) -> EngineText:
    """The first three steps: a text as an original engine reads it, whether or not it is XML.

    Bytes are read as UTF-8 whatever they declare, as the engine does. Raises UsageError for an
    engine that is not known, and InputError for a text that is too large to be read.

    >>> reading = read_connections("Sure! <Plan><Runner interface='Go' provider='Go'/></Plan>",
    ...                           "fabric-v2")
    >>> [connection.source.interface for connection in reading.result.connections]
    ['Go', 'fabric_capabilities/FabricCompletionRunner']
    """
    profile = PROFILES.get(engine)
    if profile is None:
        raise UsageError(f"there is no engine '{engine}'; the engines are {', '.join(PROFILES)}")
    if len(text) > limits.max_bytes:
        message = f"the text is longer than {limits.max_bytes:,} bytes; raise --max-bytes"
        raise InputError(f"{file}: {message}")
    decoded = text.decode("utf-8", "surrogateescape") if isinstance(text, bytes) else text
    try:
        document = parse_document(decoded, limits)
    except InputError as error:
        raise InputError(f"{file}: {error}") from error
    result = compile_document(document, profile)
    if isinstance(result, EnginePlan) and isinstance(document, EngineDocument):
        plan, places = plan_of(document, result.root, decoded, file)
        return EngineText(file, engine, result, plan, places=places)
    assert not isinstance(result, EnginePlan)
    line, column = position(decoded, result.offset)
    return EngineText(file, engine, result, None, line, column)


def _unmatched(reading: EngineText, result: EnginePlan, plan: Plan) -> EngineText:
    """The rejection for an entry without an interface: the engine looks for it in vain."""
    entries = result.connections
    gap = next(place for place, each in enumerate(entries) if not each.source.named)
    node, index = entries[gap].source, reading.element(entries[gap])
    if index is not None:
        place, reason = plan.elements[index], "the interface of this runner is empty"
    else:
        place = _empty_control(plan, filter(None, map(reading.element, entries[gap + 1 :])))
        reason = "the engine makes a connection to an empty control as if it were a runner"
    message = f"Unmatched interface: {node.interface} provider: {node.provider} combination"
    refused = Rejected(message, place.start, reason)
    return replace(reading, result=refused, plan=None, line=place.line, column=place.column)


def _invalid(reading: EngineText, compiled: Compiled, library: Library) -> EngineText | None:
    """The rejection of a plan whose runners do not fit the robot or each other; None if they do."""
    refusal = Validation(compiled, library).refusal()
    if refusal is None:
        return None
    runners = compiled.automaton.plan.runners
    place, wanted = runners[refusal.runner], refusal.wanted
    if wanted is None:
        message = f"Unmatched interface: {place.interface} provider: {place.provider} combination"
        reason = "the robot has no such provider of this runner's interface"
        hint = "name an interface and a provider that the robot's files describe"
    else:
        message = (
            f"Unsatisfied required runtime input '{wanted.name}' for capability {place.interface} "
            f"provider {place.provider}"
        )
        if wanted.semantic_key:
            message += f" (semantic_key={wanted.semantic_key})"
        reason = f"nothing provides the input '{wanted.name}' of this runner"
        hint = "put a step that outputs it right before this runner, with no control between them"
        if reads_plan(wanted):
            hint = f'write {wanted.name}="…" in the plan, or {hint}'
        if refusal.giver is not None and refusal.join is not None:
            giver, join = runners[refusal.giver], compiled.automaton.nodes[refusal.join]
            control = compiled.automaton.plan.elements[join.origin]
            reason += (
                f": {giver.interface.rpartition('/')[2]} at line {giver.line} outputs it, but only "
                f"through the join of the {control.words} at line {control.line}, and joins pass "
                "no values on"
            )
        elif wanted.name in {attribute.name for attribute in place.attributes}:
            reason += ": it must come from the step before, so the attribute does not count"
        else:
            reason += ", neither a step that leads directly to it nor the plan"
    refused = Rejected(message, place.start, reason, (), hint)
    return replace(reading, result=refused, plan=None, line=place.line, column=place.column)


def _empty_control(plan: Plan, behind: Iterator[int]) -> Element:
    """The empty control that leaves a gap ahead of these elements."""
    empty = (
        element
        for element in reversed(plan.elements[: next(behind, None)])
        if element.kind is Kind.CONTROL and not element.children
    )
    return next(empty, plan.elements[0])
