"""Findings about the precision of a reading: GP816 and GP119, one for each file and kind."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.rules import rule
from gpsfsm.analysis.words import listed
from gpsfsm.compile.units import MachinePlan
from gpsfsm.model.finding import Related
from gpsfsm.model.plan import line_words
from gpsfsm.model.precision import Reading
from gpsfsm.model.printable import clip
from gpsfsm.streams import complain

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.model.finding import Finding
    from gpsfsm.model.plan import Plan
    from gpsfsm.model.precision import Approximation
    from gpsfsm.model.story import Terms

_MAX_GROUPS = 6
_MAX_LINES = 8
_MAX_NAME = 60
_MAX_RELATED = 100


def approximation_findings(
    approximations: Sequence[Approximation], terms: Terms
) -> Iterator[Finding]:
    """The findings that name the constructs that were not read exactly, at the first place."""
    over = [each for each in approximations if each.reading is Reading.OVER]
    if over:
        whole = terms.whole
        yield _finding("GP816", f"the automaton allows more than this {whole} can do: ", over)
    other = [each for each in approximations if each.reading is not Reading.OVER]
    if other:
        yield _finding("GP119", "", other)


def tell_over_approximated(what: str, *plans: Plan) -> None:
    """Tell on standard error what was read of machines that their files may not do."""
    for plan in plans:
        rows = plan.approximations if isinstance(plan, MachinePlan) else ()
        if over := [each for each in rows if each.reading is Reading.OVER]:
            complain(f"{clip(plan.file, 200)}: {what}: {_words(over)}")


def _finding(code: str, begin: str, rows: Sequence[Approximation]) -> Finding:
    first, *rest = rows
    return rule(code).finding(
        begin + _words(rows),
        first.location,
        related=tuple(
            Related(each.location, f"{clip(each.construct, _MAX_NAME)}: {each.cause.value}")
            for each in rest[:_MAX_RELATED]
        ),
    )


def _words(rows: Sequence[Approximation]) -> str:
    groups: dict[tuple[str, str, str], list[Approximation]] = {}
    for each in rows:
        groups.setdefault((each.reading.value, each.construct, each.cause.value), []).append(each)
    words = [
        f"{_reading(reading)}{clip(construct, _MAX_NAME)} at {_lines(places)} ({cause})"
        for (reading, construct, cause), places in groups.items()
    ]
    return listed(words, most=_MAX_GROUPS)


def _reading(reading: str) -> str:
    return "" if reading == Reading.OVER.value else f"{reading}: "


def _lines(places: Sequence[Approximation]) -> str:
    spots = dict.fromkeys((each.location.file, each.location.line) for each in places)
    words = [line_words(str(line), file) for file, line in spots]
    return f"line{'s' * (len(words) > 1)} {listed(words, most=_MAX_LINES)}"
