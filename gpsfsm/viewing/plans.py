"""One plan as a part of the view document."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import DEBUG_VARIABLE, is_out_of_memory
from gpsfsm.model.report import PlanReport, Report
from gpsfsm.viewing.elements import element_rows
from gpsfsm.viewing.findings import finding_row
from gpsfsm.viewing.grades import OF_TASKS, task_data
from gpsfsm.viewing.picture import automaton_data
from gpsfsm.viewing.reading import Seen, see
from gpsfsm.viewing.scenarios import Plays

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from typing import TypeVar

    from gpsfsm.checking import CheckOptions
    from gpsfsm.model.finding import Finding
    from gpsfsm.viewing.scenarios import Budget

    _Part = TypeVar("_Part")

__all__ = ["MOST_DEPTH", "MOST_ELEMENTS", "MOST_SOURCE", "Viewed", "plan_data", "seen_of"]

MOST_ELEMENTS = 50_000
"""A plan with more elements is no page: its findings and its text are shown."""
MOST_DEPTH = 1_000
"""Likewise one that is nested deeper: the paths of its elements would be as long as the page."""
MOST_SOURCE = 10_000_000
"""Code points of a text that are shown."""
_UNREAD = Seen(None, None, None, whole=False)


@dataclass(frozen=True, slots=True)
class Viewed:
    """A text that is to be seen, and what its check has found; ``text`` None: it was not read."""

    text: str | bytes | None
    report: PlanReport


def seen_of(viewed: Viewed, options: CheckOptions) -> Seen:
    """What is shown of a text; never raises for what is in it."""
    text = viewed.text
    if text is None:
        return _UNREAD
    notes: list[str] = []
    found = _or_note(lambda: see(text, viewed.report.path, options), _UNREAD, "plan", notes)
    if found is _UNREAD:
        return replace(_UNREAD, text=viewed.report.source, notes=tuple(notes))
    too_much = _too_much(found)
    if too_much:
        note = f"the plan has {too_much} and is not drawn"
        return replace(found, plan=None, compiled=None, whole=False, notes=(*found.notes, note))
    return found


def _too_much(seen: Seen) -> str:
    """What there is more of than a page can show; "" if there is nothing of the kind."""
    elements = () if seen.plan is None else seen.plan.elements
    if len(elements) > MOST_ELEMENTS:
        return f"more than {MOST_ELEMENTS:,} elements"
    depths: list[int] = []
    for element in elements:
        depths.append(depths[element.parent] + 1 if element.parent >= 0 else 0)
    deep = max(depths, default=0) > MOST_DEPTH
    return f"elements that are nested more than {MOST_DEPTH:,} deep" if deep else ""


def plan_data(viewed: Viewed, seen: Seen, options: CheckOptions, budget: Budget) -> dict[str, Any]:
    """Everything that the page shows of one plan; ``budget`` is what its plays may cost."""
    report = viewed.report
    notes = [*report.notes, *seen.notes]
    unreachable = frozenset(report.facts.unreachable if report.facts else ())
    plan, compiled = seen.plan, seen.compiled
    rows = [] if plan is None else element_rows(plan, seen.text or "", unreachable)
    picture = None
    if compiled is not None:
        picture = _or_note(lambda: automaton_data(compiled.automaton), None, "picture", notes)
    plays = None
    if compiled is not None and picture is not None:
        plays = Plays(compiled, budget, consistent=options.analysis.consistent)
    findings = _findings((*report.findings, *report.suppressed), rows, plays)
    task = None
    if options.task is not None:
        task = task_data(viewed.text, report.path, options.task, options, findings)
    return {
        "name": report.path,
        "verdict": report.verdict.value,
        "notes": notes,
        "source": None if seen.text is None else _clipped(seen.text, notes),
        "engine": seen.engine,
        "elements": rows,
        "automaton": picture,
        "facts": _facts(report),
        "findings": findings,
        "plays": [] if plays is None else plays.plays,
        "plays_left_out": 0 if plays is None else plays.left_out,
        "task": task,
    }


def _or_note(make: Callable[[], _Part], instead: _Part, what: str, notes: list[str]) -> _Part:
    """A part of the document; a defect of gpsfsm costs that part, and not the whole page."""
    try:
        return make()
    except Exception as error:
        if is_out_of_memory(error):
            notes.append(f"the {what} cannot be shown: the memory has run out")
            return instead
        if os.environ.get(DEBUG_VARIABLE):
            raise
        told = f"{type(error).__name__}: {error}"
        notes.append(f"the {what} cannot be shown ({told}); this is a defect of gpsfsm")
        return instead


def _findings(
    found: Sequence[Finding], rows: Sequence[dict[str, Any]], plays: Plays | None
) -> list[dict[str, Any]]:
    """All findings, those that something took out of the report at the end."""
    at = {row["path"]: index for index, row in enumerate(rows)}
    of_finding = [-1] * len(found)
    if plays is not None:
        for place in sorted(range(len(found)), key=lambda place: _rank(found[place])):
            of_finding[place] = plays.add(found[place])
    return [finding_row(each, at, play) for each, play in zip(found, of_finding, strict=True)]


def _rank(finding: Finding) -> tuple[bool, bool, int]:
    """Which findings are played first, where there is not room for all of them."""
    return (
        bool(finding.suppressed_by),
        not finding.rule.startswith(OF_TASKS),
        -finding.severity.rank,
    )


def _clipped(text: str, notes: list[str]) -> str:
    if len(text) <= MOST_SOURCE:
        return text
    notes.append(f"of the text the first {MOST_SOURCE:,} characters are shown")
    return text[:MOST_SOURCE]


def _facts(report: PlanReport) -> Any:
    """The facts as the JSON report has them."""
    from gpsfsm.report import render  # noqa: PLC0415

    alone = replace(report, findings=(), suppressed=())
    return json.loads(render(Report((alone,)), "json"))["plans"][0]["facts"]
