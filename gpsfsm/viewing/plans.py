"""One plan as a part of the view document: elements, automaton, findings, plays and grade.

First the part of its text that is shown, then the whole, findings, the grade against a task,
elements, and the lines that they end on.
"""

from __future__ import annotations

import json
import os
from bisect import bisect_right
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.constraints import constraints_under
from gpsfsm.capabilities.library import bind
from gpsfsm.compile import Compiled, MachinePlan, TreePlan, compile_plan
from gpsfsm.compile.plan_text import holds_trees, read_plan_or_machine
from gpsfsm.compile.units import TreeMachine
from gpsfsm.errors import DEBUG_VARIABLE, InputError, is_out_of_memory
from gpsfsm.model.capability import CHOICE, TICK
from gpsfsm.model.labels import is_machine, parameters_label
from gpsfsm.model.plan import Element, Kind, Plan
from gpsfsm.model.printable import clip
from gpsfsm.model.report import PlanReport, Report
from gpsfsm.model.story import PAPER_ENGINE, Vocabulary
from gpsfsm.syntax.frontend import read_partially
from gpsfsm.viewing.picture import automaton_data, never_emitted
from gpsfsm.viewing.plays import Plays

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping, Sequence
    from typing import TypeVar

    from gpsfsm.checking import CheckOptions
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.plan import Location
    from gpsfsm.model.tree import TreeNode
    from gpsfsm.syntax import Parsed
    from gpsfsm.tasks.task import Task
    from gpsfsm.viewing.plays import Budget

    _Part = TypeVar("_Part")

MOST_ELEMENTS = 50_000
"""A plan with more elements is no page: its findings and its text are shown."""
MOST_DEPTH = 1_000
"""Likewise one that is nested deeper: the paths of its elements would be as long as the page."""
MOST_SOURCE = 10_000_000
"""Code points of a text that are shown."""
_MAX_NAME = 120
_MAX_DETAIL = 160
_MAX_VALUE = 80
_MAX_PARAMETERS = 8
_MOST_TEXT = 2_000
OF_TASKS = "GP6"
"""How the codes of rules begin that tell where a plan leaves its task."""
_PARTIAL = (
    "the text is not a plan: the picture shows only the part that could be read, and proves nothing"
)
_FOREIGN = "nothing in this text looks like part of a plan, so it is not shown"
_BY_THE_PAPER = "the picture shows the plan as in the paper"


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """The part of a text that is shown; ``text`` is None for one that nobody is shown.

    ``plan`` is None where no element was recognised; ``compiled`` is None where there is nothing
    to run. ``engine`` is the engine whose automaton that is. ``whole``: it is the plan, and not
    what remains of a text with errors.
    """

    text: str | None
    plan: Plan | None
    compiled: Compiled | None
    engine: str = PAPER_ENGINE
    whole: bool = True
    notes: tuple[str, ...] = ()


def see(text: str | bytes, path: str, options: CheckOptions) -> Seen:
    """Read a text as the options say; never raises for what is in it."""
    parsed = read_plan_or_machine(
        text, file=path, limits=options.limits, from_response=options.from_response
    )
    if parsed.machine:
        plan = parsed.plan
        compiled = None if plan is None else _compiled(plan, options)
        return Seen(parsed.text, plan, compiled, whole=plan is not None)
    if parsed.foreign and parsed.text:  # the path may be a link to anything
        return Seen(None, None, None, whole=False, notes=(_FOREIGN,))
    refused: tuple[str, ...] = ()
    if options.engine != PAPER_ENGINE:
        on_engine = None if parsed.over_limit else _on_engine(text, path, parsed, options)
        if on_engine is not None:
            return on_engine
        refused = (f"{options.engine} makes no plan of this text: {_BY_THE_PAPER}",)
    if parsed.plan is not None:
        return Seen(parsed.text, parsed.plan, _compiled(parsed.plan, options), notes=refused)
    remains = _remains(parsed, path, options)
    return replace(remains, notes=(*refused, *remains.notes))


