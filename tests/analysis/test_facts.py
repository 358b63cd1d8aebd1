"""All facts of the contract against brute force over every scenario and every order."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from tests import oracle
from tests.cases import many
from tests.oracle.model import place
from tests.strategies import constraints, faults, plans, plans_of_few_actions
from tests.support import decided, facts_as_dict

if TYPE_CHECKING:
    from gpsfsm.analysis.decide import Decided
    from gpsfsm.analysis.options import SolverChoice

both_solvers = pytest.mark.parametrize("solver", ["structural", "z3"])


def same(decision: Decided, whole: oracle.P, wanted: dict[str, Any] | None) -> None:
    """All facts but the greatest load, which takes all orders, not all scenarios.

    That one is compared in test_capability_facts, on smaller plans.
    """
    facts = facts_as_dict(decision.facts())
    if facts is None or wanted is None:
        assert facts is wanted is None
        return
    nodes = [at.node for at in place(whole).walk() if isinstance(at.node, oracle.R)]
    runners = {(node.interface, node.provider) for node in nodes}
    load = facts.pop("loaded")
    assert load["all"] == len(runners)
    reachable = len(nodes) - len(facts["unreachable"])
    assert min(reachable, 1) <= load["peak"] <= min(reachable, len(runners))
    nothing_declared = {"makespan": None, "energy": None}
    assert facts == wanted | nothing_declared


@both_solvers
@settings(max_examples=many(150))
@given(whole=plans())
def test_facts_of_free_outcomes(solver: SolverChoice, whole: oracle.P) -> None:
    same(decided(whole, solver=solver), whole, oracle.facts(whole))


@given(whole=plans(max_runners=8))
def test_facts_of_a_consistent_world(whole: oracle.P) -> None:
    same(decided(whole, consistent=True), whole, oracle.facts(whole, consistent=True))


@settings(max_examples=many(100))
@given(whole=plans_of_few_actions())
@example(oracle.plan(oracle.par_all("Go", "Go")))
@example(oracle.plan(oracle.par_all(oracle.seq("Say", "Go"), oracle.par_any("Go", "Go"))))
def test_facts_of_a_consistent_world_of_few_actions(whole: oracle.P) -> None:
    same(decided(whole, consistent=True), whole, oracle.facts(whole, consistent=True))


@given(whole=plans(max_runners=6), models=faults(), consistent=st.booleans())
def test_facts_under_fault_models(
    whole: oracle.P, models: frozenset[str], consistent: bool
) -> None:
    decision = decided(whole, faults=models, consistent=consistent)
    same(decision, whole, oracle.facts(whole, faults=models, consistent=consistent))


@given(data=st.data(), whole=plans(min_runners=1, max_runners=6), models=faults())
def test_facts_under_assumptions(
    data: st.DataObject, whole: oracle.P, models: frozenset[str]
) -> None:
    assume(oracle.runner_paths(whole))
    constraint = data.draw(constraints(whole, faults=models))
    decision = decided(whole, faults=models, assumptions=[str(constraint)])
    same(decision, whole, oracle.facts(whole, faults=models, constraint=constraint))
    assert decision.contradictory == (decision.facts() is None)


@settings(max_examples=many(60))
@given(whole=plans(min_runners=11, max_runners=40, max_depth=6))
def test_both_ways_agree_on_larger_plans(whole: oracle.P) -> None:
    by_structure = decided(whole, solver="structural").facts()
    assert by_structure == decided(whole, solver="z3").facts()


@given(whole=plans(min_runners=1, max_runners=8), number=st.integers(0, 7))
def test_a_runner_that_never_fails_is_still_decided_by_structure(
    whole: oracle.P, number: int
) -> None:
    paths = oracle.runner_paths(whole)
    assume(paths)  # its only runner may be a completion runner at the end, which is dropped
    path = paths[number % len(paths)]
    assumption = f"{path} never fails"
    structural = decided(whole, assumptions=[assumption], solver="structural")
    wanted = oracle.facts(whole, constraint=lambda scenario: scenario[path] == "SUCCEEDED")
    same(structural, whole, wanted)


@both_solvers
@given(whole=plans(min_runners=1, max_runners=7), hopeless=st.sets(st.integers(0, 6)))
@example(oracle.plan(oracle.par_all("A", "B")), {0, 1})
@example(oracle.plan(oracle.par_all(oracle.par_any("A", "B"), "C")), {0, 1, 2})
def test_what_never_succeeds_need_not_fail_before_the_give_up(
    solver: SolverChoice, whole: oracle.P, hopeless: set[int]
) -> None:
    paths = [path for number, path in enumerate(oracle.runner_paths(whole)) if number in hopeless]
    decision = decided(
        whole, assumptions=[f"{path} never succeeds" for path in paths], solver=solver
    )
    wanted = oracle.facts(
        whole, constraint=lambda scenario: all(scenario[path] == "FAILED" for path in paths)
    )
    same(decision, whole, wanted)


@given(whole=plans())
def test_theorem_no_plan_is_stuck_by_default(whole: oracle.P) -> None:
    facts = decided(whole, solver="z3").facts()
    assert facts is not None
    assert facts.stuck == "never"


@given(whole=plans(max_runners=6), models=faults())
def test_theorem_the_two_endings_exclude_each_other(
    whole: oracle.P, models: frozenset[str]
) -> None:
    decision = decided(whole, faults=models, solver="z3")
    automaton, encoding = decision.deciders.compiled.automaton, decision.deciders.solver.encoding
    complete = encoding.triggered(automaton.complete)
    give_up = encoding.triggered(automaton.give_up)
    assert decision.deciders.solver.decide([f"(and {complete} {give_up})"]) == [False]
