"""Mutation: what is changed, what counts, and what is missed."""

from __future__ import annotations

from collections import Counter

import pytest
from hypothesis import example, given, settings

from gpsfsm.checking import CheckOptions
from gpsfsm.checking.selection import Selection
from gpsfsm.compile.plan_text import read_plan
from gpsfsm.equivalence import compare
from gpsfsm.errors import UsageError
from gpsfsm.fuzzing.mutation import Notice, mutate
from gpsfsm.fuzzing.operators import Node, Tree, operators, written
from gpsfsm.syntax import Limits, parse
from gpsfsm.tasks.load import read_task
from tests.cases import many
from tests.fuzzing.support import control, go, plan
from tests.oracle import P, R, to_xml
from tests.strategies import plans
from tests.support import plan_of

TASK = read_task(
    b"""
actions:
  first: {interface: A, x: 1}
  other: {interface: C}
  second: {interface: B}
steps:
  - do: first
    else: other
  - do: second
"""
)
OF_TASK = CheckOptions(task=TASK, selection=Selection.of(("GP6",), ()))
GOOD = plan(go("A", x="1"), control("recovery", go("C")), go("B"))


def by_operator(text: str) -> dict[str, list[str]]:
    """The texts of all mutants, without line ends and providers, in the form of ``plan``."""
    whole = plan_of(text)
    results: dict[str, list[str]] = {}
    for operator in operators():
        for mutation in operator.mutations(whole):
            tree = Tree(whole)
            mutation.change(tree)
            lines = (line.strip() for line in str(tree).splitlines())
            results.setdefault(operator.name, []).append("".join(lines))
    return results


def test_all_mutants_of_a_small_plan() -> None:
    a, b = go("A", x="1"), go("B")
    mutants = by_operator(plan(a, control("recovery", b)))
    assert mutants == {
        "control-type": [
            plan(a, control(word, b)) for word in ("sequential", "parallel_any", "parallel_all")
        ],
        "drop": [
            plan(control("recovery", b)),
            plan(a),
            plan(a, '<Control type="recovery"/>'),
        ],
        "parameter": [
            plan(go("A", x="2"), control("recovery", b)),
            plan(go("A"), control("recovery", b)),
        ],
        "rename": [
            plan(a.replace('"a/A"', '"a/ARunner"', 1), control("recovery", b)),
            plan(a, control("recovery", b.replace('"a/B"', '"a/BRunner"', 1))),
        ],
        "renest": [plan(a, b), plan(a, '<Control type="recovery"/>', b)],
        "replace": [plan(b, control("recovery", b)), plan(a, control("recovery", a))],
        "swap": [plan(control("recovery", b), a)],
    }


def test_children_are_moved_into_the_control_before_them() -> None:
    a, b = go("A"), go("B")
    mutants = by_operator(plan(control("parallel_all", a), b))
    assert plan(control("parallel_all", a, b)) in mutants["renest"]


@pytest.mark.parametrize(
    ("value", "other"),
    [("true", "false"), ("7", "8"), ("1.5", "2.5"), ("1e300", "0.0"), ("door", "not door")],
)
def test_a_changed_value_has_the_type_of_the_old_one(value: str, other: str) -> None:
    assert plan(go("A", x=other)) in by_operator(plan(go("A", x=value)))["parameter"]


END = R("fabric_capabilities/FabricCompletionRunner")


@given(plans(min_runners=1, max_runners=6))
@example(P((R("a/A"), END, END)))  # the first of them is a runner like any other
def test_a_plan_that_is_written_again_is_the_same(whole) -> None:
    before = plan_of(whole)
    after = plan_of(str(Tree(before)))
    assert [(e.kind, e.parent, e.attributes and e.action) for e in before.elements] == [
        (e.kind, e.parent, e.attributes and e.action) for e in after.elements
    ]
    assert [e.control_type for e in before.elements] == [e.control_type for e in after.elements]


def test_hostile_values_are_written_so_that_they_read_as_they_were() -> None:
    text = "a\n\"b\" 'c' <d> & \t e"
    root = Node("Plan", {}, [Node("Runner", {"interface": "a/A", "provider": "a/A", "text": text})])
    parsed = parse(written(root))
    assert parsed.plan is not None
    assert parsed.plan.runners[0].text("text") == text


