"""Mutation: the checks of a plan are scored by the changes of it that they notice.

The operators of plans and trees are in ``operators``. A mutant of a machine is the machine, written
as JSON, with one connection or one need changed:

    drop      leaves out a connection
    event     SUCCEEDED in the place of FAILED, and the other way round
    action    stops what was triggered, triggers what was stopped
    need      a join that needs one input more, or one less

What is no machine any more, such as one with a cycle of events at one instant, is no mutant.
"""

from __future__ import annotations

import json
import re
import time
from collections import Counter, deque
from dataclasses import dataclass, field
from enum import StrEnum
from functools import partial
from itertools import takewhile
from math import isfinite
from typing import TYPE_CHECKING, Any, TypeAlias

from gpsfsm.analysis.assumptions import parse_assumption
from gpsfsm.analysis.assumptions.parser import Claim, LineSelector, PathSelector
from gpsfsm.checking import check_text
from gpsfsm.compile import MachinePlan
from gpsfsm.compile.machines import written
from gpsfsm.compile.plan_text import machine_in
from gpsfsm.compile.units import TreePlan
from gpsfsm.equivalence import compare
from gpsfsm.errors import GpsfsmError, InternalError, UsageError
from gpsfsm.execution.runner import seeded
from gpsfsm.fuzzing.operators import Mutation, Tree, operators
from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.printable import clip, printable
from gpsfsm.model.report import Verdict
from gpsfsm.syntax import parse
from gpsfsm.workers import engine_of, map_items

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from gpsfsm.checking import CheckOptions
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.plan import Plan
    from gpsfsm.model.report import PlanReport


DEFAULT_MUTANTS = 1_000
_Tried: TypeAlias = "tuple[Notice, tuple[str, ...]]"
_NO_VERDICT = "GP9"
_LINE = re.compile(r"\bline \d+( column \d+)?|\blines \d+ (to|and) \d+")


class Notice(StrEnum):
    """The fate of a mutant.

    EQUAL: it does the same as the plan, so that there is nothing to notice. UNDECIDED: a limit was
    met before it was known.
    """

    EQUAL = "equal"
    NOTICED = "noticed"
    MISSED = "missed"
    UNDECIDED = "undecided"


@dataclass(frozen=True, slots=True)
class Mutant:
    """A changed plan; ``by`` are the rules that notice it."""

    mutation: Mutation
    notice: Notice
    by: tuple[str, ...] = ()


@dataclass(slots=True)
class Score:
    """The fates of the mutants, in the order of the operators, then of the document.

    ``possible``: so many changes there are, of which some lead to the same mutant. ``cut_off``: the
    time was over before all that were drawn were tried. ``own`` is how many findings the plan
    itself has.
    """

    plan: Plan
    possible: int
    own: int
    mutants: list[Mutant] = field(default_factory=list)
    cut_off: bool = False

    def count(self, notice: Notice) -> int:
        """The number of mutants with this fate."""
        return sum(each.notice is notice for each in self.mutants)

    @property
    def score(self) -> float | None:
        """The part that is noticed of what is to be noticed; None: there is nothing to notice."""
        noticed, missed = self.count(Notice.NOTICED), self.count(Notice.MISSED)
        return noticed / (noticed + missed) if noticed + missed else None


