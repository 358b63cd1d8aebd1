"""Swallowed failures against brute force, and the scenarios that show them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from gpsfsm.analysis.context import Context
from gpsfsm.analysis.decisions.swallowed import swallowed_claim
from gpsfsm.model.event import End, Outcome
from tests import oracle
from tests.analysis.test_capability_facts import FREE, SOLVERS, all_solvers, decided_over
from tests.cases import many
from tests.oracle import par_all, par_any, plan, rec, seq
from tests.oracle.capabilities import Described, World
from tests.oracle.goals import missed_goals
from tests.strategies import constraints, faults
from tests.strategies_capabilities import libraries, plans_over, with_own_providers

if TYPE_CHECKING:
    from gpsfsm.analysis.decide import Decided
    from gpsfsm.analysis.options import SolverChoice
    from tests.oracle.runs import Run

LIBRARY = tuple(
    Described(name, achieves=name not in ("Log", "Look")) for name in ("Go", "Say", "Log", "Look")
)
GO = "/Plan/Runner[1]"
IN = "/Plan/Control[1]"

BY_HAND: dict[str, tuple[oracle.P, tuple[str, ...]]] = {
    "nothing behind the alternative": (plan("Go", rec("Go")), ()),
    "a log behind it": (plan("Go", rec("Go", "Log")), (GO,)),
    "a log in place of it": (plan("Go", rec("Log"), "Go"), (GO,)),
    "a parallel_any of logs": (plan("Go", rec(par_any("Log", "Look"))), (GO,)),
    "no recovery": (plan("Go", "Log"), ()),
    "speaking is an alternative": (plan("Go", rec("Say")), ()),
    "what only looks is no goal": (plan("Look", rec("Log")), ()),
    "one of a parallel_any is enough": (plan(par_any("Go", "Go"), rec("Log")), (IN,)),
    "a second recovery": (plan("Go", rec("Go"), rec("Log")), (GO,)),
    "the smallest goal": (plan("Go", rec("Go", rec("Log"))), (f"{IN}/Runner[1]",)),
    "two sizes": (
        plan(seq("Go", rec("Log"), "Go"), rec("Log")),
        (IN, f"{IN}/Runner[1]"),
    ),
    "an alternative around it": (plan(seq("Go", rec("Go")), rec("Go")), ()),
    "a swallower around it": (
        plan(seq("Go", rec("Go"), "Go"), rec("Log")),
        (IN, f"{IN}/Runner[1]"),
    ),
    "another unit of a parallel_any has done it": (plan(par_any(seq("Go", rec("Go")), "Go")), ()),
    "a log beside it": (
        plan(par_any(seq("Go", rec("Go")), "Log")),
        (f"{IN}/Control[1]/Runner[1]",),
    ),
    "a parallel_all of both": (
        plan(par_all("Go", rec("Log"), "Go", rec("Go"))),
        (f"{IN}/Runner[1]",),
    ),
    "a look is recovered by speaking": (plan(seq("Look", rec("Say"), "Go"), rec("Go")), ()),
    "a dead recovery": (plan(rec("Go", rec("Log")), "Go"), ()),
    "behind it nothing but an empty recovery": (plan("Go", rec()), ()),
}


def brute_force(world: World, whole: oracle.P) -> set[str]:
    return {goal for run in world.runs for goal in missed(world, whole, run)}


def missed(world: World, whole: oracle.P, run: Run) -> frozenset[str]:
    achieving = {one.path for one in world.instances if one.described and one.described.achieves}
    return missed_goals(whole, achieving, run)


def same(decided: Decided, world: World, whole: oracle.P) -> None:
    facts = decided.facts()
    if facts is None:
        assert not world.runs
        return
    wanted = brute_force(world, whole)
    assert set(facts.swallowed) == wanted
    assert len(facts.swallowed) == len(wanted)


@all_solvers
@pytest.mark.parametrize("name", BY_HAND)
def test_by_hand(solver: SolverChoice, name: str) -> None:
    whole, wanted = BY_HAND[name]
    whole, library = with_own_providers(whole, LIBRARY)
    facts = decided_over(whole, library, solver=solver).facts()
    assert facts is not None
    assert facts.swallowed == wanted
    assert brute_force(World(whole, library), whole) == set(wanted)


@settings(max_examples=many(150))
@given(data=st.data())
def test_free_outcomes(data: st.DataObject) -> None:
    library = data.draw(libraries(goals=True))
    whole = data.draw(plans_over(library, max_runners=8))
    world = World(whole, library)
    for solver in SOLVERS:
        same(decided_over(whole, library, solver=solver), world, whole)


@settings(max_examples=many(100))
@given(data=st.data(), models=faults(), consistent=st.booleans())
def test_fault_models_and_declared_outcomes(
    data: st.DataObject, models: frozenset[str], consistent: bool
) -> None:
    library = data.draw(libraries(goals=True, outcomes=data.draw(st.booleans())))
    whole = data.draw(plans_over(library, max_runners=5))
    world = World(whole, library, faults=models, consistent=consistent)
    same(decided_over(whole, library, faults=models, consistent=consistent), world, whole)


@settings(max_examples=many(60))
@given(data=st.data(), models=faults())
def test_assumptions(data: st.DataObject, models: frozenset[str]) -> None:
    library = data.draw(libraries(goals=True))
    whole = data.draw(plans_over(library, max_runners=5))
    assume(oracle.runner_paths(whole))
    constraint = data.draw(constraints(whole, faults=models))
    world = World(whole, library, faults=models, constraint=constraint)
    answers = decided_over(whole, library, faults=models, assumptions=(str(constraint),))
    same(answers, world, whole)


@settings(max_examples=many(80))
@given(data=st.data(), models=st.sampled_from([FREE, FREE, frozenset({"hang"})]))
@example(data=None, models=FREE).via("two ways of the same size")
def test_scenarios_are_the_canonical_ones(
    data: st.DataObject | None, models: frozenset[str]
) -> None:
    if data is None:
        whole, library = with_own_providers(plan(seq("Go", "Go"), rec("Log")), LIBRARY)
    else:
        library = data.draw(libraries(goals=True))
        whole = data.draw(plans_over(library, max_runners=7 if not models else 5))
    world = World(whole, library, faults=models)
    answers = decided_over(whole, library, faults=models)
    facts = answers.facts()
    assert facts is not None
    context = Context(answers)
    for goal, path in zip(answers.answers["swallowed"], facts.swallowed, strict=True):
        claim = swallowed_claim(answers.deciders.compiled, goal)
        outcome_of = context._canonical(claim)
        assert outcome_of is not None
        wanted = oracle.canonical_scenario(
            whole,
            lambda run, path=path: path in missed(world, whole, run),
            faults=world.faults,
            constraint=world.allows,
        )
        assert wanted is not None
        outcomes = [outcome_of(number) for number in range(facts.runners)]
        assert outcomes == [Outcome(each) for each in wanted.outcomes]
        scenario = context.scenario("GP315", claim)
        if scenario is not None:
            assert scenario.ends is End.COMPLETED


@settings(max_examples=many(30))
@given(data=st.data())
def test_both_ways_agree_on_larger_plans(data: st.DataObject) -> None:
    library = data.draw(libraries(goals=True))
    whole = data.draw(plans_over(library, max_runners=30))
    one, other = (decided_over(whole, library, solver=each) for each in ("structural", "z3"))
    assert one.answers["swallowed"] == other.answers["swallowed"]
