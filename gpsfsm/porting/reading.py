"""The text of a plan to port, fixed where that is safe."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.analysis.rules import all_rules, rule
from gpsfsm.checking import CheckOptions
from gpsfsm.checking.selection import Selection
from gpsfsm.compile.plan_text import read_plan
from gpsfsm.errors import GpsfsmError
from gpsfsm.fixing import fix_text
from gpsfsm.fixing.draft import pieces_of
from gpsfsm.model.finding import Severity
from gpsfsm.model.plan import Kind
from gpsfsm.porting.result import Note
from gpsfsm.syntax.text import ILLEGAL, Lines
from gpsfsm.syntax.tokens import StartTag

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.fixing.draft import Piece
    from gpsfsm.model.plan import Element, Plan
    from gpsfsm.syntax import Limits, Parsed

_CONTENT = "GP114"  # what is in a runner is read over, here as by the engines
_TAGS = frozenset(kind.value for kind in Kind)


class UnclearError(GpsfsmError):
    """The text has errors that gpsfsm cannot fix safely; ``parsed`` lists them."""

    def __init__(self, parsed: Parsed) -> None:
        super().__init__(
            f"{parsed.file}: the text has errors, so the plan is ambiguous; fix them "
            "first ('gpsfsm fix --unsafe-fixes' may help)"
        )
        self.parsed = parsed


@dataclass(frozen=True, eq=False)
class Source:
    """``original`` is the decoded input, ``text`` the same without errors."""

    original: str
    text: str
    plan: Plan
    tokens: tuple[Piece, ...]
    notes: tuple[Note, ...]
    places: Mapping[int, tuple[int, int]]

    def place(self, element: Element) -> tuple[int, int]:
        """Line and column of an element in the text as given."""
        return self.places.get(element.index, (element.line, element.column))


def read(data: bytes | str, file: str, limits: Limits, capabilities: Capabilities) -> Source:
    """Read a plan and fix its text. Raises UnclearError, or GpsfsmError for what is no plan."""
    parsed = read_plan(data, file=file, limits=limits)
    if parsed.trees:
        raise GpsfsmError(f"{file}: this is a behaviour tree; only plans can be ported")
    original = parsed.text
    notes: tuple[Note, ...] = ()
    if _faulty(parsed) and not parsed.over_limit:
        parsed, notes = _mended(data, parsed, limits, capabilities)
    if _faulty(parsed) or parsed.plan is None:
        raise UnclearError(parsed)
    plan, text = parsed.plan, parsed.text
    tokens = _tokens(text, limits)
    places = {} if text == original else _places(original, tokens, plan, limits)
    message = "the content of this runner is removed: the engines ignore it"
    held = {each.location.element for each in parsed.problems if each.rule == _CONTENT}
    for runner in plan.runners if held else ():
        if plan.path(runner) in held:
            at = places.get(runner.index, (runner.line, runner.column))
            notes += (Note(*at, message),)
    return Source(original, text, plan, tokens, notes, places)


def _faulty(parsed: Parsed) -> bool:
    return any(
        rule(problem.rule).severity is Severity.ERROR and problem.rule != _CONTENT
        for problem in parsed.problems
    )


def _mended(
    data: bytes | str, parsed: Parsed, limits: Limits, capabilities: Capabilities
) -> tuple[Parsed, tuple[Note, ...]]:
    """The text after the safe fixes of its syntax."""
    rules = frozenset(each.code for each in all_rules() if each.code.startswith("GP1"))
    options = CheckOptions(
        limits=limits, selection=Selection(rules), capabilities=capabilities, trees=False
    )
    fixed = fix_text(data, options, path=parsed.file)
    notes = tuple(
        Note(fix.line, 1, fix.title)
        for fix in sorted(fixed.applied, key=lambda fix: (fix.line, fix.rule, fix.title))
    )
    again = read_plan(fixed.text, file=parsed.file, limits=limits) if fixed.text else parsed
    return (parsed if _faulty(again) else again), notes


def _tokens(text: str, limits: Limits) -> tuple[Piece, ...]:
    return pieces_of(ILLEGAL.sub(" ", text), limits)


def _places(
    original: str, tokens: Sequence[Piece], plan: Plan, limits: Limits
) -> dict[int, tuple[int, int]]:
    """The places of the elements in the original, if it has the same tags; more may follow."""
    before, after = _starts(_tokens(original, limits)), _starts(tokens)
    if [tag.name for tag in before[: len(after)]] != [tag.name for tag in after]:
        return {}
    lines = Lines(original)
    positions = {
        now.start: lines.position(was.start) for was, now in zip(before, after, strict=False)
    }
    return {element.index: positions[element.start] for element in plan.elements}


def _starts(tokens: Iterable[Piece]) -> list[StartTag]:
    return [token for token in tokens if isinstance(token, StartTag) and token.name in _TAGS]