@settings(max_examples=many(6))
@given(plans(min_runners=1, max_runners=3, max_depth=2))
def test_only_what_does_something_else_counts(whole) -> None:
    before = plan_of(to_xml(whole))
    score = mutate(before, CheckOptions(selection=Selection.of(("GP3",), ())), most=25)
    for mutant in score.mutants:
        tree = Tree(before)
        mutant.mutation.change(tree)
        same = compare(before, plan_of(str(tree))) is None
        assert (mutant.notice is Notice.EQUAL) == same


def test_a_task_file_that_says_all_notices_every_mutant() -> None:
    score = mutate(plan_of(GOOD), OF_TASK)
    missed = [m.mutation.summary for m in score.mutants if m.notice is Notice.MISSED]
    assert missed == []
    assert score.score == 1.0
    assert score.own == 0
    assert {code for mutant in score.mutants for code in mutant.by} <= {
        *("GP601", "GP602", "GP603", "GP604", "GP605", "GP606", "GP607")
    }


def test_a_task_file_that_forgets_a_parameter_misses_its_mutants() -> None:
    """A planted gap: whether x is 1 or 2 does not matter to this task."""
    task = read_task(
        b"actions:\n  first: {interface: A}\n  other: {interface: C}\n  second: {interface: B}\n"
        b"steps:\n  - {do: first, else: other}\n  - do: second\n"
    )
    options = CheckOptions(task=task, selection=Selection.of(("GP6",), ()))
    score = mutate(plan_of(GOOD), options)
    missed = [m.mutation.summary for m in score.mutants if m.notice is Notice.MISSED]
    where = "A (x=1) at line 1 column 7"
    assert missed == [f"changes x of {where} to '2'", f"leaves out x of {where}"]
    noticed = score.count(Notice.NOTICED)
    assert score.score == noticed / (noticed + 2)


def test_a_task_file_that_says_nothing_misses_everything() -> None:
    task = read_task(b"actions:\n  a: {interface: '*'}\nrules:\n  - precedence: [a, a]\n")
    options = CheckOptions(task=task, selection=Selection.of(("GP6",), ()))
    score = mutate(plan_of(GOOD), options)
    assert score.score == 0.0
    kinds = Counter(mutant.notice for mutant in score.mutants)
    assert kinds[Notice.MISSED] + kinds[Notice.EQUAL] == len(score.mutants)


def test_a_mutant_beyond_a_limit_is_undecided_and_no_end_of_the_matter() -> None:
    deep = plan(control("sequential", go("A")), control("sequential", go("B")))
    limits = Limits(max_depth=3)
    score = mutate(plan_of(deep), CheckOptions(limits=limits, selection=Selection.of(("GP3",), ())))
    summaries = {m.mutation.summary for m in score.mutants if m.notice is Notice.UNDECIDED}
    where = "the sequential at line"
    assert len(summaries) == 1
    assert all(f"moves {where}" in each and f"into {where}" in each for each in summaries)
    with pytest.raises(UsageError, match="too large to be written"):
        mutate(plan_of(deep), CheckOptions(limits=Limits(max_depth=2)))


def test_the_same_seed_draws_the_same_mutants() -> None:
    text = plan(*(go(name, x=str(number)) for number, name in enumerate("ABCDEF")))
    options = CheckOptions(selection=Selection.of(("GP307",), ()))
    summaries = [
        [
            each.mutation.summary
            for each in mutate(plan_of(text), options, seed=seed, most=5).mutants
        ]
        for seed in (1, 1, 2)
    ]
    assert len(summaries[0]) == 5
    assert summaries[0] == summaries[1]
    assert summaries[0] != summaries[2]


def test_a_time_budget_ends_it() -> None:
    now = iter(range(1_000))
    score = mutate(plan_of(GOOD), OF_TASK, time_s=4.0, clock=lambda: float(next(now)))
    assert score.cut_off
    assert len(score.mutants) == 3


def test_a_tree_is_refused_and_its_plan_named() -> None:
    tree = (
        '<root BTCPP_format="4"><BehaviorTree><Fallback><A/><B/></Fallback></BehaviorTree></root>'
    )
    plan = read_plan(tree, file="tree.xml").plan
    assert plan is not None
    with pytest.raises(UsageError, match=r"gpsfsm convert tree\.xml --to plan"):
        mutate(plan, CheckOptions())
