"""The proof that tasks are kept, held against the search and the brute force behind it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import assume, event, given, settings
from hypothesis import strategies as st

from gpsfsm.analysis.constraints import constraints_of
from gpsfsm.analysis.options import DEFAULT_RLIMIT, InconclusiveError
from gpsfsm.compile import compile_plan
from gpsfsm.compile.plan_text import read_plan
from gpsfsm.errors import InternalError
from gpsfsm.model.event import Outcome
from gpsfsm.tasks.deciding import Basis, Effort, decide_task
from gpsfsm.tasks.following import Settled
from gpsfsm.tasks.load import formula_text
from gpsfsm.tasks.monitor import Matching, RuleMonitor
from gpsfsm.tasks.proof import played, problem_text, suspect
from gpsfsm.tasks.task import Pattern, Task
from tests.oracle import P, par_all, par_any, plan, rec, seq
from tests.strategies import constraints
from tests.support import plan_of
from tests.tasks.reference import actions_of
from tests.tasks.test_deciding import (
    FORMULAS,
    PATTERNS,
    RULES,
    STEPS,
    answers,
    small_plans,
    task_of,
)
from tests.tasks.test_symbolic import FREE, OPTIONS, Problem, rule_of, wide

if TYPE_CHECKING:
    from gpsfsm.tasks.deciding import Decision

few = settings(max_examples=max(10, settings.default.max_examples // 2))


def refuted(problem: Problem) -> bool:
    return (
        suspect(problem.compiled, problem.constraints, [problem.demand], rlimit=DEFAULT_RLIMIT)
        is None
    )


def check(problem: Problem) -> None:
    """What is proved is true; where one thing happens after the other, what is true is proved."""
    kept = not problem.searched()
    alone = Settled(problem.compiled.automaton).alone
    proved = refuted(problem)
    event(f"kept: {kept}, one at a time: {alone}, proved: {proved}")
    assert kept or not proved
    if alone:
        assert proved == kept


@few
@given(st.one_of(st.tuples(STEPS, small_plans(5)), answers()), OPTIONS, FREE)
def test_steps(expected: tuple[list[tuple[str, ...]], P], options: dict, more: dict) -> None:
    steps, whole = expected
    check(Problem(whole, task_of(steps, **more), **options))


@few
@given(
    small_plans(5),
    RULES,
    st.sampled_from(["start", "success", "failure"]),
    st.booleans(),
    OPTIONS,
)
def test_templates(
    whole: P, rule: tuple[str, tuple[str, ...], int], after: str, completed: bool, options: dict
) -> None:
    template, names, times = rule
    text = formula_text(template, names, after=after, times=times)  # type: ignore[arg-type]
    check(Problem(whole, rule_of(f"F completes -> ({text})" if completed else text), **options))


@few
@given(small_plans(5), FORMULAS, OPTIONS)
def test_formulas(whole: P, text: str, options: dict) -> None:
    check(Problem(whole, rule_of(text), **options))


@few
@given(small_plans(4), STEPS, st.data())
def test_assumptions(whole: P, steps: list[tuple[str, ...]], data: st.DataObject) -> None:
    assume(actions_of(whole))
    problem = Problem(whole, task_of(steps))
    options = constraints_of(
        plan_of(whole), assumptions=[str(data.draw(constraints(whole, max_leaves=3)))]
    )
    alone = decide_task(problem.compiled, options, task_of(steps), effort=Effort("structural"))
    scenario = suspect(problem.compiled, options, [problem.demand], rlimit=DEFAULT_RLIMIT)
    assert alone.fulfilled or scenario is not None


KEPT = [
    (plan("demo/A", rec("demo/D"), "demo/B x=1"), [("A", "D"), ("B",)], {}),
    (plan("demo/A", par_all("demo/D", "demo/D"), "demo/B x=1"), [("A",), ("B",)], {"others": True}),
    (wide(40), [("A",), ("D",)], {"others": True}),
]


@pytest.mark.parametrize(("whole", "steps", "more"), KEPT)
def test_plans_that_keep_their_task_in_any_order(
    whole: P, steps: list[tuple[str, ...]], more: dict
) -> None:
    assert refuted(Problem(whole, task_of(steps, **more)))


@pytest.mark.parametrize("faults", [(), ("no-start",), ("hang",)])
def test_one_change_of_a_plan_is_enough_to_lose_the_proof(faults: tuple[str, ...]) -> None:
    steps = [("A", "D"), ("B",), ("C",)]
    right = ["demo/A", rec("demo/D"), "demo/B x=1", "demo/B x=2"]
    assert refuted(Problem(plan(*right), task_of(steps), faults=faults))
    for place in range(len(right)):
        rest = right[:place] + right[place + 1 :]
        if rest[0] is not right[1]:
            assert not refuted(Problem(plan(*rest), task_of(steps), faults=faults))


def test_a_scenario_of_the_problem_is_played() -> None:
    problem = Problem(plan("demo/A", "demo/D"), task_of([("A",), ("B",)]))
    scenario = suspect(
        problem.compiled, problem.constraints, [problem.demand], rlimit=DEFAULT_RLIMIT
    )
    assert scenario is not None
    left = played(problem.compiled, problem.constraints, problem.demand, scenario)
    assert left is not None
    assert left.violation.code == "GP601"
    failing = (Outcome.FAILED, Outcome.SUCCEEDED)
    assert played(problem.compiled, problem.constraints, problem.demand, failing) is None


@pytest.mark.parametrize(
    ("need", "rule", "kept"),
    [
        (2, "!F (start(D) & X F start(A))", True),
        (2, "F completes -> F (succeeds(A) | succeeds(B))", True),
        (1, "F completes -> F (succeeds(A) | succeeds(B))", False),
        (2, "F completes -> F succeeds(A)", False),
    ],
)
def test_trees_that_need_some_of_several(need: int, rule: str, kept: bool) -> None:
    text = (
        '<root BTCPP_format="4" main_tree_to_execute="M"><BehaviorTree ID="M"><Sequence>'
        f'<Parallel success_count="{need}" failure_count="{4 - need}"><A/><B/><C/></Parallel><D/>'
        "</Sequence></BehaviorTree></root>"
    )
    whole = read_plan(text).plan
    assert whole is not None
    compiled, (demand,) = compile_plan(whole), rule_of(rule).rules
    named = {"A": Pattern("A", ("A",)), "B": Pattern("B", ("B",)), "D": Pattern("D", ("D",))}
    monitor = RuleMonitor(demand, tuple(named.values()), Matching(whole.runners))
    scenario = suspect(compiled, constraints_of(whole), [monitor], rlimit=DEFAULT_RLIMIT)
    assert kept or scenario is not None
    task = Task(rules=(demand,), patterns=tuple(named.values()))
    decided = decide_task(compiled, constraints_of(whole), task)
    assert decided.fulfilled is kept
    assert decided.decided_by == ("z3" if kept else "replay")


# -- what a decision rests on ---------------------------------------------------------------------


def decision(whole: P, task: Task, **effort: object) -> Decision:
    problem = Problem(whole, task)
    return decide_task(problem.compiled, problem.constraints, task, effort=Effort(**effort))  # type: ignore[arg-type]


TWO = Task(
    steps=task_of([("A",), ("D",)]).steps,
    rules=rule_of("!start(D) W succeeds(A)").rules + rule_of("F completes").rules,
    patterns=tuple(PATTERNS.values()),
)


def test_each_demand_says_what_decided_it() -> None:
    verdict = decision(plan("demo/A", "demo/D"), TWO)
    assert verdict.basis == (
        Basis("the steps of the task", "z3"),
        Basis("the rule '!start(D) W succeeds(A)' of the task", "z3"),
        Basis("the rule 'F completes' of the task", "replay"),
    )
    assert verdict.decided_by == "replay"
    assert decision(plan("demo/A", "demo/D"), task_of([("A",), ("D",)])).decided_by == "z3"


@pytest.mark.parametrize("effort", [{"solver": "structural"}, {"rlimit": 100}])
def test_without_a_proof_the_search_decides_and_that_is_said(effort: dict) -> None:
    verdict = decision(plan("demo/A", "demo/D"), task_of([("A",), ("D",)]), **effort)
    assert verdict.fulfilled
    assert verdict.decided_by == "search"


def test_a_text_that_is_too_long_is_not_read() -> None:
    problem = Problem(plan("demo/A", "demo/D"), task_of([("A",), ("D",)]))
    _, text = problem_text(problem.compiled, problem.constraints, [problem.demand])
    with pytest.raises(InconclusiveError):
        suspect(problem.compiled, problem.constraints, [problem.demand], rlimit=10 * len(text) - 1)


def test_an_undecided_plan_rests_on_nothing() -> None:
    task = task_of([("A",), ("D",)], others=True)
    verdict = decision(wide(12), task, solver="structural", moves=100)
    assert verdict.fulfilled is None
    assert verdict.decided_by is None


def test_a_plan_without_demands_rests_on_nothing() -> None:
    problem = Problem(plan("demo/A"), rule_of("F start(A)"))
    assert decide_task(problem.compiled, problem.constraints, Task()).decided_by is None


@pytest.mark.parametrize(
    "whole",
    [
        plan("demo/A", par_any("demo/D", "demo/D"), "demo/B x=1"),
        plan(par_all(seq("demo/A", "demo/B x=1"), "demo/D")),
    ],
)
def test_where_the_problem_holds_too_many_runs_z3_is_asked_about_those_there_are(whole: P) -> None:
    """A step beside others can come twice in the problem, or before what it follows."""
    task = task_of([("A",), ("B",)], others=True)
    assert not refuted(Problem(whole, task))
    assert decision(whole, task).decided_by == "z3"


def test_a_large_plan_that_the_search_gets_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    """No other question is put to z3 about so many runners: the scenario of this one is played."""
    whole = plan(*["demo/A"] * 250, "demo/D")
    task = rule_of("!start(D) W fails(A)")
    monkeypatch.setattr("gpsfsm.tasks.deciding.search", lambda *_, **__: iter(()))
    with pytest.raises(InternalError, match="disagree on the task"):
        decision(whole, task)


def test_what_the_search_gives_up_does_not_spoil_the_proof_of_the_rest() -> None:
    task = Task(
        steps=task_of([("A",), ("D",)]).steps,
        rules=rule_of("F completes").rules,
        patterns=tuple(PATTERNS.values()),
        others=True,
    )
    verdict = decision(wide(24), task)
    assert [each.decided_by for each in verdict.basis] == ["z3", "replay"]


def test_the_problem_grows_with_the_plan_and_not_with_the_task_too() -> None:
    sizes = []
    for size in (20, 40):
        steps = [("A",), ("B",), ("C",), ("D",)] * (size // 4)
        actions = ["demo/A", "demo/B x=1", "demo/B x=2", "demo/D"] * (size // 4)
        problem = Problem(plan(*actions), task_of(steps))
        sizes.append(len(problem_text(problem.compiled, problem.constraints, [problem.demand])[1]))
    assert sizes[1] < 2.2 * sizes[0]
