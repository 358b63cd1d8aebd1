"""Random machines: what the check says, a brute force over all configurations, and SPIN.

Machines have loops, joins of k of n, connections that stop, several starts and triggers. What the
check decides in two ways is compared within it; here it is held against judges of other making.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import networkx as nx
from hypothesis import strategies as st

from gpsfsm.analysis.constraints import Constraints
from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.checking.machine_check import decide_machine
from gpsfsm.compile import compile_plan
from gpsfsm.compile.machines import machine_of
from gpsfsm.model.event import Outcome
from tests.analysis.machines.random_machines import machines, order_free_machines, outcomes
from tests.campaigns.base import Pair, UnknownError
from tests.campaigns.pairs.spin import missing, verified
from tests.campaigns.promela_machines import machine_model
from tests.oracle.machines import Machine, TooLargeError, is_lasso, machine_facts

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hypothesis.strategies import DrawFn

    from gpsfsm.checking.machine_check import DecidedMachine

Case = tuple[nx.MultiDiGraph, dict[str, frozenset[str]]]  # type: ignore[type-arg]

_FREQUENCIES = ("completes", "gives_up", "stuck", "endless", "completes_if_fair")
_MOST = 4_000


@st.composite
def cases(draw: DrawFn, *, most_runners: int = 6) -> Case:
    """A machine, and the outcomes that each of its runners can have."""
    free = draw(st.sampled_from((False, False, True)))
    graph = draw((order_free_machines if free else machines)(most_runners=most_runners))
    names = [name for name, kind in graph.nodes(data="kind") if kind == "runner"]
    drawn = draw(outcomes(len(names)))
    return graph, {name: frozenset(map(str, each)) for name, each in zip(names, drawn, strict=True)}


def checked(case: Case) -> DecidedMachine:
    """What the check says."""
    graph, allowed = case
    plan, problems = machine_of(graph)
    assert plan is not None, problems
    compiled = compile_plan(plan)
    names = [_name(plan.path(runner)) for runner in plan.runners]
    constraints = Constraints(
        allowed=tuple(frozenset(map(Outcome, allowed[name])) for name in names),
        hang=any("HANG" in each for each in allowed.values()),
    )
    decided = decide_machine(compiled, constraints, AnalysisOptions())
    assert decided.facts is not None, decided.reason
    return decided


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
    graph, allowed = case
    try:
        wanted = machine_facts(graph, allowed, most=_MOST)
    except TooLargeError:
        raise UnknownError(f"more than {_MOST:,} configurations") from None
    decided = checked(case)
    loops = wanted.pop("loops")
    wanted |= {
        key: sorted(wanted[key]) for key in ("unreachable", "dangling", "join_deadlocks", "orphans")
    }
    assert facts_of(decided) == wanted
    assert decided.facts is not None
    assert decided.facts.machine is not None
    traps = [set(map(_name, loop.runners)) for loop in decided.facts.machine.loops if loop.trap]
    assert sorted(map(sorted, traps)) == sorted(sorted(names) for names, trap in loops if trap)
    others = [loop for loop in decided.facts.machine.loops if not loop.trap]
    assert bool(others) == any(not trap for _, trap in loops)
    machine = Machine(graph, allowed)
    for finding in decided.findings:
        if finding.rule in ("GP313", "GP314") and finding.scenario is not None:
            steps = [(_name(path), str(outcome)) for path, outcome in finding.scenario.outcomes]
            assert any(is_lasso(machine, steps[:at], steps[at:]) for at in range(len(steps)))
    yield from _labels(wanted, loops)
    yield from sorted({f"decided by {how}" for how in decided.decided_by.values()})


def _labels(wanted: dict[str, Any], loops: set[Any]) -> Iterator[str]:
    yield from (f"{name} {wanted[name]}" for name in _FREQUENCIES)
    yield from {f"dangling {event} {effect}" for _, event, effect in wanted["dangling"]}
    yield from {f"join deadlock {effect}" for _, effect in wanted["join_deadlocks"]}
    yield from {"trap" if trap else "loop" for _, trap in loops}
    yield from (name for name in ("orphans", "unreachable") if wanted[name])
    if wanted["completes"] != wanted["completes_if_fair"]:
        yield "completion needs fairness"


def judge_by_spin(case: Case) -> Iterator[str]:
    """SPIN's answers against the facts of the check."""
    graph, allowed = case
    facts = facts_of(checked(case))
    answers = verified(machine_model(graph, allowed), cycles=True)
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
    graph, allowed = case
    rows = [{"id": name, **data} for name, data in graph.nodes(data=True)]
    edges = [
        {"source": source, "target": target, **data}
        for source, target, data in graph.edges(data=True)
    ]
    said = {"nodes": rows, "edges": edges, "outcomes": {k: sorted(v) for k, v in allowed.items()}}
    return json.dumps(said, indent=1)


PAIRS = [
    Pair(
        name="machines",
        about="random machines with loops and stops: the check against a brute force",
        cases=cases,
        judge=judge,
        text=_text,
        full=20_000,
        batch=100,
    ),
    Pair(
        name="machines-spin",
        about="random machines: SPIN on a model written from the graph, against the check",
        cases=cases,
        judge=judge_by_spin,
        text=_text,
        full=1_000,
        batch=20,
        missing=missing,
        few=2,
    ),
]
