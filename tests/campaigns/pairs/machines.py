"""Random machines: what the check says, a brute force over all configurations, and SPIN.

Machines have loops, joins of k of n, connections that stop, several starts and triggers. What the
check decides in two ways is compared within it; here it is held against judges of other making.
"""

from __future__ import annotations

import json
import re
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple
from unittest.mock import patch

from hypothesis import strategies as st

from gpsfsm.analysis.constraints import constraints_under
from gpsfsm.analysis.machines.order_free import is_order_free
from gpsfsm.checking import machine_check
from gpsfsm.compile import compile_plan
from gpsfsm.compile.machines import machine_of
from gpsfsm.model.capability import Binding, Interface, Provider
from gpsfsm.model.event import Outcome
from tests import oracle
from tests.analysis.machines.random_machines import (
    automaton_of,
    machines,
    options_of,
    order_free_machines,
    outcomes,
)
from tests.campaigns.base import Pair, UnknownError
from tests.campaigns.pairs.spin import missing, verified
from tests.campaigns.promela_machines import machine_model
from tests.oracle.machine_scenarios import ScenarioMachine
from tests.oracle.machines import (
    Machine,
    Tie,
    TooLargeError,
    facts_of_machine,
    is_lasso,
    meetings,
)
from tests.strategies import relations

if TYPE_CHECKING:
    from collections.abc import Iterator

    import networkx as nx
    from hypothesis.strategies import DrawFn

    from gpsfsm.analysis.options import AnalysisOptions
    from gpsfsm.checking.machine_check import DecidedMachine
    from gpsfsm.compile import Compiled

_FREQUENCIES = ("completes", "gives_up", "stuck", "endless", "completes_if_fair")
_MOST = 4_000
_ALL = 1_000_000
_INTERFACES = tuple(f"demo_capabilities/{name}" for name in ("Go", "Go", "Look", "Say"))
_RESOURCES = frozenset({"demo_capabilities/Go", "demo_capabilities/Look"})
"""Runners of these hold one resource."""


class Case(NamedTuple):
    """A machine, and options: their texts for the check, and their meaning for the brute force.

    ``outcomes``: those that each runner can have by itself.
    """

    graph: nx.MultiDiGraph[Any]
    outcomes: dict[str, frozenset[str]]
    consistent: bool = False
    relation: oracle.Constraint | None = None


@st.composite
def plain_cases(draw: DrawFn, *, most_runners: int = 6) -> Case:
    """A machine, and the outcomes that each of its runners can have."""
    free = draw(st.sampled_from((False, False, True)))
    graph = draw((order_free_machines if free else machines)(most_runners=most_runners))
    names = _names(graph)
    drawn = draw(outcomes(len(names)))
    return Case(graph, {n: frozenset(map(str, each)) for n, each in zip(names, drawn, strict=True)})


@st.composite
def cases(draw: DrawFn) -> Case:
    """A machine in which actions are equal, with outcomes, consistency and relations."""
    case = draw(plain_cases(most_runners=5))
    names = _names(case.graph)
    for name in names:
        case.graph.nodes[name]["interface"] = draw(st.sampled_from(_INTERFACES))
    relation = None
    free = is_order_free(automaton_of(case.graph))  # nothing else is decided under relations
    if draw(st.sampled_from((True, True, False) if free else (True, *[False] * 7))):
        hang = any("HANG" in each for each in case.outcomes.values())
        verbs = st.sampled_from(["succeeds", "fails", *["hangs"] * hang])
        atoms = st.builds(oracle.Says, st.sampled_from(names), verbs)
        relation = draw(relations(atoms))
    return case._replace(consistent=draw(st.booleans()), relation=relation)


def _names(graph: nx.MultiDiGraph[Any]) -> list[str]:
    return [name for name, kind in graph.nodes(data="kind") if kind == "runner"]


def options_for(case: Case) -> AnalysisOptions:
    """The options of a case, as they are written."""
    names = sorted(case.outcomes)
    allowed = [frozenset(map(Outcome, case.outcomes[name])) for name in names]
    options = options_of(names, allowed)
    assumptions = options.assumptions
    if case.relation is not None:
        text = re.sub(r"\b[rj]\d+\b", lambda match: f'name "{match[0]}"', str(case.relation))
        assumptions = (*assumptions, text)
    return replace(options, consistent=case.consistent, assumptions=assumptions)


