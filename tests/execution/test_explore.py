"""Exploration: the engine as the third judge, next to z3 and brute force."""

from __future__ import annotations

from itertools import permutations, product
from typing import TYPE_CHECKING

import pytest
from hypothesis import example, given, settings

from gpsfsm.analysis.evaluate import Evaluator
from gpsfsm.execution.explore import Run, TooManyRunsError, explore
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.records import Kind, Status
from gpsfsm.model.capability import Binding, Interface, Outcomes, Provider
from gpsfsm.model.event import Outcome
from tests import oracle
from tests.cases import many
from tests.execution.support import compiled_of, without_ends
from tests.oracle import par_all, par_any, plan, rec, seq
from tests.strategies import faults, plans, plans_of_few_actions
from tests.support import decided, facts_as_dict

if TYPE_CHECKING:
    from gpsfsm.compile import Compiled

LIMIT = 1_000_000


def endings(runs: list[Run]) -> dict[str, str]:
    """How runs end, in the words of the facts."""
    seen = {run.status for run in runs}
    names = {"completes": "COMPLETED", "gives_up": "GAVE_UP", "stuck": "STUCK"}
    return {
        name: "never" if status not in seen else "always" if len(seen) == 1 else "sometimes"
        for name, status in names.items()
    }


def orphans(compiled: Compiled, runs: list[Run]) -> list[str]:
    numbers = {number for run in runs if run.status is Status.COMPLETED for number in run.active}
    return paths(compiled, numbers)


def unreachable(compiled: Compiled, models: frozenset[str]) -> list[str]:
    """The instances that no maximal run triggers."""
    runs = explore(without_ends(compiled), faults=models, orders=False, limit=LIMIT)
    triggered = {
        record.node - 1 for run in runs for record in run.records if record.kind is Kind.TRIGGERED
    }
    return paths(compiled, set(range(len(compiled.automaton.runners))) - triggered)


def paths(compiled: Compiled, numbers: set[int]) -> list[str]:
    automaton = compiled.automaton
    return [automaton.name(automaton.runner_node(number)) for number in sorted(numbers)]


def judged(whole: oracle.P, models: frozenset[str]) -> dict[str, object]:
    compiled = compiled_of(whole, models)
    runs = list(explore(compiled, faults=models, orders=False, limit=LIMIT))
    return {
        **endings(runs),
        "orphans": orphans(compiled, runs),
        "unreachable": unreachable(compiled, models),
        "fewest_failures_to_give_up": fewest(runs),
    }


def fewest(runs: list[Run]) -> int | None:
    """The fewest failures that the engine has seen when it gives up."""
    failures = (Outcome.FAILED, Outcome.NO_START)
    return min(
        (
            sum(outcome in failures for outcome in run.outcomes.values())
            for run in runs
            if run.status is Status.GAVE_UP
        ),
        default=None,
    )


@settings(max_examples=many(150))
@given(whole=plans(max_runners=5))
def test_the_engine_agrees_with_the_verdicts_and_with_brute_force(whole: oracle.P) -> None:
    judgement = judged(whole, frozenset())
    facts = facts_as_dict(decided(whole).facts())
    brute = oracle.facts(whole)
    assert facts is not None
    assert brute is not None
    assert judgement == {name: facts[name] for name in judgement}
    assert judgement == {name: brute[name] for name in judgement}


@settings(max_examples=many(100))
@given(whole=plans(max_runners=4), models=faults())
def test_so_it_does_under_every_fault_model(whole: oracle.P, models: frozenset[str]) -> None:
    judgement = judged(whole, models)
    facts = facts_as_dict(decided(whole, faults=models).facts())
    brute = oracle.facts(whole, faults=models)
    assert facts is not None
    assert brute is not None
    assert judgement == {name: facts[name] for name in judgement}
    assert judgement == {name: brute[name] for name in judgement}


@settings(max_examples=many(100))
@given(whole=plans_of_few_actions(max_runners=5), models=faults())
@example(plan(par_all("Go", "Go")), frozenset())
@example(plan(par_all(seq("Say", "Go"), par_any("Go", "Go"))), frozenset())
def test_the_engine_gives_up_after_as_few_failures_as_the_facts_say_and_no_fewer(
    whole: oracle.P, models: frozenset[str]
) -> None:
    """In a consistent world, where failures that come later are sure to come."""
    compiled = compiled_of(whole, models)
    actions = [runner.action for runner in compiled.automaton.plan.runners]
    consistent = [
        run
        for run in explore(compiled, faults=models, orders=False, limit=LIMIT)
        if len({(actions[number], outcome) for number, outcome in run.outcomes.items()})
        == len({actions[number] for number in run.outcomes})
    ]
    facts = decided(whole, faults=models, consistent=True).facts()
    assert facts is not None
    assert facts.fewest_failures_to_give_up == fewest(consistent)