def mutate(
    plan: Plan,
    options: CheckOptions,
    *,
    seed: int = 0,
    most: int = DEFAULT_MUTANTS,
    time_s: float | None = None,
    jobs: int | str = 1,
    clock: Callable[[], float] = time.monotonic,
    tick: Callable[[int, int], object] = lambda _done, _all: None,
) -> Score:
    """Check the mutants of a plan; of more than ``most`` as many are drawn from the seed.

    A mutant is noticed if its check has a finding that the check of the plan has not: of another
    rule, or about another action. The score does not depend on ``jobs`` (docs/scale.md), unless the
    time is over. Raises UsageError for options that make no sense, for a behaviour tree, and if the
    plan itself cannot be decided.
    """
    _refuse_places(options)
    if isinstance(plan, TreePlan):
        hint = f"mutate its plan: gpsfsm convert {plan.file} --to plan > plan.xml"
        raise UsageError(f"{plan.file}: a behaviour tree is not mutated; {hint}")
    original = str(_fresh(plan))
    before, report = _itself(original, plan.file, options)
    findings = _findings(report, before)
    if isinstance(plan, MachinePlan):
        mutations = list(machine_mutations(plan))
    else:
        mutations = [change for operator in operators() for change in operator.mutations(plan)]
    score = Score(plan, len(mutations), findings.total())
    chosen = _chosen(mutations, seed, most)
    tried: deque[tuple[int, Mutation]] = deque()
    began = clock()

    def in_time() -> bool:
        score.cut_off = time_s is not None and clock() - began >= time_s
        return not score.cut_off

    texts = _texts(plan, original, takewhile(lambda _: in_time(), enumerate(chosen, 1)), tried)
    work = _Try(before, findings, options)
    for notice, by in map_items(engine_of(jobs, len(chosen)), work, texts, lost=_lost):
        done, mutation = tried.popleft()
        score.mutants.append(Mutant(mutation, notice, by))
        tick(done, len(chosen))
    return score


def _itself(text: str, file: str, options: CheckOptions) -> tuple[Plan, PlanReport]:
    """The plan as it is written anew, and what its check says; UsageError if that is nothing."""
    plan = _read(text, file, options)
    if plan is None:
        raise UsageError(f"{file}: the plan is too large to be written; raise the limits")
    report = check_text(text, file, options)
    if report.verdict is Verdict.UNDECIDED:
        raise UsageError(f"{file}: the plan itself cannot be decided: {_why(report)}")
    return plan, report


def _texts(
    plan: Plan,
    original: str,
    chosen: Iterable[tuple[int, Mutation]],
    tried: deque[tuple[int, Mutation]],
) -> Iterator[str]:
    """The mutants that differ from the plan and from each other; ``tried`` says which they are."""
    seen = {original}
    for done, mutation in chosen:
        tree = _fresh(plan)
        mutation.change(tree)
        text = str(tree)
        if text not in seen:
            seen.add(text)
            if isinstance(plan, MachinePlan) and _is_impossible(text, plan.file):
                continue
            tried.append((done, mutation))
            yield text


def _fresh(plan: Plan) -> Tree | MachineRows:
    """The parts of a plan or machine, to be changed and written."""
    return MachineRows(plan) if isinstance(plan, MachinePlan) else Tree(plan)


def _refuse_places(options: CheckOptions) -> None:
    """A mutant is written anew, so that nothing stands any more where an assumption says."""
    for text in options.analysis.assumptions:
        todo = [parse_assumption(text).statement]
        while todo:
            statement = todo.pop()
            if not isinstance(statement, Claim):
                todo += statement.parts
                continue
            for each in statement.selectors:
                if isinstance(each, LineSelector | PathSelector):
                    raise UsageError(
                        f"the assumption names a place of the plan ({clip(str(each), 100)}), where "
                        "another runner may be in a mutant; name its interface instead"
                    )


def _chosen(mutations: list[Mutation], seed: int, most: int) -> list[Mutation]:
    if len(mutations) <= most:
        return mutations
    source = seeded(f"{seed}:mutants")
    return [mutations[number] for number in sorted(source.sample(range(len(mutations)), most))]


@dataclass(frozen=True, slots=True)
class _Try:
    """The work on the text of a mutant: its fate, and the rules that notice it."""

    before: Plan
    own: Counter[tuple[str, ...]]
    options: CheckOptions

    def __call__(self, text: str) -> _Tried:
        """Check it."""
        before, options = self.before, self.options
        after = _read(text, before.file, options)
        if after is None:
            return Notice.UNDECIDED, ()
        same = _same(before, after, options)
        if same:
            return Notice.EQUAL, ()
        report = check_text(text, before.file, options)
        new = _findings(report, after) - self.own
        if new:
            return Notice.NOTICED, tuple(sorted({key[0] for key in new}))
        if same is None or report.verdict is Verdict.UNDECIDED:
            return Notice.UNDECIDED, ()
        return Notice.MISSED, ()


def _lost(_text: str, _how: str) -> _Tried:
    return Notice.UNDECIDED, ()