def compiled_of(case: Case) -> Compiled:
    """The machine of a case; runners of some interfaces hold one resource."""
    plan, problems = machine_of(case.graph)
    assert plan is not None, problems
    compiled = compile_plan(plan)
    holder = Provider("demo/Holder", "demo/Go", resources=("base",))
    bindings = tuple(
        Binding(Interface(runner.interface), holder, {}) if runner.interface in _RESOURCES else None
        for runner in plan.runners
    )
    return replace(compiled, bindings=bindings)


def checked(case: Case) -> DecidedMachine:
    """What the check says, whose own judge by definitions looks at machines of any size here."""
    compiled, options = compiled_of(case), options_for(case)
    constraints = constraints_under(options, compiled)
    with patch.object(machine_check, "ALSO_EXPLORED", _ALL):
        return machine_check.decide_machine(compiled, constraints, options)


def overlapping(case: Case) -> set[tuple[str, str]]:
    """The runners that hold the resource at once, by the check."""
    compiled, options = compiled_of(case), options_for(case)
    constraints = constraints_under(options, compiled)
    with patch.object(machine_check, "ALSO_EXPLORED", _ALL):
        findings = machine_check.overlap_findings(compiled, constraints, options)
    pairs = ((finding.location, finding.related[0].location) for finding in findings)
    return {(_name(one.element), _name(other.element)) for one, other in pairs}


def _name(path: str) -> str:
    return path.removeprefix("/machine/")


def facts_of(decided: DecidedMachine) -> dict[str, Any]:
    """The facts of the check in the form of the brute force, but for the loops."""
    facts = decided.facts
    assert facts is not None
    assert facts.machine is not None
    return {
        "completes": str(facts.completes),
        "gives_up": str(facts.gives_up),
        "stuck": str(facts.stuck),
        "endless": str(facts.machine.endless),
        "completes_if_fair": str(facts.machine.completes_if_fair),
        "unreachable": sorted(map(_name, facts.unreachable)),
        "dangling": sorted(
            (_name(each.runner), str(each.event), each.effect) for each in facts.dangling
        ),
        "join_deadlocks": sorted(
            (_name(each.control), each.effect) for each in facts.join_deadlocks
        ),
        "orphans": sorted(map(_name, facts.orphans)),
        "fewest_failures_to_give_up": facts.fewest_failures_to_give_up,
    }


def judge(case: Case) -> Iterator[str]:
    """All facts of the check against the brute force; each lasso is played by it."""
    decided, scenarios = checked(case), _scenarios(case)
    if decided.contradictory:
        assert not scenarios
        yield "contradictory"
        return
    if decided.reason:
        hang = any("HANG" in each for each in case.outcomes.values())
        assert case.relation is not None or (case.consistent and hang)
        yield "undecided"
        return
    assert scenarios
    try:
        machine, tied = _brute(case, scenarios)
        wanted = facts_of_machine(machine)
        other = wanted if tied is None else facts_of_machine(tied)
        met = meetings(machine)
    except TooLargeError:
        raise UnknownError(f"more than {_MOST:,} configurations") from None
    _compare(decided, wanted, other)
    assert overlapping(case) == {
        pair for pair in met if all(case.graph.nodes[n]["interface"] in _RESOURCES for n in pair)
    }
    for finding in decided.findings:
        if finding.rule in ("GP313", "GP314") and finding.scenario is not None:
            steps = [(_name(path), str(outcome)) for path, outcome in finding.scenario.outcomes]
            assert any(is_lasso(machine, steps[:at], steps[at:]) for at in range(len(steps)))
    yield from _labels(wanted)
    yield from sorted({f"decided by {how}" for how in decided.decided_by.values()})
    yield from ["consistent"] * case.consistent + ["related"] * (case.relation is not None)
    yield from ["overlaps"] * bool(overlapping(case))


def _scenarios(case: Case) -> list[dict[str, str]]:
    """The scenarios that obey all options."""
    names = sorted(case.outcomes)
    every = (
        dict(zip(names, drawn, strict=True))
        for drawn in product(*(sorted(case.outcomes[name]) for name in names))
    )
    classes = _classes(case)
    return [
        each
        for each in every
        if (case.relation is None or case.relation(each))
        and all(len({each[name] for name in members}) == 1 for members in classes)
    ]


