"""Text → plan: the front end as one function."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING

from gpsfsm.model.finding import Problem, Related
from gpsfsm.model.plan import Location, Plan
from gpsfsm.syntax.chars import ILLEGAL
from gpsfsm.syntax.collector import Collector
from gpsfsm.syntax.limits import DEFAULT_LIMITS, Limits
from gpsfsm.syntax.lines import Lines
from gpsfsm.syntax.outline import OF_PLANS
from gpsfsm.syntax.response import extract_plan
from gpsfsm.syntax.scan import scan
from gpsfsm.syntax.source import Source, read_source
from gpsfsm.syntax.tree import TreeBuilder
from gpsfsm.syntax.wellformed import DEEPEST, well_formedness_fault

if TYPE_CHECKING:
    from gpsfsm.syntax.suppress import Suppression

__all__ = ["Parsed", "parse"]

_NOT_LINE_ENDS = re.compile(r"[^\r\n]")
_MAX_PLACES = 20
_MAX_CHARACTERS = 10_000  # beyond these the count is a lower bound

_TOLD_OF_FOREIGN = ("GP104", "GP116")


@dataclass(frozen=True, slots=True)
class Parsed:
    """What the front end knows of a text.

    ``text`` is the decoded text without a byte order mark ("" where it cannot be decoded).
    ``plan`` is None where the plan, and so every fact about it, cannot be known; ``problems`` are
    in text order; ``notes`` say what was done or left out; ``over_limit`` tells that a limit ended
    the reading. ``trees``: the text is a behaviour tree. ``lost``: it holds what no plan can
    express, so nothing about it is decided. ``body`` is what of an answer was taken, with blanks
    before it so that offsets stay; of any other text it is the text. ``foreign``: nothing in the
    text looks like a part of a plan. A path may have led to anything, so nobody is shown it.
    """

    file: str
    text: str
    plan: Plan | None
    problems: tuple[Problem, ...]
    suppressions: tuple[Suppression, ...] = ()
    notes: tuple[str, ...] = ()
    over_limit: bool = False
    trees: bool = False
    lost: bool = False
    body: str = ""
    foreign: bool = False


def parse(
    text: str | bytes,
    *,
    file: str = "<text>",
    limits: Limits = DEFAULT_LIMITS,
    from_response: bool = False,
) -> Parsed:
    """Read a plan; never raises on bad input, but says in ``problems`` what is wrong with it.

    With ``from_response`` the text is a language model's raw answer, and its last plan is taken.

    >>> parsed = parse('<Plan><Control type="parallel"/></Plan>')
    >>> [problem.rule for problem in parsed.problems]
    ['GP109', 'GP106']
    """
    source = read_source(text, limits)
    if source.text is None:
        problems = _source_problems(source)
        return Parsed(file, "", None, problems, over_limit=source.over)
    return _parse(source, source.text, file, limits, from_response=from_response)


def _source_problems(source: Source) -> tuple[Problem, ...]:
    if source.fault is None:
        return ()
    _, length, message, hint, rule = source.fault
    return (Problem(rule, message, Location(source.line, source.column), hint, length),)


def _parse(source: Source, text: str, file: str, limits: Limits, *, from_response: bool) -> Parsed:
    collector = Collector(Lines(text), limits.max_problems)
    cleaned = _without_illegal(text, collector)
    broken = cleaned is not text
    body = cleaned
    notes: tuple[str, ...] = ()
    if from_response:
        body, notes = _cut(cleaned, collector, limits)
    builder = TreeBuilder(body, file, limits, collector)
    plan = builder.build(scan(body, limits))
    unsure = not (broken or builder.broken or builder.over)
    if unsure and builder.deepest <= DEEPEST:
        _ask_authority(body, collector)
    problems = collector.problems()
    foreign = plan is None and not builder.over and not OF_PLANS.search(text)
    if foreign:  # what else is wrong with it concerns nobody, and tells what is in it
        problems = tuple(each for each in problems if each.rule in _TOLD_OF_FOREIGN) or problems
    if source.fault:
        problems = _source_problems(source) + problems
    return Parsed(
        file,
        text,
        plan,
        problems,
        tuple(builder.suppressions),
        (*notes, *collector.notes()),
        builder.over,
        body=body if notes else text,
        foreign=foreign,
    )


def _without_illegal(text: str, collector: Collector) -> str:
    """``text`` with a blank for each character that XML does not allow; reports these.

    Returns ``text`` itself if there is none.
    """
    if not ILLEGAL.search(text):
        return text
    counts: Counter[str] = Counter()
    places: dict[str, list[int]] = {}
    for match in islice(ILLEGAL.finditer(text), _MAX_CHARACTERS):
        character = match[0]
        counts[character] += 1
        found = places.setdefault(character, [])
        if len(found) < _MAX_PLACES:
            found.append(match.start())
    for character, offsets in places.items():
        number = ord(character)
        name = "U+0000 (NUL)" if number == 0 else f"U+{number:04X}"
        what = "control character" if number < 0x20 else "character"
        what = "half character" if 0xD800 <= number <= 0xDFFF else what
        least = "at least " if counts.total() == _MAX_CHARACTERS else ""
        times = f", {least}{counts[character]:,} times" if counts[character] > 1 else ""
        collector.add(
            "GP116",
            offsets[0],
            1,
            message=f"the {what} {name} stands in the text{times}; XML does not allow it",
            hint="remove it; if the text looks right, it was probably saved as UTF-16: use UTF-8",
            related=[Related(collector.location(offset)) for offset in offsets[1:]],
        )
    return ILLEGAL.sub(" ", text)


def _cut(text: str, collector: Collector, limits: Limits) -> tuple[str, tuple[str, ...]]:
    """The plan of a model's answer, with blanks instead of all that is before it."""
    extract = extract_plan(text, limits.max_markup)
    if extract is None or not extract.note:
        return text, ()
    collector.add(
        "GP115",
        extract.start,
        len("<Plan"),
        message=extract.note,
        hint="nothing to do, if that is the plan you mean",
        element="/Plan",
    )
    before = _NOT_LINE_ENDS.sub(" ", text[: extract.start])
    return before + text[extract.start : extract.end], (extract.note,)


def _ask_authority(text: str, collector: Collector) -> None:
    """Lxml decides; what it refuses and the scanner did not is reported in its words."""
    refused = well_formedness_fault(text)
    if refused is None:
        return
    line, column, (_, length, message, hint, rule) = refused
    offset = collector.lines.offset(line, column)
    collector.add(rule, offset, length, message=message, hint=hint)
