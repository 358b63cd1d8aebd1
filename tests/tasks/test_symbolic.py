"""The two deciders of tasks beside each other, and both beside brute force."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import assume, event, given, settings
from hypothesis import strategies as st

from gpsfsm.analysis.constraints import constraints_of
from gpsfsm.compile import compile_plan
from gpsfsm.errors import InternalError
from gpsfsm.tasks.counterexample import search
from gpsfsm.tasks.deciding import Effort, decide_task
from gpsfsm.tasks.load import formula_text
from gpsfsm.tasks.ltlf import parse_formula
from gpsfsm.tasks.machine import machine_of
from gpsfsm.tasks.monitor import Matching, RuleMonitor
from gpsfsm.tasks.steps import StepsMonitor
from gpsfsm.tasks.symbolic import leaving_runs
from gpsfsm.tasks.task import Rule, Task
from tests.oracle import P, par_all, par_any, plan, rec, seq
from tests.strategies import constraints
from tests.support import plan_of
from tests.tasks.reference import actions_of, all_traces, holds, left_after
from tests.tasks.test_deciding import (
    FORMULAS,
    KEYS,
    PATTERNS,
    RULES,
    STEPS,
    answers,
    small_plans,
    task_of,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.compile import Compiled
    from gpsfsm.tasks.counterexample import Left
    from gpsfsm.tasks.monitor import Demand

few = settings(max_examples=max(10, settings.default.max_examples // 4))
"""z3 takes its time."""

OPTIONS = st.fixed_dictionaries(
    {
        "faults": st.sampled_from([(), ("hang",), ("no-start",), ("hang", "no-start")]),
        "consistent": st.booleans(),
    }
)
FREE = st.sampled_from([{}, {"others": True}, {"allowed": (PATTERNS["D"],)}])


class Problem:
    """A plan and the demand of a task on it, the first if there are several."""

    def __init__(self, whole: P, task: Task, **options: object) -> None:
        self.whole = whole
        parsed = plan_of(whole)
        self.constraints: Constraints = constraints_of(parsed, **options)  # type: ignore[arg-type]
        self.compiled: Compiled = compile_plan(parsed, start_chain=self.constraints.no_start)
        matching = Matching(parsed.runners)
        self.demand: Demand = (
            StepsMonitor(task, matching)
            if task.steps
            else RuleMonitor(task.rules[0], task.patterns, matching)
        )

    def searched(self) -> dict[tuple[object, ...], Left]:
        """The plainest run of each kind."""
        results: dict[tuple[object, ...], Left] = {}
        for left in search(self.compiled, self.constraints, self.demand):
            results.setdefault(left.violation.key, left)
        return results

    def solved(self) -> dict[tuple[object, ...], Left]:
        """The same by z3."""
        runs = leaving_runs(self.compiled, self.constraints, self.demand)
        return {left.violation.key: left for left in runs}


def compare(problem: Problem) -> dict[tuple[object, ...], Left]:
    """Both find the same kinds, and of each the same instances that fail."""
    searched, solved = problem.searched(), problem.solved()
    assert {key: left.failing for key, left in searched.items()} == {
        key: left.failing for key, left in solved.items()
    }
    ranks = [(len(left.failing), left.failing) for left in solved.values()]
    assert ranks == sorted(ranks)
    for each in (searched, solved):
        ranks = [(len(left.failing), left.failing) for left in each.values()]
        assert ranks == sorted(ranks)
    return solved


def first(actual: Sequence[tuple[int, ...]]) -> tuple[int, ...]:
    """The canonical one of sets of failing instances."""
    return min(actual, key=lambda failing: (len(failing), failing))


@few
@given(st.one_of(st.tuples(STEPS, small_plans(4)), answers()), OPTIONS, FREE)
def test_steps(expected: tuple[list[tuple[str, ...]], P], options: dict, more: dict) -> None:
    steps, whole = expected
    actions = actions_of(whole)
    assume(len(actions) <= (5 if not options["faults"] else 4))
    problem = Problem(whole, task_of(steps, **more), **options)
    solved = compare(problem)
    free = frozenset({KEYS["D"]}) if "allowed" in more else frozenset()
    wanted = [[KEYS[name] for name in step] for step in steps]
    failing = [
        trace.failing(place)
        for _, trace in all_traces(
            whole, faults=frozenset(options["faults"]), consistent=options["consistent"]
        )
        if (place := left_after(trace, wanted, actions, allowed=free, others="others" in more))
        is not None
    ]
    event(f"left: {bool(failing)}")
    assert bool(failing) == bool(solved)
    if failing:
        assert next(iter(solved.values())).failing == first(failing)


def rule_of(text: str) -> Task:
    rule = Rule(text, text, parse_formula(text))
    return Task(rules=(rule,), patterns=tuple(PATTERNS.values()))


def check_rule(whole: P, text: str, options: dict) -> None:
    task = rule_of(text)
    solved = compare(Problem(whole, task, **options))
    formula = task.rules[0].formula
    meant = {name: frozenset({KEYS[name]}) for name in KEYS}
    traces = all_traces(
        whole, faults=frozenset(options["faults"]), consistent=options["consistent"]
    )
    wrong = any(not holds(formula, trace, meant, actions_of(whole)) for _, trace in traces)
    event(f"left: {wrong}")
    assert wrong == bool(solved)


@few
@given(
    small_plans(4),
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
    check_rule(whole, f"F completes -> ({text})" if completed else text, options)


@few
@given(small_plans(4), FORMULAS, OPTIONS)
def test_formulas(whole: P, text: str, options: dict) -> None:
    check_rule(whole, text, options)


@few
@given(small_plans(4), STEPS, st.data())
def test_assumptions(whole: P, steps: list[tuple[str, ...]], data: st.DataObject) -> None:
    assume(actions_of(whole))
    constraint = data.draw(constraints(whole, max_leaves=3))
    traces = all_traces(whole, constraint=constraint)
    assume(traces)
    task = task_of(steps)
    plain = Problem(whole, task)
    options = constraints_of(plan_of(whole), assumptions=[str(constraint)])
    solved = decide_task(plain.compiled, options, task, effort=Effort("z3"))
    searched = decide_task(plain.compiled, options, task, effort=Effort("structural"))
    wanted = [[KEYS[name] for name in step] for step in steps]
    wrong = any(left_after(trace, wanted, actions_of(whole)) is not None for _, trace in traces)
    assert solved.fulfilled == searched.fulfilled == (not wrong)
    departures = [
        {(each.rule, each.message) for each in one.departures} for one in (solved, searched)
    ]
    assert departures[0] == departures[1]


def test_an_input_that_comes_twice_at_once_counts_twice() -> None:
    """A defect of the past: the plan was taken to be stuck (semantics, 3.3: empty controls)."""
    whole = plan(par_all(seq(), seq()), "demo/A")
    assert compare(Problem(whole, task_of([("A",)]))) == {}


def test_the_plainest_run_comes_first_also_if_it_is_the_longer_one() -> None:
    """A defect of the past: a second failure breaks the rule at once, one only at the end."""
    whole = plan(par_any("demo/A", "demo/A", "demo/D"))
    problem = Problem(whole, rule_of("G (fails(A) -> X (!fails(A) U start(A)))"))
    (left,) = compare(problem).values()
    assert left.failing == (0,)


def test_the_latest_outcome_need_not_be_needed_by_what_came_before() -> None:
    """The parallel_any is over when 2 succeeds, and 1 can start after A has."""
    whole = plan(par_any(seq("demo/D", "demo/B x=1"), "demo/D"), "demo/A", "demo/D")
    (left,) = compare(Problem(whole, rule_of("!F (start(A) & F start(B))"))).values()
    assert [number for what, number in left.events if what == "STARTED"][-2:] == [3, 1]


# -- wide plans, which the search cannot decide ---------------------------------------------------

WIDTHS = [16, 100]


def wide(width: int) -> P:
    units = [f"demo/B x={number + 3}" for number in range(width)]
    return plan("demo/A", par_all(*units), "demo/D")


@pytest.mark.parametrize("width", WIDTHS)
def test_wide_plans_fulfil_their_steps(width: int) -> None:
    problem = Problem(wide(width), task_of([("A",), ("D",)], others=True))
    assert problem.solved() == {}


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize(
    ("text", "failing"),
    [
        ("!start(*) W start(A)", None),
        ("!start(D) W succeeds(A)", None),
        ("F completes -> G (start(A) -> F start(D))", None),
        ("F completes -> F succeeds(D)", None),
        ("F (start(A) & X F fails(*)) -> F gives_up", None),
        ("F start(D)", (0,)),
        ("!F fails(*)", (0,)),
        ("F succeeds(A) -> F start(D)", (1,)),
        ("F completes", (0,)),
    ],
)
def test_rules_of_wide_plans(width: int, text: str, failing: tuple[int, ...] | None) -> None:
    failings = [left.failing for left in Problem(wide(width), rule_of(text)).solved().values()]
    assert failings == ([] if failing is None else [failing])


def test_nested_wide_plans() -> None:
    units = [par_any(seq(f"demo/B x={3 * at + 5}", "demo/D"), "demo/D") for at in range(20)]
    whole = plan("demo/A", par_all(*units), rec("demo/D"), "demo/A")
    assert not Problem(whole, rule_of("F fails(*) | F completes")).solved()
    # Both ways of the first unit fail, and so does the recovery.
    (left,) = Problem(whole, rule_of("F gives_up -> F fails(A)")).solved().values()
    assert left.failing == (1, 3, 61)


def test_what_a_search_gives_up_is_decided_by_z3() -> None:
    whole = wide(24)
    task = Task(
        steps=task_of([("A",), ("D",)]).steps,
        rules=rule_of("!start(D) W succeeds(A)").rules + rule_of("F completes").rules,
        patterns=tuple(PATTERNS.values()),
        others=True,
    )
    problem = Problem(whole, task)
    decision = decide_task(problem.compiled, problem.constraints, task)
    assert decision.undecided == ()
    assert [each.message for each in decision.departures] == [
        "a run breaks a rule of the task: F completes"
    ]
    alone = decide_task(
        problem.compiled, problem.constraints, task, effort=Effort("structural", moves=1_000)
    )
    assert alone.undecided == ("the steps of the task", "the rule 'F completes' of the task")


def test_a_difference_between_the_deciders_is_a_defect(monkeypatch: pytest.MonkeyPatch) -> None:
    whole, task = plan("demo/A"), task_of([("D",)])
    problem = Problem(whole, task)
    monkeypatch.setattr("gpsfsm.tasks.deciding.search", lambda *_, **__: iter(()))
    with pytest.raises(InternalError, match="disagree on the task"):
        decide_task(problem.compiled, problem.constraints, task)
    assert not decide_task(
        problem.compiled, problem.constraints, task, effort=Effort("structural")
    ).departures


def test_a_template_is_followed_without_circles() -> None:
    """So z3 needs few changes of the state, however many events there are."""
    whole = plan("demo/A", "demo/B x=1", "demo/A", "demo/D")
    for template in ("last", "response", "alternate_response", "chain_succession"):
        names = ("A",) if template == "last" else ("A", "B")
        problem = Problem(whole, rule_of(formula_text(template, names)))
        depth = machine_of(problem.demand.branching(), problem.constraints).depth
        assert depth is not None
        assert depth <= 4