@settings(max_examples=many(60))
@given(whole=plans(max_runners=4), models=faults())
def test_orders_change_neither_the_endings_nor_who_is_active(
    whole: oracle.P, models: frozenset[str]
) -> None:
    compiled = compiled_of(whole, models)
    some, every = (
        {
            (frozenset(run.outcomes.items()), run.status, run.active)
            for run in explore(compiled, faults=models, orders=orders, limit=LIMIT)
        }
        for orders in (False, True)
    )
    assert some == every


@settings(max_examples=many(60))
@given(whole=plans(max_runners=4), models=faults())
def test_every_run_is_one_of_the_automaton_and_replays(
    whole: oracle.P, models: frozenset[str]
) -> None:
    compiled = compiled_of(whole, models)
    evaluator = Evaluator(compiled.automaton)
    for run in explore(compiled, faults=models, limit=LIMIT):
        decisions = dict(run.outcomes)
        rest = Outcome.HANG if run.status is Status.STUCK else Outcome.SUCCEEDED
        ends = evaluator.run(lambda n, library=decisions, rest=rest: library.get(n, rest)).ends
        assert ends.value == run.status.value
        if "no-start" in models:
            continue  # there every instance has a runner to itself
        kernel = Kernel(compiled)
        again = [record for happened in run.inputs for record in kernel.step(happened)[0]]
        assert tuple(again) == run.records


def test_all_orders_of_independent_instances() -> None:
    runs = list(explore(compiled_of(plan(par_all("A", "B", "C")))))
    orders = [tuple(run.outcomes) for run in runs if run.status is Status.COMPLETED]
    assert sorted(orders) == sorted(permutations(range(3)))
    # the first failure ends the run: one, or one or two successes before it
    assert len(runs) - len(orders) == 3 + 3 * 2 + 3 * 2


def test_each_set_of_answers_once_without_orders() -> None:
    runs = list(explore(compiled_of(plan(par_all("A", "B", "C"))), orders=False))
    assert len(runs) == len({frozenset(run.outcomes.items()) for run in runs})
    whole = [run for run in runs if len(run.outcomes) == 3]
    assert len(whole) == len(list(product((0, 1), repeat=3))) - 4  # two failures never both come


def test_an_instance_that_is_triggered_with_completion_is_active_then() -> None:
    compiled = compiled_of(plan(par_any(seq(), seq("Y", "Z"))))
    (run,) = explore(compiled)
    assert run.status is Status.COMPLETED
    assert run.active == (0,)


def test_a_hang_gets_a_plan_stuck() -> None:
    compiled = compiled_of(plan(par_all("A", "B")))
    stuck = [run for run in explore(compiled, faults=["hang"]) if run.status is Status.STUCK]
    assert [run.active for run in stuck] == [(1,), (0,), (0, 1)]
    assert [run.outcomes for run in stuck][2] == {}
    assert {run.status for run in explore(compiled)} == {Status.COMPLETED, Status.GAVE_UP}


def test_one_that_does_not_start_fails_later() -> None:
    compiled = compiled_of(plan("A", rec("B")), ["no-start"])
    runs = list(explore(compiled, faults=["no-start"]))
    assert [tuple(map(str, run.outcomes.values())) for run in runs] == [
        ("SUCCEEDED",),
        *[(first, second) for first in ("FAILED", "NO_START") for second in OUTCOMES],
    ]
    never = runs[4]
    assert [record.kind for record in never.records if record.node == 1] == ["TRIGGERED", "FAILED"]


OUTCOMES = ("SUCCEEDED", "FAILED", "NO_START")


@pytest.mark.parametrize(
    ("outcomes", "statuses"),
    [
        (Outcomes(never_fails=True), {Status.COMPLETED}),
        (Outcomes(never_succeeds=True), {Status.GAVE_UP}),
        (Outcomes(may_hang=True), {Status.COMPLETED, Status.GAVE_UP, Status.STUCK}),
        (Outcomes(never_fails=True, never_succeeds=True, may_hang=True), {Status.STUCK}),
    ],
)
def test_declared_outcomes_count(outcomes: Outcomes, statuses: set[Status]) -> None:
    from gpsfsm.compile import compile_plan
    from tests.support import plan_of

    binding = Binding(Interface("A"), Provider("B", "A", outcomes=outcomes), {})
    compiled = compile_plan(plan_of(plan("A")), bindings=(binding,))
    assert {run.status for run in explore(compiled)} == statuses


def test_the_order_of_runs_is_fixed_and_the_limit_holds() -> None:
    compiled = compiled_of(plan(par_any("A", "B"), rec("C")))
    runs = list(explore(compiled))
    assert runs == list(explore(compiled, limit=len(runs)))
    few = explore(compiled, limit=len(runs) - 1)
    assert [next(few) for _ in runs[1:]] == runs[:-1]
    with pytest.raises(TooManyRunsError, match=f"more than {len(runs) - 1} runs"):
        next(few)
