"""Verdicts on tasks, held against every scenario and every order of events."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import assume, event, given
from hypothesis import strategies as st

from gpsfsm.analysis.constraints import constraints_of
from gpsfsm.compile import compile_plan
from gpsfsm.model.capability import Binding, Interface, Output, Parameter, Provider
from gpsfsm.model.event import Outcome
from gpsfsm.tasks.deciding import Effort, decide_task
from gpsfsm.tasks.load import BINARY, COUNTED, UNARY, formula_text
from gpsfsm.tasks.ltlf import parse_formula
from gpsfsm.tasks.task import Pattern, Place, Rule, Step, Task
from tests import oracle
from tests.oracle import C, P, R, action_key, par_all, par_any, rec, runner_paths, seq
from tests.strategies import constraints, plans
from tests.support import plan_of
from tests.tasks.reference import actions_of, all_traces, holds, left_after

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from hypothesis.strategies import DrawFn

    from gpsfsm.tasks.deciding import Decision
    from tests.oracle.model import Node

NAMES = {"A": "demo/A", "B": "demo/B x=1", "C": "demo/B x=2", "D": "demo/D"}
KEYS = {name: action_key(R(action)) for name, action in NAMES.items()}
PATTERNS = {
    "A": Pattern("A", ("A",)),
    "B": Pattern("B", ("demo/B",), (("x", 1.0),)),
    "C": Pattern("C", ("*/B",), (("x", 2),)),
    "D": Pattern("D", ("demo/[D]",)),
}
TYPES = ("sequential", "recovery", "parallel_any", "parallel_all")


def decide(whole: P, task: Task, *, assumptions: Sequence[str] = (), **options: object) -> Decision:
    """By the search alone; test_symbolic.py compares it with z3."""
    plan = plan_of(whole)
    limits = constraints_of(plan, assumptions=assumptions, **options)  # type: ignore[arg-type]
    compiled = compile_plan(plan, start_chain=limits.no_start)
    return decide_task(compiled, limits, task, effort=Effort("structural"))


def task_of(steps: Sequence[Sequence[str]], **more: object) -> Task:
    named = tuple(Step(tuple(PATTERNS[name] for name in step)) for step in steps)
    return Task(steps=named, patterns=tuple(PATTERNS.values()), **more)  # type: ignore[arg-type]


@st.composite
def small_plans(draw: DrawFn, most: int = 5) -> P:
    """Plans over a few actions; all controls anywhere."""
    shape = draw(plans(min_runners=1, max_runners=most, max_depth=3))

    def renamed(node: Node) -> Node:
        if isinstance(node, R):
            return R(NAMES[draw(st.sampled_from("ABCD"))])
        return C(node.type, tuple(map(renamed, node.children)))

    return P(tuple(map(renamed, shape.children)))


STEPS = st.lists(
    st.lists(st.sampled_from("ABCD"), min_size=1, max_size=3).map(tuple), min_size=1, max_size=4
).filter(lambda steps: sum(map(len, steps)) <= 5)


@st.composite
def answers(draw: DrawFn) -> tuple[list[tuple[str, ...]], P]:
    """Steps, and a plan that fulfils them but for a few changes."""
    steps = draw(STEPS)
    children: list[Node] = []
    for first, *rest in steps:
        step: list[Node] = [R(NAMES[first])]
        if rest and draw(st.booleans()):
            step.append(rec(*(NAMES[name] for name in rest)))
        else:
            step += [rec(NAMES[name]) for name in rest]
        if draw(st.integers(0, 3)) == 3:
            step = [C(draw(st.sampled_from(TYPES[:1] + TYPES[2:])), tuple(step))]
        children += step
    for _ in range(draw(st.integers(0, 1))):
        place = draw(st.integers(0, len(children) - 1))
        change = draw(st.sampled_from(["drop", "double", "swap", "other", "wrap"]))
        if change == "drop":
            del children[place]
        elif change == "double":
            children.insert(place, children[place])
        elif change == "swap":
            children[0], children[place] = children[place], children[0]
        elif change == "other":
            children[place] = R(NAMES[draw(st.sampled_from("ABCD"))])
        else:
            children[place:] = [C(draw(st.sampled_from(TYPES)), tuple(children[place:]))]
    return steps, P(tuple(children))


def check_steps(
    whole: P,
    steps: Sequence[Sequence[str]],
    *,
    allowed: frozenset[str] = frozenset(),
    others: bool = False,
    decision: Decision,
    **runs: object,
) -> None:
    """The verdict is that of brute force, and so is every scenario."""
    wanted = [[KEYS[name] for name in step] for step in steps]
    actions = actions_of(whole)
    free = frozenset(KEYS[name] for name in allowed)
    refused = [
        (outcomes, trace, place)
        for outcomes, trace in all_traces(whole, **runs)  # type: ignore[arg-type]
        if (place := left_after(trace, wanted, actions, allowed=free, others=others)) is not None
    ]
    assert decision.undecided == ()
    assert decision.fulfilled == (not refused)
    event(f"fulfilled: {decision.fulfilled}")
    for departure in decision.departures:
        event(departure.rule)
        paths = [path for path, _ in departure.scenario.outcomes]
        library = dict(departure.scenario.outcomes)
        assert len(set(paths)) == len(paths)
        assert any(
            all(
                library.get(path, Outcome(written)) == written
                for path, written in zip(_paths(whole), outcomes, strict=True)
            )
            for outcomes, _, _ in refused
        )
    if refused:
        fewest = min(len(trace.failing(place)) for _, trace, place in refused)
        first = decision.departures[0].scenario
        failed = sum(outcome in (Outcome.FAILED, Outcome.NO_START) for _, outcome in first.outcomes)
        shown = sum(step.event == "FAILED" for step in first.trace)
        assert shown <= fewest <= failed
        if Outcome.NO_START not in dict(first.outcomes).values():
            assert shown == fewest


def _paths(whole: P) -> list[str]:
    return list(runner_paths(whole))


@given(small_plans(), STEPS)
def test_any_plan_against_any_steps(whole: P, steps: list[tuple[str, ...]]) -> None:
    check_steps(whole, steps, decision=decide(whole, task_of(steps)))


@given(answers())
def test_plans_that_nearly_fulfil_their_steps(expected: tuple[list[tuple[str, ...]], P]) -> None:
    steps, whole = expected
    check_steps(whole, steps, decision=decide(whole, task_of(steps)))


@given(answers(), st.booleans())
def test_other_actions_may_be_allowed(
    expected: tuple[list[tuple[str, ...]], P], others: bool
) -> None:
    steps, whole = expected
    more = {"others": True} if others else {"allowed": (PATTERNS["D"],)}
    allowed = frozenset() if others else frozenset("D")
    decision = decide(whole, task_of(steps, **more))
    check_steps(whole, steps, allowed=allowed, others=others, decision=decision)


@given(answers(), st.sampled_from([par_all, par_any, seq]))
def test_an_action_beside_the_steps_may_end_the_run_at_any_time(
    expected: tuple[list[tuple[str, ...]], P], around: Callable[..., C]
) -> None:
    steps, whole = expected
    assume(len(actions_of(whole)) <= 4)
    beside = P((around(seq(*whole.children), R("demo/Say")),))
    decision = decide(beside, task_of(steps, others=True))
    check_steps(beside, steps, others=True, decision=decision)


def test_nothing_is_due_while_an_alternative_runs() -> None:
    """So a plan may give up then because of something else, but not where one is due."""
    task = task_of([("A", "B")], others=True)
    assert decide(P((par_all(seq("demo/A", rec("demo/B x=1")), R("demo/Say")),)), task).fulfilled
    untried = decide(P((par_all("demo/A", "demo/Say"),)), task)
    assert [each.rule for each in untried.departures] == ["GP605"]


@given(answers())
def test_equal_actions_may_have_equal_outcomes(expected: tuple[list[tuple[str, ...]], P]) -> None:
    steps, whole = expected
    decision = decide(whole, task_of(steps), consistent=True)
    check_steps(whole, steps, decision=decision, consistent=True)


@given(answers(), st.data())
def test_assumptions_rule_scenarios_out(
    expected: tuple[list[tuple[str, ...]], P], data: st.DataObject
) -> None:
    steps, whole = expected
    assume(actions_of(whole))
    constraint = data.draw(constraints(whole, max_leaves=3))
    assume(all_traces(whole, constraint=constraint))
    decision = decide(whole, task_of(steps), assumptions=[str(constraint)])
    check_steps(whole, steps, decision=decision, constraint=constraint)


FAULTS = st.sampled_from([("hang",), ("no-start",), ("hang", "no-start")])


@given(small_plans(4), STEPS, FAULTS, st.booleans())
def test_instances_may_hang_or_not_start(
    whole: P, steps: list[tuple[str, ...]], faults: tuple[str, ...], consistent: bool
) -> None:
    decision = decide(whole, task_of(steps), faults=faults, consistent=consistent)
    runs = {"faults": frozenset(faults), "consistent": consistent}
    check_steps(whole, steps, decision=decision, **runs)


@given(answers(), FAULTS)
def test_plans_that_nearly_fulfil_their_steps_may_hang_or_not_start(
    expected: tuple[list[tuple[str, ...]], P], faults: tuple[str, ...]
) -> None:
    steps, whole = expected
    assume(len(actions_of(whole)) <= 5)
    decision = decide(whole, task_of(steps), faults=faults)
    check_steps(whole, steps, decision=decision, faults=frozenset(faults))


RULES = st.one_of(
    st.tuples(st.sampled_from(COUNTED), st.tuples(st.sampled_from("ABC")), st.integers(1, 3)),
    st.tuples(st.sampled_from(sorted(UNARY)), st.tuples(st.sampled_from("ABC")), st.just(1)),
    st.tuples(
        st.sampled_from(sorted(BINARY)),
        st.tuples(st.sampled_from("ABC"), st.sampled_from("ABC")),
        st.just(1),
    ),
)


@given(small_plans(4), RULES, st.sampled_from(["start", "success", "failure"]), st.booleans())
def test_rules_hold_if_they_hold_of_every_run(
    whole: P, rule: tuple[str, tuple[str, ...], int], after: str, completed: bool
) -> None:
    template, names, times = rule
    text = formula_text(template, names, after=after, times=times)  # type: ignore[arg-type]
    text = f"F completes -> ({text})" if completed else text
    formula = parse_formula(text)
    task = Task(rules=(Rule(template, template, formula),), patterns=tuple(PATTERNS.values()))
    decision = decide(whole, task)
    meant = {name: frozenset({KEYS[name]}) for name in KEYS}
    wrong = [
        trace
        for _, trace in all_traces(whole)
        if not holds(formula, trace, meant, actions_of(whole))
    ]
    event(f"{template}: {not wrong}")
    assert decision.undecided == ()
    assert decision.fulfilled == (not wrong)


ATOMS = [f"{what}({name})" for what in ("start", "succeeds", "fails") for name in ("A", "B", "*")]
FORMULAS = st.recursive(
    st.sampled_from([*ATOMS, "completes", "gives_up", "stuck", "true", "false"]),
    lambda parts: st.one_of(
        st.tuples(st.sampled_from(["!", "X ", "WX ", "F ", "G "]), parts).map(
            lambda actual: f"{actual[0]}({actual[1]})"
        ),
        st.tuples(parts, st.sampled_from(["&", "|", "->", "<->", "U", "R", "W", "M"]), parts).map(
            lambda actual: f"(({actual[0]}) {actual[1]} ({actual[2]}))"
        ),
    ),
    max_leaves=5,
)


@given(small_plans(4), FORMULAS, st.booleans())
def test_formulas_hold_if_they_hold_of_every_run(whole: P, text: str, hang: bool) -> None:
    formula = parse_formula(text)
    task = Task(rules=(Rule(text, text, formula),), patterns=tuple(PATTERNS.values()))
    faults = frozenset({"hang"}) if hang else frozenset[str]()
    decision = decide(whole, task, faults=faults)
    meant = {name: frozenset({KEYS[name]}) for name in KEYS}
    wrong = any(
        not holds(formula, trace, meant, actions_of(whole))
        for _, trace in all_traces(whole, faults=faults)
    )
    assert decision.undecided == ()
    assert decision.fulfilled == (not wrong)


# -- what arrives decides which action is meant --------------------------------------------------

PLACE = Place("Dock", (("x", 1), ("y", 2)))


@pytest.mark.parametrize(
    ("pattern", "written", "unknown", "open_"),
    [
        (Pattern("p", ("Go",), (("x", 1),)), {"x": "1"}, ["x"], True),
        (Pattern("p", ("Go",), (("x", 1),)), {"x": "7"}, ["x"], True),  # it may become 1
        (Pattern("p", ("Go",), (("x", 1),)), {}, ["x"], True),
        (Pattern("p", ("Go",), (("x", 1),)), {"x": "1"}, ["z"], False),
        (Pattern("p", ("Go",), (("x", 1),)), {"x": "1"}, [], False),
        (Pattern("p", ("Say",), (("x", 1),)), {"x": "1"}, ["x"], False),  # another action
        (Pattern("p", ("Go",)), {"x": "1"}, ["x"], False),  # any will do
        (Pattern("p", ("Go",), (("x", 1), ("y", 2))), {"x": "1", "y": "3"}, ["x"], False),
        (Pattern("p", ("Go",), (("x", 1), ("y", 2))), {"x": "7", "y": "3"}, ["x", "y"], True),
        (Pattern("p", ("Go",), place=PLACE), {"x": "1", "y": "2"}, ["x"], True),
        (Pattern("p", ("Go",), place=PLACE), {"x": "1", "y": "3"}, ["x"], True),  # as its name
        (Pattern("p", ("Go",), place=PLACE), {"y": "3"}, ["x"], False),
        (Pattern("p", ("Go",), place=PLACE), {"to": "Dock", "x": "0"}, ["x"], False),
        (Pattern("p", ("Go",), place=PLACE), {"to": "Dock"}, ["to"], True),
        (Pattern("p", ("Go",), place=Place("Dock", ())), {"to": "Bay"}, ["to"], True),
        (Pattern("p", ("Go",), place=Place("Dock", ())), {"to": "Bay"}, ["x"], False),
    ],
)
def test_whether_a_value_decides_if_an_action_is_meant(
    pattern: Pattern, written: dict[str, str], unknown: list[str], open_: bool
) -> None:
    words = " ".join(["Go", *(f"{name}={text}" for name, text in written.items())])
    (runner,) = plan_of(oracle.plan(words)).runners
    assert pattern.depends_on(runner, unknown) is open_
    if open_:
        return
    # whatever arrives, it is meant or not
    verdicts = {
        pattern.matches(plan_of(oracle.plan(" ".join([words, *extra]))).runners[0])
        for extra in ([], *([f"{name}=1"] for name in unknown if name not in written))
    }
    assert len(verdicts) == 1


GIVER = Provider("d/Give", "Give", described=True, outputs=(Output("x", optional=True),))
TAKER = Provider("d/Go", "Go", described=True, configuration=(Parameter("x"),))


@pytest.mark.parametrize(
    ("demand", "whole", "open_"),
    [
        ("steps", ["Give", "Go x=1"], True),
        ("steps", ["Go x=1", "Give"], False),
        ("steps", ["Give", "Wait", "Go x=1"], True),  # nobody knows what that one gives
        ("steps", ["Give", "Go x=7"], False),  # as it is written, the step is missing
        ("rule", ["Give", "Go x=7"], True),
        ("rule", ["Go x=7", "Give"], False),
        ("rule", ["Wait", "Go x=7"], True),
        ("rule", ["Give", "Go x=1"], False),  # as it is written, the rule is broken
    ],
)
def test_a_demand_that_an_arriving_value_decides_is_undecided(
    demand: str, whole: list[str], open_: bool
) -> None:
    there = Pattern("there", ("Go",), (("x", 1),))
    rule = Rule("never there", "never there", parse_formula("G !start(there)"))
    task = (
        Task(steps=(Step((there,)),), others=True)
        if demand == "steps"
        else Task(rules=(rule,), patterns=(there,))
    )
    plan = plan_of(oracle.plan(*whole))
    values = {one.implements: one for one in (GIVER, TAKER)}
    bindings = tuple(
        Binding(Interface(each.interface), values[each.interface], {})
        if each.interface in values
        else None
        for each in plan.runners
    )
    compiled = compile_plan(plan, bindings=bindings)
    decision = decide_task(compiled, constraints_of(plan, bindings=compiled.bindings), task)
    assert bool(decision.undecided) is bool(decision.unknown) is open_
    if open_:
        assert decision.fulfilled is None
        assert decision.unknown[0].names == ("x",)