def _on_engine(text: str | bytes, path: str, parsed: Parsed, options: CheckOptions) -> Seen | None:
    """The plan as the engine sees it; None if it does not take the text."""
    from gpsfsm.compile.engine_text import EngineReading, read_for_engine

    source = parsed.body if options.from_response and parsed.body else text
    library = options.described.library
    try:
        reading = read_for_engine(source, options.engine, path, library, options.limits)
    except InputError:  # the check has reported that
        return None
    if not isinstance(reading, EngineReading):
        return None
    return Seen(parsed.text, reading.plan, reading.compiled, options.engine)


def _compiled(plan: Plan, options: CheckOptions) -> Compiled:
    bindings = None if isinstance(plan, TreePlan) else bind(plan, options.described.library)
    return compile_plan(plan, start_chain="no-start" in options.analysis.faults, bindings=bindings)


def _remains(parsed: Parsed, path: str, options: CheckOptions) -> Seen:
    """As much as can be shown of a text that holds no plan."""
    if not parsed.text:
        return Seen("", None, None, whole=False)
    if parsed.trees or holds_trees(parsed.text):
        plan: Plan | None = _tree_elements(parsed, path, options)
        return Seen(parsed.text, plan, None, whole=False)
    plan = read_partially(parsed.body or parsed.text, path, options.limits)
    if plan is None or len(plan.elements) == 1:
        return Seen(parsed.text, plan, None, whole=False)
    if any(each.kind is Kind.CONTROL and each.control_type is None for each in plan.elements):
        return Seen(parsed.text, plan, None, whole=False)
    return Seen(parsed.text, plan, _compiled(plan, options), whole=False, notes=(_PARTIAL,))


def _tree_elements(parsed: Parsed, path: str, options: CheckOptions) -> Plan | None:
    """The nodes of behaviour trees that cannot be unfolded, as they are written."""
    from gpsfsm.syntax.trees import read_trees

    forest = read_trees(parsed.text, path, options.limits).forest
    if forest is None or not forest.nodes:
        return None
    return TreePlan(
        path,
        tuple(_tree_element(node) for node in forest.nodes),
        paths=tuple(node.path for node in forest.nodes),
    )


def _tree_element(node: TreeNode) -> Element:
    kind = Kind.CONTROL if node.children else Kind.RUNNER
    return Element(
        index=node.index,
        kind=Kind.PLAN if node.parent < 0 else kind,
        parent=node.parent,
        ordinal=1,
        children=tuple(node.children),
        attributes=node.attributes,
        line=node.line,
        column=node.column,
        start=node.start,
        end=node.end,
        tag=node.tag,
    )


_UNREAD = Seen(None, None, None, whole=False)


@dataclass(frozen=True, slots=True)
class Viewed:
    """A text that is to be seen, and what its check has found; ``text`` None: it was not read."""

    text: str | bytes | None
    report: PlanReport


def seen_of(viewed: Viewed, options: CheckOptions) -> Seen:
    """The part of a text that is shown; never raises for what is in it."""
    text = viewed.text
    if text is None:
        return _UNREAD
    notes: list[str] = []
    seen = _or_note(lambda: see(text, viewed.report.path, options), _UNREAD, "plan", notes)
    if seen is _UNREAD:
        return replace(_UNREAD, text=viewed.report.source, notes=tuple(notes))
    too_much = _too_much(seen)
    if too_much:
        note = f"the plan has {too_much} and is not drawn"
        return replace(seen, plan=None, compiled=None, whole=False, notes=(*seen.notes, note))
    return seen


def _too_much(seen: Seen) -> str:
    """The part of a plan that is too large for a page; "" if there is none."""
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
    places: Sequence[int] = ()
    if isinstance(plan, MachinePlan):
        rows = _machine_rows(plan, rows)
    if isinstance(plan, TreeMachine):
        nest = partial(_nested_rows, rows, seen.text or "", report.path, options)
        rows, places = _or_note(nest, (rows, places), "tree", notes)
    picture = None
    if compiled is not None:
        picture = _or_note(partial(_drawn, seen, compiled, options), None, "picture", notes)
    for node in picture["nodes"] if picture is not None and places else ():
        if node["element"] >= 0:
            node["element"] = places[node["element"]]
    plays = None
    if compiled is not None and picture is not None:
        plays = Plays(compiled, budget, consistent=options.analysis.consistent)
    worst_first = sorted(report.findings, key=lambda each: -each.severity.rank)
    findings = _findings((*worst_first, *report.suppressed), rows, plays)
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


