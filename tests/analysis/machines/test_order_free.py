"""Machines whose runs their scenario fixes: the answers of z3, against search and brute force."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gpsfsm
from gpsfsm.analysis.constraints import constraints_under
from gpsfsm.analysis.definitions import Definitions
from gpsfsm.analysis.machines.decide import Answers, Judge
from gpsfsm.analysis.machines.findings import Findings
from gpsfsm.analysis.machines.order_free import OrderFree, is_order_free
from gpsfsm.analysis.machines.plain import Plain
from gpsfsm.analysis.machines.search import Exploration
from gpsfsm.checking.machine_check import require_agreement
from gpsfsm.compile import compile_plan
from gpsfsm.compile.instants import GOING
from gpsfsm.compile.machines import machine_of
from gpsfsm.errors import InternalError
from gpsfsm.model.event import Outcome
from gpsfsm.model.report import Frequency
from tests.analysis.machines.random_machines import (
    PLAIN,
    automaton_of,
    machine,
    options_of,
    order_free_machines,
    outcomes,
)
from tests.cases import many


def answers_of(graph: Any, allowed: list[frozenset[Outcome]] | None = None) -> Answers | None:
    """The answers of z3, each run of which is played to its end."""
    plan, problems = machine_of(graph)
    assert plan is not None, problems
    compiled = compile_plan(plan)
    outcomes_of = tuple(allowed or [PLAIN] * len(compiled.automaton.runners))
    names = [plan.path(each).removeprefix("/machine/") for each in plan.runners]
    options = options_of(names, outcomes_of)
    constraints = constraints_under(options, compiled)
    assert constraints.allowed == outcomes_of
    answers = OrderFree(compiled, constraints, options).answers()
    if answers is not None:
        plain = Plain(compiled.automaton, Definitions(compiled, options), by_scenario=True)
        scenarios = [
            (finding.rule, finding.scenario.ends.value)
            for finding in Findings(answers, plain, 100).all()
            if finding.scenario is not None
        ]
        assert {end for rule, end in scenarios if rule == "GP305"} <= {"GAVE_UP"}
        assert {end for rule, end in scenarios if rule == "GP306"} <= {"STUCK"}
        assert {end for rule, end in scenarios if rule == "GP311"} <= {"COMPLETED"}
        assert {end for rule, end in scenarios if rule == "GP302"} <= {"GAVE_UP", "STUCK"}
    return answers


@pytest.mark.parametrize(
    ("lines", "free"),
    [
        (("start SUCCEEDED a", "a FAILED b", "a SUCCEEDED end"), True),
        (("start SUCCEEDED a", "a STARTED b"), True),
        (("start SUCCEEDED a", "a FAILED a"), False),
        (("start SUCCEEDED a", "a FAILED b", "a SUCCEEDED b"), False),
        (("start SUCCEEDED a", "start SUCCEEDED b", "a FAILED stop b"), False),
        (("start SUCCEEDED a", "a STOPPED b"), False),
        (("start SUCCEEDED a", "start2 SUCCEEDED b", "b FAILED end"), True),
    ],
)
def test_what_depends_on_no_order(lines: tuple[str, ...], free: bool) -> None:
    assert is_order_free(automaton_of(machine(*lines))) is free


def test_which_end_comes_first_is_left_to_the_search() -> None:
    lines = ("start SUCCEEDED a", "start SUCCEEDED b", "a SUCCEEDED end", "b SUCCEEDED lost")
    assert answers_of(machine(*lines)) is None


def test_ends_that_only_another_outcome_triggers_both_are_left_to_the_search() -> None:
    """It gave up before r0 had its outcome, which an assumption fixes: r0 is not to blame."""
    lines = ("start SUCCEEDED r0", "start SUCCEEDED lost", "r0 SUCCEEDED end")
    assert answers_of(machine(*lines), [frozenset({Outcome.FAILED})]) is None
    (report,) = gpsfsm.check(machine(*lines), assume=["r0 fails"]).plans
    assert report.facts is not None
    assert [each.effect for each in report.facts.dangling] == ["dont_care"]


def test_an_instance_that_starts_too_late_is_no_orphan() -> None:
    graph = machine(
        "start SUCCEEDED j", "j SUCCEEDED end", "start SUCCEEDED a", "a SUCCEEDED b", j=1
    )
    answers = answers_of(graph)
    assert answers is not None
    assert answers.orphans == ((0, ()),)
    graph = machine(
        *("start SUCCEEDED a", "start2 SUCCEEDED b", "a SUCCEEDED end", "b SUCCEEDED c"),
        *("a FAILED end", "c SUCCEEDED d"),
    )
    answers = answers_of(graph)
    assert answers is not None
    assert [number for number, _ in answers.orphans] == [1, 2, 3]


def test_a_failure_that_leaves_the_machine_stuck() -> None:
    answers = answers_of(machine("start SUCCEEDED a", "a SUCCEEDED end"))
    assert answers is not None
    (event,) = answers.dangling
    assert (event.effect, event.shown) == ("stuck", ((0, 2),))
    assert answers.stuck is Frequency.SOMETIMES
    assert answers.shown == {GOING: ((0, 2),)}


def test_two_ways_that_disagree() -> None:
    one = answers_of(machine("start SUCCEEDED a", "a SUCCEEDED end"))
    other = answers_of(machine("start SUCCEEDED a", "a SUCCEEDED end", "a FAILED end"))
    assert one is not None
    assert other is not None
    require_agreement(one, one)
    with pytest.raises(InternalError, match="disagree"):
        require_agreement(one, other)


@settings(max_examples=many(40))
@given(graph=order_free_machines(most_runners=6), data=st.data())
def test_z3_and_the_search_agree(graph: Any, data: st.DataObject) -> None:
    automaton = automaton_of(graph)
    assert is_order_free(automaton)
    allowed = data.draw(outcomes(len(automaton.runners)))
    answers = answers_of(graph, allowed)
    if answers is not None:
        require_agreement(answers, Judge(Exploration(automaton, allowed)).facts())
