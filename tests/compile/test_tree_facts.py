"""Behaviour trees: the structural pass and z3 against brute force, on all facts."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import product
from random import Random
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.analysis.constraints import constraints_of
from gpsfsm.analysis.decide import decide
from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.analysis.structure import Structure
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.compile import compile_plan
from gpsfsm.compile.plan_text import read_plan
from gpsfsm.model.event import Event
from gpsfsm.model.report import Loaded
from tests.cases import batches, many
from tests.compile.test_trees_engines import uses_of
from tests.compile.tree_facts import Play
from tests.compile.tree_facts import facts as by_force
from tests.compile.trees import ALL, T, Use, random_tree, to_xml

if TYPE_CHECKING:
    from gpsfsm.compile import Compiled
    from gpsfsm.model.report import Facts

_PARTS = 8
_INTRICATE = ("IfThenElse", "IfThenElse", "Inverter", "Parallel", "ParallelAll", "Fallback")


def options_of(random: Random, tree: T) -> tuple[AnalysisOptions, dict[str, tuple[bool, ...]]]:
    """Options under which outcomes stay independent, and how leaves can end then."""
    faults = ("no-start",) if random.random() < 0.3 else ()
    leaf = random.choice([each.leaf for each in tree.leaves()])
    assumption, ends = random.choice(
        (("", (True, False)), ("never fails", (True,)), ("never succeeds", (False,)))
    )
    assumptions = (f"{leaf} {assumption}",) if assumption else ()
    return AnalysisOptions(assumptions=assumptions, faults=faults), {leaf: ends}


def compiled_of(tree: T) -> Compiled:
    plan = read_plan(to_xml(tree)).plan
    assert plan is not None
    return compile_plan(plan)


def decided(compiled: Compiled, options: AnalysisOptions) -> Facts:
    constraints = constraints_of(
        compiled.automaton.plan, faults=options.faults, assumptions=options.assumptions
    )
    answer = decide(compiled, constraints, options).facts()
    assert answer is not None
    return answer


def in_words_of_the_tree(compiled: Compiled, facts: Facts) -> dict[str, Any]:
    """The facts about uses of leaves instead of element paths."""
    plan = compiled.automaton.plan
    use = dict(zip(map(plan.path, plan.runners), uses_of(compiled), strict=True))
    assert facts.loaded is not None
    return {
        "completes": facts.completes,
        "gives_up": facts.gives_up,
        "unreachable": {use[path] for path in facts.unreachable},
        "fewest": facts.fewest_failures_to_give_up,
        "dangling": {
            (use[each.runner], each.event is Event.SUCCEEDED): each.effect
            for each in facts.dangling
        },
        "orphans": {use[path] for path in facts.orphans},
        "peak": facts.loaded.peak,
    }


@pytest.mark.parametrize("part", batches(_PARTS))
def test_both_deciders_find_the_facts_of_brute_force(part: int) -> None:
    for seed in range(5000 + part, 5160, _PARTS):
        random = Random(seed)  # noqa: S311
        tree = random_tree(random, random.choice((ALL, _INTRICATE)), most=6)
        options, allowed = options_of(random, tree)
        compiled = compiled_of(tree)
        wanted = by_force(tree, allowed)
        for solver in ("structural", "z3"):
            decision = decided(compiled, replace(options, solver=solver))
            assert decision.stuck == "never"
            assert not decision.join_deadlocks
            worded = in_words_of_the_tree(compiled, decision)
            assert worded == wanted, (solver, options, to_xml(tree))


@pytest.mark.parametrize("part", batches(_PARTS))
def test_both_deciders_write_the_same_findings(part: int) -> None:
    """So the structural pass finds the canonical scenarios, which z3 searches."""
    for seed in range(6000 + part, 6120, _PARTS):
        random = Random(seed)  # noqa: S311
        tree = random_tree(random, random.choice((ALL, _INTRICATE)), most=10)
        options, _ = options_of(random, tree)
        text = to_xml(tree)
        one, other = (
            check_text(text, "t.xml", CheckOptions(analysis=replace(options, solver=solver)))
            for solver in ("structural", "z3")
        )
        assert replace(one, proof=None) == replace(other, proof=None), (options, text)


def tree_of(body: str) -> str:
    return (
        '<root BTCPP_format="4" main_tree_to_execute="Main">'
        f'<BehaviorTree ID="Main">{body}</BehaviorTree></root>'
    )


def test_large_trees_need_no_z3(monkeypatch: pytest.MonkeyPatch) -> None:
    """Hundreds of leaves below all kinds of nodes, with CASES=all thousands of them."""
    monkeypatch.setattr("gpsfsm.analysis.decide.Solver", None)
    part = (
        "<Inverter><Fallback><A{0}/><B{0}/></Fallback></Inverter>"
        '<Parallel success_count="2" failure_count="2"><C{0}/><D{0}/><E{0}/></Parallel>'
        "<IfThenElse><F{0}/><G{0}/><Inverter><H{0}/></Inverter></IfThenElse>"
    )
    size = many(300)
    body = "".join(part.format(number) for number in range(size))
    facts = check_text(tree_of(f"<Sequence>{body}</Sequence>"), "t.xml", CheckOptions()).facts
    assert facts is not None
    assert (facts.runners, facts.completes, facts.gives_up) == (8 * size, "sometimes", "sometimes")
    assert facts.unreachable == ()
    assert facts.fewest_failures_to_give_up == 0  # if A0 succeeds
    # C to E run on where the others decide; which of the eight can be the last to fail differs.
    assert len(facts.orphans) == 3 * size
    assert {each.effect for each in facts.dangling} == {"give_up"}


@pytest.mark.parametrize("solver", ["structural", "z3"])
def test_a_condition_leaves_something_behind_also_if_its_branch_can_only_fail(solver: str) -> None:
    waiting = '<Parallel success_count="1" failure_count="2"><A/><B/></Parallel>'
    text = tree_of(f"<Inverter><IfThenElse>{waiting}<Broken/></IfThenElse></Inverter>")
    options = AnalysisOptions(assumptions=("Broken never succeeds",), solver=solver)
    facts = check_text(text, "t.xml", CheckOptions(analysis=options)).facts
    assert facts is not None
    assert [path.rpartition("/")[2] for path in facts.orphans] == ["A[1]", "B[1]"]


def test_a_wide_parallel_is_a_matter_of_numbers() -> None:
    """40 of 60 must succeed, so 21 failures are enough to fail."""
    leaves = "".join(f"<Inverter><Never{n}/></Inverter>" for n in range(5))
    leaves += "".join(f"<A{n}/>" for n in range(55))
    text = tree_of(f'<Parallel success_count="40" failure_count="21">{leaves}</Parallel>')
    options = AnalysisOptions(solver="structural")
    facts = check_text(text, "t.xml", CheckOptions(analysis=options)).facts
    assert facts is not None
    # the five that are inverted fail for free
    assert facts.fewest_failures_to_give_up == 16
    assert len(facts.orphans) == 60


@pytest.mark.parametrize("solver", ["structural", "z3"])
def test_a_parallel_that_counts_may_leave_something_behind_when_it_fails(solver: Any) -> None:
    """A and B fail while C is still active, and the three of the Fallback start beside it."""
    counting = '<Parallel success_count="2" failure_count="2"><A/><B/><C/></Parallel>'
    text = tree_of(f"<Fallback>{counting}<Parallel><X/><Y/><Z/></Parallel></Fallback>")
    check = CheckOptions(analysis=AnalysisOptions(solver=solver))
    facts = check_text(text, "t.xml", check).facts
    assert facts is not None
    assert facts.loaded == Loaded(peak=4, all=6)


def first(scenarios: list[list[int]]) -> list[int] | None:
    """The canonical one: the fewest failures, then the first in document order."""
    return min(scenarios, key=lambda failing: (len(failing), failing), default=None)


def check_canonical(tree: T) -> None:
    """What the structural pass finds for each leaf, against all scenarios."""
    compiled = compiled_of(tree)
    structure = Structure(compiled, constraints_of(compiled.automaton.plan))
    uses = uses_of(compiled)
    runs = []
    for outcomes in product((True, False), repeat=len(uses)):
        decided: dict[Use, bool | None] = dict(zip(uses, outcomes, strict=True))
        run = Play(decided)
        runs.append((decided, run.play(tree), run.triggered))
    for number, use in enumerate(uses):
        unit = structure.unit_of[number]
        results: dict[str, list[list[int]]] = {"same": [], "other": [], "outlive": []}
        for decided, end, triggered in runs:
            if use not in triggered:
                continue
            failing = [other for other, each in enumerate(uses) if not decided[each]]
            others = [other for other in failing if other != number]
            turned = Play({**decided, use: not decided[use]}).play(tree)
            if turned is not end:
                results["same" if end is decided[use] else "other"].append(others)
            if Play({**decided, use: None}).play(tree) is True:
                results["outlive"].append(others)
        deviations = {
            "same": partial(structure.failing_around, unit),
            "other": partial(structure.failing_around, unit, same=False),
            "outlive": partial(structure.failing_to_outlive, unit),
        }
        possible = {
            "same": structure.fails_plan[unit],
            "other": structure.success_fails_plan[unit],
            "outlive": structure.outlived[unit],
        }
        for way, scenarios in results.items():
            assert possible[way] is bool(scenarios), (way, use, to_xml(tree))
            if scenarios:
                assert sorted(deviations[way]()) == first(scenarios), (way, use, to_xml(tree))


@pytest.mark.parametrize("part", batches(_PARTS))
def test_canonical_scenarios_are_those_of_brute_force(part: int) -> None:
    for seed in range(7000 + part, 7120, _PARTS):
        random = Random(seed)  # noqa: S311
        check_canonical(random_tree(random, random.choice((ALL, _INTRICATE)), most=8))


def test_of_two_ways_that_cost_the_same_the_first_in_the_document_is_taken() -> None:
    """R decides if X and Z fail, and if Y and W do."""
    r, x, y, z, w = (T("leaf", leaf=name) for name in "RXYZW")
    tree = T("IfThenElse", (T("IfThenElse", (r, x, y)), z, w))
    check_canonical(tree)
    structure = Structure(compiled_of(tree), constraints_of(compiled_of(tree).automaton.plan))
    assert sorted(structure.failing_around(structure.unit_of[0])) == [1, 3]