def _drawn(seen: Seen, compiled: Compiled, options: CheckOptions) -> dict[str, Any]:
    """The automaton, without the signals that it never emits under the options of the check."""
    automaton = compiled.automaton
    if not seen.whole or not automaton.traits.gives_up or is_machine(automaton):
        return automaton_data(automaton, frozenset())
    allowed = constraints_under(options.analysis, compiled).allowed
    return automaton_data(automaton, never_emitted(automaton, allowed))


def _or_note(make: Callable[[], _Part], instead: _Part, what: str, notes: list[str]) -> _Part:
    """A part of the document; a defect of gpsfsm costs that part, and not the whole page."""
    try:
        return make()
    except Exception as error:
        if is_out_of_memory(error):
            notes.append(f"the {what} cannot be shown: memory ran out")
            return instead
        if os.environ.get(DEBUG_VARIABLE):
            raise
        defect = f"{type(error).__name__}: {error}"
        notes.append(f"the {what} cannot be shown ({defect}); this is a defect of gpsfsm")
        return instead


def _clipped(text: str, notes: list[str]) -> str:
    if len(text) <= MOST_SOURCE:
        return text
    notes.append(f"only the first {MOST_SOURCE:,} characters of the text are shown")
    return text[:MOST_SOURCE]


def _facts(report: PlanReport) -> Any:
    """The facts as the JSON report has them."""
    from gpsfsm.report import render

    alone = replace(report, findings=(), suppressed=())
    return json.loads(render(Report((alone,)), "json"))["plans"][0]["facts"]


def _findings(
    findings: Sequence[Finding], rows: Sequence[dict[str, Any]], plays: Plays | None
) -> list[dict[str, Any]]:
    """All findings, those that something took out of the report at the end."""
    at = {row["path"]: index for index, row in enumerate(rows)}
    of_finding = [-1] * len(findings)
    if plays is not None:
        for place in sorted(range(len(findings)), key=lambda place: _rank(findings[place])):
            of_finding[place] = plays.add(findings[place])
    return [finding_row(each, at, play) for each, play in zip(findings, of_finding, strict=True)]


def _rank(finding: Finding) -> tuple[bool, bool, int]:
    """The order in which findings are played, where there is not room for all of them."""
    return (
        bool(finding.suppressed_by),
        not finding.rule.startswith(OF_TASKS),
        -finding.severity.rank,
    )


def finding_row(finding: Finding, elements: Mapping[str, int], play: int) -> dict[str, Any]:
    """A finding; ``elements`` are the rows by element path, ``play`` is that of its scenario."""
    place = finding.location
    if place.file:  # the text of the page is another
        message = f"{place.file}:{place.line}:{place.column}: {finding.message}"
        finding = replace(finding, message=message, length=0, related=())
        place = replace(place, line=0, column=0)
    return {
        "rule": finding.rule,
        "severity": finding.severity.value,
        "message": finding.message,
        "hint": finding.hint,
        "line": place.line,
        "column": place.column,
        "length": finding.length,
        "element": _element(place, elements),
        "related": [
            {
                "element": _element(other.location, elements),
                "line": other.location.line,
                "column": other.location.column,
                "message": other.message,
            }
            for other in finding.related
        ],
        "confidence": finding.confidence.value,
        "suppressed": finding.suppressed_by,
        "justification": finding.justification,
        "play": play,
        "ends": "" if finding.scenario is None else finding.scenario.ends.value,
        "story": [] if finding.scenario is None or play >= 0 else list(finding.scenario.story),
    }


def _element(place: Location, elements: Mapping[str, int]) -> int:
    """The row of an element; of one that is not there, the nearest one around it."""
    path = place.element
    while path:
        if path in elements:
            return elements[path]
        path = path.rpartition("/")[0]
    return -1


