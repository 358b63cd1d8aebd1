"""Text → plan: written as a plan, as a behaviour tree, or read as an original engine reads it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.errors import InputError, UsageError
from gpsfsm.syntax import DEFAULT_LIMITS, Limits, Parsed, parse
from gpsfsm.syntax.source import read_source

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.model.engine import Connection, EngineResult
    from gpsfsm.model.finding import Problem
    from gpsfsm.model.plan import Plan

__all__ = ["EngineText", "holds_trees", "read_connections", "read_plan"]

_EXTRACTED = "GP115"
_LOST = "GP813"


def read_plan(
    text: str | bytes,
    *,
    file: str = "<text>",
    limits: Limits = DEFAULT_LIMITS,
    from_response: bool = False,
) -> Parsed:
    """Read a plan or a behaviour tree; never raises on bad input, but says what is wrong with it.

    A behaviour tree is told by its outermost element, ``<root>``. With ``from_response`` the text
    is a language model's raw answer; its last tree is taken if there is no plan in it.

    >>> tree = '<root BTCPP_format="4"><BehaviorTree><Go/></BehaviorTree></root>'
    >>> [element.interface for element in read_plan(tree).plan.runners]
    ['Go']
    """
    decoded = read_source(text, limits).text
    span = None if decoded is None else _span(decoded, from_response)
    if decoded is None or span is None:
        return parse(text, file=file, limits=limits, from_response=from_response)
    return _trees(decoded, file, limits, span)


def holds_trees(text: str, *, from_response: bool = False) -> bool:
    """Whether ``read_plan`` takes the text for a behaviour tree."""
    return _span(text, from_response) is not None


def _span(text: str, from_response: bool) -> tuple[int, int] | None:
    """Where in a text behaviour trees stand; None if it is to be read as a plan."""
    if "<root" not in text and "<BehaviorTree" not in text:
        return None
    from gpsfsm.syntax.trees import cut_trees, is_trees  # noqa: PLC0415  (few texts are trees)

    if is_trees(text):
        return 0, len(text)
    return cut_trees(text) if from_response and "<Plan" not in text else None


def _trees(text: str, file: str, limits: Limits, span: tuple[int, int]) -> Parsed:
    from gpsfsm.compile.trees import unfold  # noqa: PLC0415  (few texts are trees)
    from gpsfsm.syntax.trees import read_trees  # noqa: PLC0415

    start, end = span
    before = "".join(each if each in "\r\n" else " " for each in text[:start])
    read = read_trees(before + text[start:end], file, limits)
    collector = read.collector
    notes: tuple[str, ...] = ()
    if end - start < len(text):
        first, last = collector.location(start).line, collector.location(end - 1).line
        lines = f"line {first}" if first == last else f"lines {first} to {last}"
        note = f"took {lines} of the answer as the tree; left out: the rest"
        hint = "nothing to do, if that is the tree you mean"
        collector.add(_EXTRACTED, start, len("<root"), message=note, hint=hint, element="/root")
        notes = (note,)
    unfolded = None if read.forest is None else unfold(read.forest)
    problems: tuple[Problem, ...] = collector.problems()
    plan, over = None, read.over
    if unfolded is not None:
        plan, over = unfolded.plan, over or unfolded.over
        problems = tuple(sorted((*problems, *unfolded.problems), key=_place))
    lost = any(problem.rule == _LOST for problem in problems)
    plan = None if lost else plan
    return Parsed(
        file,
        text,
        plan,
        problems,
        read.suppressions,
        (*notes, *collector.notes()),
        over_limit=over,
        trees=True,
        lost=lost,
    )


def _place(problem: Problem) -> tuple[int, int]:
    return problem.location.line, problem.location.column


@dataclass(frozen=True, slots=True, eq=False)
class EngineText:
    """What an original engine makes of a text.

    ``engine`` is the name of its profile. ``plan`` is None where ``result`` is no EnginePlan. For a
    rejection or a crash, (``line``, ``column``) is the place that it is about; else they are 1.
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
        found = connection.control if connection.control is not None else connection.source.element
        return None if found is None or self.places is None else self.places[found]


def read_connections(
    text: str | bytes, engine: str, *, file: str = "<text>", limits: Limits = DEFAULT_LIMITS
) -> EngineText:
    """Read and compile a plan as an original engine does, whether or not it is XML.

    Bytes are read as UTF-8 whatever they declare, as the engine does. Raises UsageError for an
    engine that is not known, and InputError for a text that is too large to be read.

    >>> reading = read_connections("Sure! <Plan><Runner interface='Go' provider='Go'/></Plan>",
    ...                           "fabric-v2")
    >>> [connection.source.interface for connection in reading.result.connections]
    ['Go', 'fabric_capabilities/FabricCompletionRunner']
    """
    from gpsfsm.compile.fabric import PROFILES, compile_document  # noqa: PLC0415  (few need it)
    from gpsfsm.model.engine import EngineDocument, EnginePlan  # noqa: PLC0415
    from gpsfsm.syntax.tinyxml import parse_document, plan_of, position  # noqa: PLC0415

    profile = PROFILES.get(engine)
    if profile is None:
        raise UsageError(f"there is no engine '{engine}'; there are {', '.join(PROFILES)}")
    if len(text) > limits.max_bytes:
        message = f"the text is longer than {limits.max_bytes:,} bytes; raise --max-bytes"
        raise InputError(f"{file}: {message}")
    given = text.decode("utf-8", "surrogateescape") if isinstance(text, bytes) else text
    try:
        document = parse_document(given, limits)
    except InputError as error:
        raise InputError(f"{file}: {error}") from error
    result = compile_document(document, profile)
    if isinstance(result, EnginePlan) and isinstance(document, EngineDocument):
        plan, places = plan_of(document, result.root, given, file)
        return EngineText(file, engine, result, plan, places=places)
    assert not isinstance(result, EnginePlan)
    line, column = position(given, result.offset)
    return EngineText(file, engine, result, None, line, column)