def _same(before: Plan, after: Plan, options: CheckOptions) -> bool | None:
    """True if both plans do the same in all scenarios that there are; None: it is not known."""
    analysis = options.analysis
    try:
        difference = compare(
            before, after, consistent=analysis.consistent, assumptions=analysis.assumptions
        )
    except InternalError:
        raise
    except GpsfsmError:  # a limit, or assumptions that leave no scenario of one of them
        return None
    return difference is None


def _read(text: str, file: str, options: CheckOptions) -> Plan | None:
    """The plan; None: a change has taken it beyond a limit, such as that of depth."""
    parsed = machine_in(text, file=file, limits=options.limits)
    return (parsed or parse(text, file=file, limits=options.limits)).plan


def _findings(report: PlanReport, plan: Plan) -> Counter[tuple[str, ...]]:
    """The subjects of the findings, whatever the lines are on which they stand."""
    elements = {plan.path(element): element for element in plan.elements}
    counts: Counter[tuple[str, ...]] = Counter()
    for finding in report.findings:
        if finding.rule.startswith(_NO_VERDICT):
            continue
        element = elements.get(finding.location.element)
        if element is None or element.parent < 0:
            counts[(finding.rule, _LINE.sub("line", finding.message))] += 1
        else:
            attributes = sorted((each.name, each.text) for each in element.attributes)
            counts[
                (finding.rule, element.kind.value, *(f"{name}={text}" for name, text in attributes))
            ] += 1
    return counts


def _why(report: PlanReport) -> str:
    relevant: list[Finding] = [
        each for each in report.findings if each.rule.startswith(_NO_VERDICT)
    ]
    return relevant[0].message if relevant else "it is not known why"


_VERSION = 1
_MAX_LISTED = 500


def score_text(score: Score, by: str) -> str:
    """The mutants that were missed, then the score; ``by`` says what notices mutants."""
    name = printable(score.plan.file)
    lines: list[str] = []
    for notice in (Notice.MISSED, Notice.UNDECIDED):
        mutants = [each for each in score.mutants if each.notice is notice]
        lines += [
            f"{_place(score, each)}: {notice} {_described(each)}" for each in mutants[:_MAX_LISTED]
        ]
        if len(mutants) > _MAX_LISTED:
            lines.append(f"and {len(mutants) - _MAX_LISTED} more that are {notice}")
    if lines:
        lines.append("")
    if score.own:
        has = _count(score.own, "finding")
        lines.append(f"{name}: note: the plan itself has {has}; only further ones notice a mutant")
    lines.append(f"{name}: {_summary(score, by)}")
    return "\n".join(lines) + "\n"


def _summary(score: Score, by: str) -> str:
    noticed, missed = score.count(Notice.NOTICED), score.count(Notice.MISSED)
    share = "there is nothing to notice" if score.score is None else f"{score.score:.0%}"
    tried, equal = len(score.mutants), score.count(Notice.EQUAL)
    parts = [
        f"{_count(tried, 'mutant')}: {by} {noticed} of {noticed + missed} ({share})",
        f"{equal} the same as the plan",
        f"{score.count(Notice.UNDECIDED)} undecided",
    ]
    if score.cut_off:
        parts.append("then the time ran out")
    return "; ".join(parts)


def _count(number: int, one: str) -> str:
    return f"{number} {one}{'' if number == 1 else 's'}"


def _place(score: Score, mutant: Mutant) -> str:
    element = score.plan.elements[mutant.mutation.element]
    return f"{printable(score.plan.file)}:{element.line}:{element.column}"


def _described(mutant: Mutant) -> str:
    return f"{mutant.mutation.operator}: {clip(mutant.mutation.summary, 300)}"


def score_json(score: Score) -> str:
    """The same for programs."""
    plan = score.plan
    data = {
        "mutation": _VERSION,
        "plan": plan.file,
        "score": score.score,
        "possible": score.possible,
        "cut_off": score.cut_off,
        "counts": {notice.value: score.count(notice) for notice in Notice},
        "mutants": [
            {
                "operator": each.mutation.operator,
                "line": plan.elements[each.mutation.element].line,
                "column": plan.elements[each.mutation.element].column,
                "element": plan.path(each.mutation.element),
                "told": each.mutation.summary,
                "notice": each.notice.value,
                "by": list(each.by),
            }
            for each in score.mutants
        ],
    }
    return json.dumps(data, ensure_ascii=True, indent=2) + "\n"