def rules_of(codes: set[str]) -> dict[str, dict[str, str]]:
    """Summaries and reasons of the rules with these codes."""
    from gpsfsm.analysis.rules import rule

    return {
        code: {"name": rule(code).name, "summary": rule(code).summary, "why": rule(code).why}
        for code in sorted(codes)
    }


def task_data(
    text: str | bytes | None,
    path: str,
    task: Task,
    options: CheckOptions,
    findings: Sequence[dict[str, Any]],
) -> dict[str, Any]:
    """The grade of a plan against a task; ``findings`` are the rows of its findings."""
    from gpsfsm.grading.grader import Grader, graded_options

    left = next((row for row in findings if row["rule"].startswith(OF_TASKS)), None)
    grade, words = "undecided", ["the text was not read"]
    if text is not None:
        graded = Grader(task, graded_options(options)).grade(text, path)
        grade, words = graded.grade.value, [graded.reason]
    return {
        "name": task.file,
        "text": clip(" ".join(task.text.split()), _MOST_TEXT),
        "grade": grade,
        "words": words,
        "element": -1 if left is None else left["element"],
        "line": 0 if left is None else left["line"],
        "play": -1 if left is None else left["play"],
    }


def element_rows(plan: Plan, text: str, unreachable: Collection[str]) -> list[dict[str, Any]]:
    """One row per element; ``unreachable`` are the element paths of runners that never run."""
    paths = [plan.path(element) for element in plan.elements]
    reached = _reached(plan.elements, [path not in unreachable for path in paths])
    ends = last_lines(plan.elements, text)
    return [
        _row(element, path, end, reached=reachable)
        for element, path, end, reachable in zip(plan.elements, paths, ends, reached, strict=True)
    ]


