"""Text → plan: the front end as one function, and what can be read of a text without a plan."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import field
from itertools import islice
from typing import TYPE_CHECKING

from gpsfsm.errors import misused
from gpsfsm.late import collecting_rarely, dataclass, pattern
from gpsfsm.model.finding import Problem, Related
from gpsfsm.model.plan import Location, Plan
from gpsfsm.syntax.plain import read_plain
from gpsfsm.syntax.response import extract_plan
from gpsfsm.syntax.scan import scan
from gpsfsm.syntax.source import DEFAULT_LIMITS, Limits, Source, read_source
from gpsfsm.syntax.text import ILLEGAL, Lines, clip
from gpsfsm.syntax.token_reader import Collector
from gpsfsm.syntax.tokens import Fault
from gpsfsm.syntax.tree import OF_PLANS, TreeBuilder

if TYPE_CHECKING:
    from gpsfsm.model.plan import Plan
    from gpsfsm.model.precision import Approximation
    from gpsfsm.model.tree import Forest
    from gpsfsm.syntax.token_reader import Suppression

_NOT_LINE_ENDS = pattern(r"[^\r\n]")
_MAX_PLACES = 20
_MAX_CHARACTERS = 10_000  # beyond these the count is a lower bound
_OF_FOREIGN = ("GP104", "GP116")
DEEPEST = 2000
"""libxml2 reads no deeper (2,048); texts nested deeper are judged by the scanner alone."""

_PLACE = pattern(r", line \d+, column \d+.*", re.DOTALL)


@dataclass(frozen=True, slots=True)
class Parsed:
    """The result of parsing a text: a plan and its problems.

    - ``text``: the decoded text without a byte order mark; "" if it cannot be decoded.
    - ``plan``: None if the plan, and so every fact about it, cannot be determined.
    - ``problems``: in text order; ``notes``: what was done or left out.
    - ``over_limit``: a limit ended the parsing.
    - ``trees``, ``machine``: the text is a behaviour tree, or a machine.
    - ``lost``: the text contains something that no plan can express, so nothing about it is
      decided.
    - ``body``: the part of an answer that was used, preceded by blanks to keep offsets; otherwise
      the text.
    - ``foreign``: nothing in the text looks like a plan. It may be any file that a path led to, so
      it must not be displayed.
    - ``included``: the texts of included files, by name; ``forest``: all behaviour trees.
    - ``approximations``: the constructs that are not in the plan as they are in the text.
    """

    file: str
    text: str
    plan: Plan | None
    problems: tuple[Problem, ...]
    suppressions: tuple[Suppression, ...] = ()
    notes: tuple[str, ...] = ()
    over_limit: bool = False
    trees: bool = False
    machine: bool = False
    lost: bool = False
    body: str = ""
    foreign: bool = False
    included: Mapping[str, str] = field(default_factory=dict)
    forest: Forest | None = None
    approximations: tuple[Approximation, ...] = ()


def parse(
    text: str | bytes,
    *,
    file: str = "<text>",
    limits: Limits = DEFAULT_LIMITS,
    from_response: bool = False,
) -> Parsed:
    """Parse the text of a plan. Bad input does not raise: see ``problems`` of the result.

    ``file`` is the name to use in locations. With ``from_response`` the text is the raw answer of a
    language model, and its last plan is used.

    Raises UsageError if ``text`` is neither ``str`` nor ``bytes``.

    >>> parsed = parse('<Plan><Control type="parallel"/></Plan>')
    >>> [problem.rule for problem in parsed.problems]
    ['GP109', 'GP106']
    """
    if not isinstance(text, str | bytes):
        raise misused("parse", "the text of a plan", text, "gpsfsm.check reads files")
    if not isinstance(limits, Limits):
        raise misused("parse", "a gpsfsm.Limits as limits", limits)
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


@collecting_rarely()
def _parse(source: Source, text: str, file: str, limits: Limits, *, from_response: bool) -> Parsed:
    lines = Lines(text)
    plain = None if from_response else read_plain(lines.text, file, limits)
    if plain is not None:
        problems = _source_problems(source)
        return Parsed(file, text, plain.plan, problems, plain.suppressions, body=text)
    collector = Collector(lines, limits.max_problems)
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
        problems = tuple(each for each in problems if each.rule in _OF_FOREIGN) or problems
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
        offsets_here = places.setdefault(character, [])
        if len(offsets_here) < _MAX_PLACES:
            offsets_here.append(match.start())
    for character, offsets in places.items():
        number = ord(character)
        name = "U+0000 (NUL)" if number == 0 else f"U+{number:04X}"
        what = "control character" if number < 0x20 else "character"
        what = "surrogate" if 0xD800 <= number <= 0xDFFF else what
        least = "at least " if counts.total() == _MAX_CHARACTERS else ""
        times = f" {least}{counts[character]:,} times" if counts[character] > 1 else ""
        collector.add(
            "GP116",
            offsets[0],
            1,
            message=f"the text contains the {what} {name}{times}, which XML does not allow",
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
        hint="nothing to do if that is the plan you mean",
        element="/Plan",
    )
    before = _NOT_LINE_ENDS.sub(" ", text[: extract.start])
    return before + extract.of(text), (extract.note,)


def _ask_authority(text: str, collector: Collector) -> None:
    """Lxml decides; what it refuses and the scanner did not is reported in its words."""
    refused = well_formedness_fault(text)
    if refused is None:
        return
    line, column, (_, length, message, hint, rule) = refused
    offset = collector.lines.offset(line, column)
    collector.add(rule, offset, length, message=message, hint=hint)


def read_partially(text: str, file: str, limits: Limits) -> Plan | None:
    """The elements that the front end recognises, whatever is wrong; None if there are none.

    Nothing follows from them: what was not understood is left out. A control without a known type
    has the type None.

    >>> from gpsfsm.syntax import Limits
    >>> found = read_partially('<Plan><Control type="often"><Runner', "plan.xml", Limits())
    >>> [str(element.kind) for element in found.elements]
    ['Plan', 'Control', 'Runner']
    """
    builder = TreeBuilder(
        ILLEGAL.sub(" ", text), file, limits, Collector(Lines(text), limits.max_problems)
    )
    builder.build(scan(builder.text, limits))
    return builder.partial()


class _Ignore:
    """A parser target that keeps nothing: no tree is built, which is five times as fast."""

    def close(self) -> None:
        """End of the text."""


def well_formedness_fault(text: str) -> tuple[int, int, Fault] | None:
    """Line, column and error, or None if lxml accepts ``text``.

    The text must have no DOCTYPE; the parser expands, loads and fetches nothing in any case.
    """
    from lxml import etree

    # With a target lxml does not mind errors of namespaces; few texts have any.
    namespaces = "xmlns" in text or "xml:" in text
    parser = etree.XMLParser(
        encoding="utf-8",  # the text is decoded already, whatever its declaration says
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        dtd_validation=False,
        huge_tree=True,  # our own limits are the stricter ones
        target=None if namespaces else _Ignore(),  # type: ignore[arg-type]  # all are optional
    )
    try:
        etree.fromstring(text.encode("utf-8"), parser)
    except etree.XMLSyntaxError as error:
        return _fault(error.msg or "", error.lineno or 1, (error.offset or 0) + 1)
    # lxml forgets an error of namespaces over a warning that comes later; its log does not.
    for entry in parser.error_log:
        if entry.level >= etree.ErrorLevels.ERROR:
            return _fault(entry.message, entry.line, entry.column)
    return None


def _fault(message: str, line: int, column: int) -> tuple[int, int, Fault]:
    words = _PLACE.sub("", message) or "it breaks the rules of XML"
    message = f"the text is not well-formed XML: {clip(words, 200)}"
    return line, column, Fault(0, 0, message, "correct it as the message says")