def _classes(case: Case) -> list[frozenset[str]]:
    """The runners of each action, if equal actions have equal outcomes."""
    by_action: dict[str, set[str]] = {}
    for name in case.outcomes if case.consistent else ():
        by_action.setdefault(case.graph.nodes[name]["interface"], set()).add(name)
    return [frozenset(each) for each in by_action.values()]


def _brute(case: Case, scenarios: list[dict[str, str]]) -> tuple[Machine, Machine | None]:
    """The machine by its scenarios, where these say all; and by ties, where these do."""
    allowed = {name: {each[name] for each in scenarios} for name in case.outcomes}
    ties = [Tie(members) for members in _classes(case)]
    machine = Machine(case.graph, allowed, ties=ties, most=_MOST)
    if not is_order_free(automaton_of(case.graph)) or not (ties or case.relation):
        return machine, None
    return ScenarioMachine(case.graph, scenarios, most=_MOST), machine


def _compare(decided: DecidedMachine, wanted: dict[str, Any], other: dict[str, Any]) -> None:
    """Compare the facts; effects of events may be those of either reading of what was not."""
    for facts in (wanted, other):
        facts |= {
            key: sorted(facts[key])
            for key in ("unreachable", "dangling", "join_deadlocks", "orphans")
        }
    actual = facts_of(decided)
    assert actual["dangling"] in (wanted["dangling"], other["dangling"])
    rest = [{**facts, "dangling": (), "loops": ()} for facts in (actual, wanted)]
    assert rest[0] == rest[1]
    assert decided.facts is not None
    assert decided.facts.machine is not None
    loops = wanted["loops"]
    traps = [set(map(_name, loop.runners)) for loop in decided.facts.machine.loops if loop.trap]
    assert sorted(map(sorted, traps)) == sorted(sorted(names) for names, trap in loops if trap)
    others = [loop for loop in decided.facts.machine.loops if not loop.trap]
    assert bool(others) == any(not trap for _, trap in loops)


def _labels(wanted: dict[str, Any]) -> Iterator[str]:
    yield from (f"{name} {wanted[name]}" for name in _FREQUENCIES)
    yield from {f"dangling {event} {effect}" for _, event, effect in wanted["dangling"]}
    yield from {f"join deadlock {effect}" for _, effect in wanted["join_deadlocks"]}
    yield from {"trap" if trap else "loop" for _, trap in wanted["loops"]}
    yield from (name for name in ("orphans", "unreachable") if wanted[name])
    if wanted["completes"] != wanted["completes_if_fair"]:
        yield "completion needs fairness"


def judge_by_spin(case: Case) -> Iterator[str]:
    """SPIN's answers against the facts of the check."""
    facts = facts_of(checked(case))
    answers = verified(machine_model(case.graph, case.outcomes), cycles=True)
    wanted = {question: _expected(facts, question) for question in answers}
    assert answers == wanted
    for (kind, _), answer in answers.items():
        yield f"{kind}: {'yes' if answer else 'no'}"


def _expected(facts: dict[str, Any], question: tuple[str, str]) -> bool:
    kind, name = question
    if kind in _FREQUENCIES:
        return bool(facts[kind] != "never")
    if kind == "reached":
        return name not in facts["unreachable"]
    if kind == "orphan":
        return name in facts["orphans"]
    effects = dict(facts["join_deadlocks"])
    assert kind == "waits stuck"
    return effects.get(name) == "stuck"


def _text(case: Case) -> str:
    graph = case.graph
    rows = [{"id": name, **data} for name, data in graph.nodes(data=True)]
    edges = [
        {"source": source, "target": target, **data}
        for source, target, data in graph.edges(data=True)
    ]
    outcomes_of = {name: sorted(each) for name, each in case.outcomes.items()}
    said = {"nodes": rows, "edges": edges, "outcomes": outcomes_of}
    said |= {"consistent": case.consistent, "assume": str(case.relation or "")}
    return json.dumps(said, indent=1)


PAIRS = [
    Pair(
        name="machines",
        about="random machines with loops, stops and all options: the check against a brute force",
        cases=cases,
        judge=judge,
        text=_text,
        full=20_000,
        batch=100,
    ),
    Pair(
        name="machines-spin",
        about="random machines: SPIN on a model written from the graph, against the check",
        cases=plain_cases,
        judge=judge_by_spin,
        text=_text,
        full=1_000,
        batch=20,
        missing=missing,
        few=2,
    ),
]