_OTHER_EVENT = {"SUCCEEDED": "FAILED", "FAILED": "SUCCEEDED"}
_OTHER_ACTION = {"trigger": "stop", "stop": "trigger"}
_ENDS = (NodeKind.COMPLETE, NodeKind.GIVE_UP)


class MachineRows:
    """A machine as rows of JSON, node by node and connection by connection."""

    def __init__(self, plan: MachinePlan) -> None:
        names = [plan.path(node.origin).removeprefix("/machine/") for node in plan.nodes]
        self.nodes: list[dict[str, Any]] = []
        self.edges: list[dict[str, str]] = []
        for node in plan.nodes:
            row: dict[str, Any] = {"id": names[node.index], "kind": node.kind.value}
            if node.kind is NodeKind.JOIN:
                row["need"] = node.need
            elif node.kind is NodeKind.RUNNER:
                element = plan.elements[node.origin]
                row |= {"interface": element.interface, "provider": element.provider}
                row["parameters"] = {
                    name: written(value)
                    if isinstance(value, float) and not isfinite(value)
                    else value
                    for name, value in element.parameters.items()
                }
            self.nodes.append(row)
        for action, edges in (("trigger", plan.edges), ("stop", plan.stops)):
            for source, event, target in edges:
                ends = {"source": names[source], "target": names[target]}
                self.edges.append({**ends, "event": event.value, "action": action})

    def __str__(self) -> str:
        nodes, edges = (",\n  ".join(map(json.dumps, rows)) for rows in (self.nodes, self.edges))
        return f'{{"nodes": [\n  {nodes}],\n "edges": [\n  {edges}]}}\n'


def machine_mutations(plan: MachinePlan) -> Iterator[Mutation]:
    """All changes of a machine, by operator, then by its connections and joins."""
    rows = MachineRows(plan)
    edges = list(zip(rows.edges, (*plan.edges, *plan.stops), strict=True))

    def mutation(
        operator: str, node: int, summary: str, change: Callable[[MachineRows], None]
    ) -> Mutation:
        return Mutation(operator, plan.nodes[node].origin, summary, change)

    for place, (row, edge) in enumerate(edges):
        yield mutation("drop", edge.source, f"leaves out {_shown(row)}", partial(_drop, place))
    for place, (row, edge) in enumerate(edges):
        other = _OTHER_EVENT.get(row["event"])
        if other is not None and plan.nodes[edge.source].kind is NodeKind.RUNNER:
            change = partial(_set, place, "event", other)
            yield mutation("event", edge.source, f"makes {_shown(row)} one of {other}", change)
    for place, (row, edge) in enumerate(edges):
        if plan.nodes[edge.target].kind not in _ENDS:
            action = _OTHER_ACTION[row["action"]]
            change = partial(_set, place, "action", action)
            yield mutation("action", edge.source, f"makes {_shown(row)} one that {action}s", change)
    for node in plan.nodes:
        for need in (node.need - 1, node.need + 1) if node.kind is NodeKind.JOIN else ():
            if need >= 1:
                join = rows.nodes[node.index]["id"]
                summary = f"lets the join {join} need {need} in the place of {node.need}"
                yield mutation("need", node.index, summary, partial(_need, node.index, need))


def _drop(place: int, rows: MachineRows) -> None:
    del rows.edges[place]


def _set(place: int, key: str, value: str, rows: MachineRows) -> None:
    rows.edges[place][key] = value


def _need(node: int, need: int, rows: MachineRows) -> None:
    rows.nodes[node]["need"] = need


def _shown(row: dict[str, str]) -> str:
    stops = " stops" if row["action"] == "stop" else ""
    return f"{row['source']} {row['event']}{stops} → {row['target']}"


def _is_impossible(text: str, file: str) -> bool:
    """True for the text of a mutant that is no machine any more."""
    parsed = machine_in(text, file=file)
    return parsed is not None and parsed.plan is None and not parsed.over_limit