def _machine_rows(plan: MachinePlan, rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The rows of a machine: without the ends that nobody has written, which come last.

    All nodes have names; those of runners are attributes of theirs already.
    """
    tree = plan.vocabulary is Vocabulary.TREE
    rows[0]["label"] = plan.vocabulary.terms.whole
    for row, node in zip(rows[1:], plan.nodes, strict=True):
        name = plan.path(node.origin).rpartition("/")[2]
        if not tree:  # whose nodes have the names of the file, or none
            row["name"] = "" if name == row["label"] else clip(name, _MAX_NAME)
    while plan.elements[len(rows) - 1].end == 0 and len(rows) > 1:
        rows.pop()
    return rows


def _nested_rows(
    rows: list[dict[str, Any]], text: str, path: str, options: CheckOptions
) -> tuple[list[dict[str, Any]], Sequence[int]]:
    """The rows of a tree's machine below those of the nodes around its leaves.

    Also the new place of each row. A machine has a row for each use of a leaf:

        tree, Look, Look@2, Go → tree, Sequence (Fallback (Look, Look@2), Go)
    """
    from gpsfsm.syntax.trees import read_trees

    forest = read_trees(text, path, options.limits).forest
    if forest is None:
        return rows, range(len(rows))
    places = [0] * len(rows)
    uses: dict[str, list[int]] = {}
    ends = f"{rows[0]['path']}@"  # which come last
    for place, row in enumerate(rows[1:], 1):
        path = row["path"]
        path = path if path.startswith(ends) else path.partition("@")[0]
        uses.setdefault(path, []).append(place)
    nested, at = [rows[0]], {rows[0]["path"]: 0}

    def put(path: str, parent: int) -> None:
        for place in uses.pop(path, ()):
            places[place] = len(nested)
            nested.append(rows[place] | {"parent": parent})

    put(rows[0]["path"], 0)
    for node in forest.nodes:
        above = at.get(forest.nodes[node.parent].path, -1) if node.parent >= 0 else -1
        if node.children and (above >= 0 or node.tag == "BehaviorTree") and node.path not in at:
            row = _row(_tree_element(node), node.path, node.line, reached=True)
            name = clip(node.text("name") or node.text("ID") or "", _MAX_NAME)
            at[node.path] = len(nested)
            nested.append(row | {"kind": "control", "name": name, "parent": max(above, 0)})
        put(node.path, at.get(node.path, max(above, 0)))
    for path in list(uses):
        put(path, 0)
    return nested, places


def _reached(elements: Sequence[Element], runs: list[bool]) -> list[bool]:
    """Reachability per element; a control is reachable if any runner in it runs, or it has none."""
    holds_runner = [element.kind is Kind.RUNNER for element in elements]
    reached = [holds and run for holds, run in zip(holds_runner, runs, strict=True)]
    for element in reversed(elements):
        if element.parent >= 0:
            reached[element.parent] |= reached[element.index]
            holds_runner[element.parent] |= holds_runner[element.index]
    return [reachable or not holds for reachable, holds in zip(reached, holds_runner, strict=True)]


_OWN = {CHOICE: "choice", TICK: "tick"}


def _row(element: Element, path: str, end: int, *, reached: bool) -> dict[str, Any]:
    runner = element.kind is Kind.RUNNER
    return {
        "path": path,
        "kind": element.kind.value.lower(),
        "type": _OWN.get(element.interface, element.tag) if runner else element.words,
        "label": _label(element),
        "name": clip(element.text("name") or "", _MAX_NAME),
        "detail": _detail(element) if runner else "",
        "line": element.line,
        "column": element.column,
        "endLine": end,
        "parent": element.parent,
        "reachable": reached,
    }


def _label(element: Element) -> str:
    if element.interface in _OWN:
        return _OWN[element.interface]
    if element.kind is Kind.RUNNER:
        name = element.interface.rpartition("/")[2] or element.interface
        if element.tag and not name:  # a node of a tree that could not be unfolded
            name = element.text("ID") or element.tag
        return clip(name, _MAX_NAME) or "(no interface)"
    if element.kind is Kind.PLAN:
        return clip(element.tag, _MAX_NAME) or "plan"
    return clip(element.words, _MAX_NAME) or "control"


def _detail(element: Element) -> str:
    """The runner's parameters, as they are written; of a choice, what is chosen."""
    if element.interface == CHOICE:
        return clip(element.text("of") or "", _MAX_DETAIL)
    return clip(", ".join(parameters_label(element, _MAX_VALUE, _MAX_PARAMETERS)), _MAX_DETAIL)


def line_starts(text: str) -> list[int]:
    r"""The offsets at which the lines of a text begin; lines end at a line feed only.

    >>> line_starts("a\nb")
    [0, 2]
    """
    starts = [0]
    at = text.find("\n")
    while at >= 0:
        starts.append(at + 1)
        at = text.find("\n", at + 1)
    return starts


def last_lines(elements: Sequence[Element], text: str) -> list[int]:
    """Per element the line on which it ends; linear in the text.

    Elements of behaviour trees may stand anywhere in the text, so that of theirs nothing but the
    start tag is known: that is where they end.
    """
    starts = line_starts(text)
    ends = [element.end for element in elements]
    if not any(element.tag for element in elements):
        _close(elements, text, ends)
    return [
        max(element.line, bisect_right(starts, max(end - 1, 0)))
        for element, end in zip(elements, ends, strict=True)
    ]


def _close(elements: Sequence[Element], text: str, ends: list[int]) -> None:
    """From the last element to the first: behind the last child follows the end tag."""
    nothing_from = len(text)  # no end tag is at or behind this offset
    for element in reversed(elements):
        if text[element.end - 2 : element.end] == "/>":
            continue
        at = ends[element.children[-1]] if element.children else element.end
        at = max(at, element.end)
        if at >= nothing_from:
            continue
        end = _end_tag(text, at)
        if end < 0:
            nothing_from = at
            continue
        ends[element.index] = end


def _end_tag(text: str, at: int) -> int:
    """The offset behind the next end tag that is in no comment; -1 if there is none."""
    while True:
        tag = text.find("</", at)
        if tag < 0:
            return -1
        comment = text.find("<!--", at, tag)
        if comment < 0:
            close = text.find(">", tag)
            return len(text) if close < 0 else close + 1
        at = text.find("-->", comment + 4)
        if at < 0:
            return -1
