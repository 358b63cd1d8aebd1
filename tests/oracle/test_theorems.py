"""The theorems of section 4, the oracle against random orders, and what the strategies draw."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import pytest
from hypothesis import Phase, assume, find, given, settings
from hypothesis import strategies as st

from tests.oracle import (
    COMPLETION,
    FAILED,
    HANG,
    NO_START,
    SUCCEEDED,
    C,
    Graph,
    P,
    Run,
    System,
    control_paths,
    facts,
    runner_paths,
    to_xml,
)
from tests.oracle.graph import JoinNode
from tests.strategies import constraints, faults, plans

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

unhurried = settings(deadline=None)  # a busy machine is no failure


@unhurried
@given(plans())
def test_paths_name_the_elements_of_the_text(whole: P) -> None:
    root = ElementTree.fromstring(to_xml(whole))  # noqa: S314  (our own text)
    paths = (*runner_paths(whole), *control_paths(whole))
    elements = [root.find("./" + path.removeprefix("/Plan/")) for path in paths]
    assert None not in elements
    assert len(set(map(id, elements))) == len(paths)
    dropped = bool(len(root)) and root[-1].get("interface") == COMPLETION
    assert len(paths) == sum(1 for _ in root.iter()) - 1 - dropped
    assert to_xml(whole).count("\n") == len(list(root.iter())) + sum(
        1 for element in root.iter() if element is root or len(element)
    )


def _step_by_step(graph: Graph, outcomes: tuple[str, ...], rng: random.Random) -> int:
    """Play one event at a time, in random order, with a count at every join."""
    counts: dict[int, int] = {}
    waiting, fired = [graph.start], 0
    while waiting:
        event = waiting.pop(rng.randrange(len(waiting)))
        assert not event & fired, "no event comes twice"
        fired |= event
        for node in graph.nodes:
            if isinstance(node, JoinNode):
                arrived = node.inputs.count(event)
                before = counts.get(node.fires, 0)
                counts[node.fires] = before + arrived
                if before < node.need <= before + arrived:
                    waiting.append(node.fires)
            elif node.trigger == event:
                outcome = outcomes[node.index]
                waiting += [node.started] if outcome != NO_START else []
                waiting += [node.failed] if outcome in {FAILED, NO_START} else []
                waiting += [node.succeeded] if outcome == SUCCEEDED else []
    return fired


@unhurried
@given(plans(max_runners=8), faults(), st.integers(0, 2**32), st.data())
def test_order_does_not_matter(
    whole: P, kinds: frozenset[str], seed: int, data: st.DataObject
) -> None:
    system = System(whole, kinds)
    outcomes = tuple(data.draw(st.sampled_from(system.kinds)) for _ in system.paths)
    played = system.run(outcomes).fired
    assert played == _step_by_step(system.graph, outcomes, random.Random(seed))  # noqa: S311


def _orphans_by_simulation(run: Run, rng: random.Random) -> set[str]:
    """Deliver outcomes in one random order; who is active when ``complete`` is triggered."""
    system, graph = run.system, run.system.graph
    delivered: frozenset[str] = frozenset()
    while True:
        fired = run._after(delivered)
        active = {r.path for r in graph.runners if r.trigger & fired} - delivered
        if fired & graph.success:
            return active
        ready = sorted(p for p in active if run.outcomes[system.index[p]] != HANG)
        if not ready:
            return set()
        delivered |= {rng.choice(ready)}


@unhurried
@given(plans(max_runners=6), faults(), st.integers(0, 2**32), st.data())
def test_no_random_order_finds_an_orphan_that_the_search_misses(
    whole: P, kinds: frozenset[str], seed: int, data: st.DataObject
) -> None:
    system = System(whole, kinds)
    run = system.run(tuple(data.draw(st.sampled_from(system.kinds)) for _ in system.paths))
    rng = random.Random(seed)  # noqa: S311
    sampled = set().union(*(_orphans_by_simulation(run, rng) for _ in range(20)))
    assert sampled <= run.orphans()


@unhurried
@given(plans())
def test_without_faults_no_plan_is_stuck(whole: P) -> None:
    answer = facts(whole)
    assert answer is not None
    assert answer["stuck"] == "never"
    assert (answer["gives_up"] == "never") == (answer["fewest_failures_to_give_up"] is None)


@unhurried
@given(plans(max_runners=5), faults())
def test_the_endings_exclude_each_other(whole: P, kinds: frozenset[str]) -> None:
    for run in System(whole, kinds).allowed(consistent=False, constraint=None):
        assert not (run.completed and run.gave_up)


@unhurried
@given(plans(max_runners=5), faults(), st.booleans(), st.data())
def test_success_never_dangles(
    whole: P, kinds: frozenset[str], consistent: bool, data: st.DataObject
) -> None:
    assume(runner_paths(whole))
    constraint = data.draw(constraints(whole, faults=kinds))
    answer = facts(whole, faults=kinds, consistent=consistent, constraint=constraint)
    assume(answer is not None)
    assert answer is not None
    assert {entry["event"] for entry in answer["dangling"]} <= {"FAILED"}


@unhurried
@given(plans(max_runners=5), faults())
def test_more_constraints_leave_fewer_orphans_and_more_unreachable(
    whole: P, kinds: frozenset[str]
) -> None:
    free = facts(whole, faults=kinds)
    bound = facts(whole, faults=kinds, consistent=True)
    assert free is not None
    assert bound is not None
    assert set(bound["orphans"]) <= set(free["orphans"])
    assert set(bound["unreachable"]) >= set(free["unreachable"])


def _has_effect(effect: str) -> Callable[[P], bool]:
    def holds(whole: P) -> bool:
        answer = facts(whole)
        assert answer is not None
        return effect in {block["effect"] for block in answer["join_deadlocks"]}

    return holds


def _below(whole: P | C) -> Iterator[C]:
    for child in whole.children:
        if isinstance(child, C):
            yield child
            yield from _below(child)


def _retries(whole: P) -> bool:
    actions = System(whole).actions
    return len(set(actions)) < len(actions) and facts(whole) != facts(whole, consistent=True)


def _starts_with_two_recoveries(whole: P) -> bool:
    return [getattr(child, "type", "") for child in whole.children[:2]] == ["recovery"] * 2


SHAPES: dict[str, Callable[[P], bool]] = {
    "escalated": _has_effect("escalated"),
    "absorbed": _has_effect("absorbed"),
    "give_up": _has_effect("give_up"),
    "ten runners": lambda whole: len(runner_paths(whole)) == 10,
    "depth 4": lambda whole: any(path.count("Control") == 4 for path in control_paths(whole)),
    "empty control": lambda whole: any(not control.children for control in _below(whole)),
    "leading recoveries": _starts_with_two_recoveries,
    "recovery of a recovery": lambda whole: any(
        control.type == "recovery" and any(c.type == "recovery" for c in _below(control))
        for control in _below(whole)
    ),
    "parallel of one": lambda whole: any(
        control.type == "parallel_all" and len(control.children) == 1 for control in _below(whole)
    ),
    "completion at the end": lambda whole: to_xml(whole).splitlines()[-2].count(COMPLETION) == 1,
    "completion elsewhere": lambda whole: COMPLETION in to_xml(whole).partition("</Control>")[0],
    "consistency matters": _retries,
}


@pytest.mark.parametrize("shape", SHAPES)
def test_the_strategy_draws_all_that_matters(shape: str) -> None:
    options = settings(max_examples=2000, derandomize=True, database=None, phases=[Phase.generate])
    assert SHAPES[shape](find(plans(), SHAPES[shape], settings=options))
