"""Sentences and source lines that several formats share: counts, summaries, places, excerpts."""

from __future__ import annotations

import unicodedata
from collections import Counter
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.analysis.rules import says_no_verdict
from gpsfsm.late import pattern
from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.plan import Location
from gpsfsm.model.printable import clip, printable
from gpsfsm.model.report import (
    By,
    Effect,
    Facts,
    Frequency,
    Interval,
    PlanReport,
    Precision,
    Proof,
    Report,
    SettingUsed,
    Verdict,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

MAX_MESSAGE = 2000
"""Messages, hints and element paths are clipped to this many code points where people read them."""
_SEVERITIES = {
    Severity.ERROR: ("error", "errors"),
    Severity.WARNING: ("warning", "warnings"),
    Severity.INFO: ("info", "infos"),
}
_REFUSED = ("GP701", "GP702")
"""The rules that say that an engine does not take a plan."""
_LINE_END = pattern(r"\r\n|\r|\n")
_MORE = "…"
_TAB = " " * 4
_CONTEXT = 3
"""A clipped line begins this part (one third) of its width before the place."""
_REACH = 8
"""So many times the room is looked at on both sides of the place."""
_KEPT = 12
"""Of a long value these characters are kept: twice as many at its beginning, as many at its end."""
_ATTRIBUTE = pattern(
    r"""(?<![\w.:-])(?P<name>[\w.:-]++)\s*+=\s*+(?P<quote>["'])(?P<value>(?:(?!(?P=quote)).)*+)["']"""
)


def count(number: int, one: str, several: str = "") -> str:
    """``1 plan``, ``3 plans``."""
    return f"{number} {one if number == 1 else several or one + 's'}"


def place(path: str, location: Location) -> str:
    """``file:line:column``, or the file and the element, if there is any, where there is no line.

    ``path`` is that of the plan; a place in a file that it includes is there.
    """
    shown = printable(location.file or path)
    if location.line > 0:
        return f"{shown}:{location.line}:{location.column}"
    return f"{shown}:{printable(location.element)}" if location.element else shown


def has_line(finding: Finding) -> bool:
    """True if a finding has a line to show.

    What kept gpsfsm from reading the input at all is said of its first character, for want of a
    better one. It is about the whole input.
    """
    whole_input = says_no_verdict(finding.rule) and finding.location == Location(1, 1)
    return finding.location.line > 0 and not whole_input


def has_place(finding: Finding) -> bool:
    """True if a finding has a line, or, as in a graph, an element without one."""
    return has_line(finding) or bool(not finding.location.line and finding.location.element)


def where(path: str, finding: Finding) -> str:
    """The place of a finding, or the file alone where it has none."""
    return place(path, finding.location) if has_place(finding) else printable(path)


def worst_first(findings: Iterable[Finding]) -> list[Finding]:
    """The findings for people: errors, warnings, infos, each in document order."""
    return sorted(findings, key=lambda finding: -finding.severity.rank)


PRECISION = ("GP816", "GP119")
"""The rules that tell what was not read exactly: reports that leave out infos tell it, too."""


def headline(path: str, finding: Finding) -> str:
    """Tell a finding in one line."""
    message = clip(finding.message, MAX_MESSAGE)
    location = where(path, finding)
    return f"{location}: {finding.severity.value} {finding.rule} {finding.name}: {message}"


def suppressed_line(path: str, finding: Finding) -> str:
    """Tell in one line a finding that a comment in the plan suppresses, and why it does."""
    message = clip(finding.message, MAX_MESSAGE)
    reason = clip(finding.justification, MAX_MESSAGE)
    what = f"{finding.severity.value} {finding.rule} {finding.name}"
    return f"{where(path, finding)}: suppressed {what}: {message} (comment: {reason})"


def setting_line(used: SettingUsed) -> str:
    """Tell what a setting takes away, where it stands, and how much that is."""
    setting = clip(used.setting, MAX_MESSAGE)
    what = f"{setting} in {printable(used.file)}" if used.file else setting
    if used.effect is Effect.NARROWS:
        return f"decided with {what}"
    number = count(used.findings, "finding")
    if used.errors:
        number += f" ({count(used.errors, 'error')})"
    if used.effect is Effect.HIDES:
        return f"{number} hidden by {what}"
    return f"{number} excused by {what}"


def summary(plan: PlanReport) -> str:
    """Tell what was decided about a plan, in one line without its path."""
    parts = [plan.verdict.value]
    if plan.facts is not None:
        parts += _facts(plan.facts)
        parts += _proof(plan.proof, plan.facts.precision)
    elif plan.verdict is Verdict.REJECTED:
        refused = any(finding.rule in _REFUSED for finding in plan.findings)
        what = "the engine does not run it" if refused else "the text could not be analysed"
        parts.append(what)
    if plan.suppressed:
        parts.append(count(len(plan.suppressed), "finding") + " suppressed")
    return "; ".join(parts)


def _proof(proof: Proof | None, precision: Mapping[str, Precision]) -> list[str]:
    """The procedures on which the facts rest, if there is anything to say of them."""
    if proof is None or not proof.decided_by:
        return []
    if not proof.unproved:
        return ["proved by z3, except for what may happen" if precision else "proved by z3"]
    procedures = set(proof.decided_by.values())
    only = "search only" if By.SEARCH in procedures else "structural pass only"
    of_what = f" for {', '.join(proof.unproved)}" if By.Z3 in procedures else ""
    return [f"not proved by z3{of_what}, {only}: {', '.join(proof.limits)}"]


def _facts(facts: Facts) -> list[str]:
    if facts.completes is Frequency.ALWAYS and facts.runners == len(facts.unreachable):
        # "always completes" would praise a plan that does nothing at all
        instances = count(facts.runners, "runner instance")
        on = f" (on {facts.engine.name})" if facts.engine is not None else ""
        return [f"{instances}, nothing runs: it completes at once{on}"]
    precision = facts.precision
    ends = [_how_often(facts.completes, "completes", precision.get("completes"))]
    if facts.engine is None:
        stuck = _how_often(facts.stuck, "stuck", precision.get("stuck"), clause="is stuck")
        ends += [_how_often(facts.gives_up, "gives up", precision.get("gives_up")), stuck]
        if facts.machine is not None:
            endless = facts.machine.endless
            ends.append(_how_often(endless, "runs for ever", precision.get("endless")))
    else:
        ends.append(_how_often(facts.engine.hangs, "hangs"))
        ends.append(_how_often(facts.engine.aborts, "aborts the engine"))
    parts = [count(facts.runners, "runner instance"), ", ".join(ends)]
    if facts.engine is not None:
        parts[-1] += f" (on {facts.engine.name})"
    if facts.machine is not None and facts.machine.completes_if_fair is not facts.completes:
        parts.append(f"{facts.machine.completes_if_fair.value} completes if outcomes are fair")
    if facts.fewest_failures_to_give_up is not None:
        number: int | str = facts.fewest_failures_to_give_up
        if precision.get("fewest_failures_to_give_up") is Precision.AT_LEAST:
            number = f"at least {number}"
        parts.append(f"fewest failures to give up: {number}")
    if facts.makespan is not None and (facts.makespan.min or facts.makespan.max is not None):
        parts.append(f"takes {_interval(facts.makespan, 's')}")
    if facts.energy is not None:
        parts.append(f"energy: {_interval(facts.energy, 'J')}")
    return parts


_MAY = {
    "completes": "may complete",
    "gives up": "may give up",
    "stuck": "may get stuck",
    "runs for ever": "may run for ever",
}


def _how_often(
    frequency: Frequency, end: str, precision: Precision | None = None, *, clause: str = ""
) -> str:
    """``always completes``, ``may complete``, ``unknown whether it completes``."""
    if frequency is Frequency.UNKNOWN:
        return f"unknown whether it {clause or end}"
    if precision is Precision.MAY:
        return _MAY[end]
    also = " or always" if precision is Precision.CAN else ""
    return f"{frequency.value}{also} {end}"


def _interval(interval: Interval, unit: str) -> str:
    """``3 s to 20 s``, ``at least 3 s``, ``3 s``."""
    least = f"{interval.min:.6g} {unit}"
    if interval.max is None:
        return f"at least {least}"
    return least if interval.min == interval.max else f"{least} to {interval.max:.6g} {unit}"


def verdict_counts(verdicts: Iterable[Verdict]) -> str:
    """``3 accepted, 1 undecided``."""
    counts = Counter(verdicts)
    return ", ".join(f"{counts[each]} {each.value}" for each in Verdict if counts[each])


def totals(report: Report) -> str:
    """Count all plans and findings, in one line."""
    if not report.plans:
        return "no plan was checked"
    plans = verdict_counts(plan.verdict for plan in report.plans)
    severities = Counter(finding.severity for plan in report.plans for finding in plan.findings)
    findings = ", ".join(
        count(severities[severity], *words)
        for severity, words in _SEVERITIES.items()
        if severities[severity]
    )
    checked = count(len(report.plans), "plan")
    return f"{checked}: {plans}; {findings or 'no findings'}{excused_words(report)}"


def excused_words(report: Report) -> str:
    """Count what comments in the plans suppress; "" if that is nothing."""
    excused = len(report.excused)
    return f", {count(excused, 'finding')} suppressed by comments" if excused else ""


class Excerpt(NamedTuple):
    """A source line as it is shown; ``offset`` columns before ``carets`` columns of carets."""

    text: str
    offset: int
    carets: int


def split_lines(source: str) -> list[str]:
    r"""Split a plan text as locations count lines: ended by ``\n``, ``\r\n`` or ``\r``."""
    return _LINE_END.split(source)


# What fits is shown as it stands. Else the line loses what is the same in most lines of a plan, one
# kind after the other until it fits: the indentation, a provider named as its interface, the
# packages in these names, the middle of long values, any provider. Last, both ends are cut off.
#
#     <Runner interface="nav2_capabilities/WaypointRunner" provider="nav2_capabilities/Waypoin…
#     <Runner interface="nav2_capabilities/WaypointRunner" … x="1.0" y="2.0"/>
#     <Runner interface="…/WaypointRunner" … x="1.0" y="2.0"/>
#
# The part that the carets mark is never shortened, so that they stand below the very text.


class _Cut(NamedTuple):
    """A part of a line that is left out, and what stands there instead."""

    start: int
    stop: int
    instead: str


class _Cell(NamedTuple):
    """The text shown for the line from ``start`` on, and its width in columns."""

    start: int
    shown: str
    columns: int


def excerpt(line: str, column: int, *, length: int, limit: int) -> Excerpt:
    """Show the part of ``line`` around ``column`` (from 1) that fits into ``limit`` columns.

    A place behind the end of the line gets its caret there.
    """
    at = min(max(column - 1, 0), len(line))
    end = min(at + max(length, 1), len(line))
    # A hostile line may be megabytes long: look only at what could possibly be shown.
    low, high = max(0, at - _REACH * limit), min(len(line), at + _REACH * limit)
    whole = low == 0 and high == len(line)
    cuts: list[_Cut] = []
    for kind in _KINDS_OF_CUTS:
        if whole and _fits(_cells(line, low, high, cuts), limit):
            break
        cuts += (cut for cut in kind(line, low, high) if cut.stop <= at or cut.start >= end)
    cells = _cells(line, low, high, cuts)
    before = sum(cell.start < at for cell in cells)
    first, last = 0, len(cells)
    if not (whole and _fits(cells, limit)):
        first, last = _window([cell.columns for cell in cells], before, limit, begins=low == 0)
    left = _MORE if low > 0 or first > 0 else ""
    right = _MORE if high < len(line) or last < len(cells) else ""
    text = left + "".join(cell.shown for cell in cells[first:last]) + right
    carets = _columns([cell for cell in cells[before:last] if cell.start < end])
    return Excerpt(text.rstrip(), len(left) + _columns(cells[first:before]), max(carets, 1))


def _cells(line: str, low: int, high: int, cuts: list[_Cut]) -> list[_Cell]:
    cells: list[_Cell] = []
    place = low
    for start, stop, instead in [*sorted(cuts), _Cut(high, high, "")]:
        if start < place:  # inside of an earlier one
            continue
        cells += (_Cell(each, *_cell(line[each])) for each in range(place, start))
        if instead:
            cells.append(_Cell(start, instead, len(instead)))
        place = stop
    return cells


def _columns(cells: list[_Cell]) -> int:
    return sum(cell.columns for cell in cells)


def _fits(cells: list[_Cell], limit: int) -> bool:
    return len(cells) <= 2 * limit and _columns(cells) <= limit


def _indentation(line: str, low: int, high: int) -> Iterator[_Cut]:
    if low == 0:
        yield _Cut(0, len(line[:high]) - len(line[:high].lstrip(" \t")), "")


def _repeated_provider(line: str, low: int, high: int) -> Iterator[_Cut]:
    interface = ""
    for match in _ATTRIBUTE.finditer(line, low, high):
        if match["name"] == "interface":
            interface = match["value"]
        elif match["name"] == "provider" and match["value"] == interface:
            yield _Cut(match.start(), match.end(), _MORE)


def _packages(line: str, low: int, high: int) -> Iterator[_Cut]:
    for match in _ATTRIBUTE.finditer(line, low, high):
        package = match["value"].rpartition("/")[0]
        if match["name"] in ("interface", "provider") and package:
            start = match.start("value")
            yield _Cut(start, start + len(package), _MORE)


def _long_values(line: str, low: int, high: int) -> Iterator[_Cut]:
    for match in _ATTRIBUTE.finditer(line, low, high):
        if match["name"] not in ("interface", "provider") and len(match["value"]) > 3 * _KEPT:
            yield _Cut(match.start("value") + 2 * _KEPT, match.end("value") - _KEPT, _MORE)


def _provider(line: str, low: int, high: int) -> Iterator[_Cut]:
    for match in _ATTRIBUTE.finditer(line, low, high):
        if match["name"] == "provider":
            yield _Cut(match.start(), match.end(), _MORE)


_KINDS_OF_CUTS = (_indentation, _repeated_provider, _packages, _long_values, _provider)


def _window(widths: list[int], at: int, limit: int, *, begins: bool) -> tuple[int, int]:
    """Choose the cells to show: some before ``at`` and what follows.

    ``begins``: the first cell is that of the beginning of the line. A character takes at least one
    column or belongs to one that does; more than ``limit`` combining ones are cut off.
    """
    room = limit - 2 * len(_MORE)
    first, used = at, 0
    enough = room if begins and sum(widths[: at + 1]) <= room // 2 else room // _CONTEXT
    while first > max(0, at - limit) and used + widths[first - 1] <= enough:
        first -= 1
        used += widths[first]
    last = at
    while last < min(len(widths), at + limit) and used + widths[last] <= room:
        used += widths[last]
        last += 1
    return first, last


@lru_cache(maxsize=1024)
def _cell(character: str) -> tuple[str, int]:
    """One character of a source line as it is shown, and the columns that it takes."""
    if character == "\t":
        return _TAB, len(_TAB)
    shown = printable(character)
    if len(shown) > 1:
        return shown, len(shown)
    if character in "\u200c\u200d" or unicodedata.category(character) in ("Mn", "Me"):
        return shown, 0
    return shown, 2 if unicodedata.east_asian_width(character) in ("W", "F") else 1
