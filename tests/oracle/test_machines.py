"""The brute force of machines on machines that were worked out by hand."""

from __future__ import annotations

from typing import Any

import pytest

from tests.analysis.machines.random_machines import machine
from tests.oracle.machines import Machine, TooLargeError, is_lasso, machine_facts

ENDS = ("completes", "gives_up", "stuck", "endless", "completes_if_fair")


def facts(*lines: str, hang: bool = False, **needs: int) -> dict[str, Any]:
    graph = machine(*lines, **needs)
    names = [name for name, kind in graph.nodes(data="kind") if kind == "runner"]
    outcomes = ("SUCCEEDED", "FAILED", *(("HANG",) if hang else ()))
    return machine_facts(graph, dict.fromkeys(names, outcomes))


def ends(actual: dict[str, Any]) -> list[str]:
    return [actual[name] for name in ENDS]


def test_a_loop_that_a_success_leads_out_of() -> None:
    answer = facts("start SUCCEEDED a", "a FAILED a", "a SUCCEEDED end")
    assert ends(answer) == ["sometimes", "never", "never", "sometimes", "always"]
    assert answer["loops"] == {(frozenset("a"), False)}
    assert answer["dangling"] == []


def test_a_trap() -> None:
    lines = ("start SUCCEEDED a", "a SUCCEEDED end", "a FAILED b", "b SUCCEEDED b", "b FAILED b")
    answer = facts(*lines)
    assert ends(answer) == ["sometimes", "never", "never", "sometimes", "sometimes"]
    assert answer["loops"] == {(frozenset("b"), True)}
    hanging = facts(*lines, hang=True)  # b may hang: then nothing more happens
    assert hanging["loops"] == {(frozenset("b"), False)}
    assert hanging["stuck"] == "sometimes"


def test_stopping_comes_before_triggering() -> None:
    # a starts again at the instant at which b stops it: two visits, and b none any more
    lines = ("start SUCCEEDED a", "start SUCCEEDED b", "b SUCCEEDED stop a", "b SUCCEEDED a")
    answer = facts(*lines, "a STOPPED c", "c STARTED lost")
    assert answer["gives_up"] == "sometimes"
    assert answer["fewest_failures_to_give_up"] == 0
    assert answer["unreachable"] == []


def test_a_trigger_while_active_has_no_effect() -> None:
    answer = facts(
        "start SUCCEEDED a", "start SUCCEEDED b", "b SUCCEEDED a", "a SUCCEEDED end", "a STARTED c"
    )
    assert answer["orphans"] == ["b", "c"]


def test_joins_are_armed_again() -> None:
    # one of two: the second input is taken in, and arms the join for the next round
    lines = ("start SUCCEEDED a", "start SUCCEEDED b", "a SUCCEEDED j", "b SUCCEEDED j")
    answer = facts(*lines, "a FAILED j", "b FAILED j", "j SUCCEEDED c", "c SUCCEEDED a", j=1)
    assert answer["unreachable"] == []
    waiting = facts(*lines, "j SUCCEEDED end", "a FAILED lost", "b FAILED end", j=2)
    assert waiting["join_deadlocks"] == [("j", "give_up")]
    endless = facts(*lines, "j SUCCEEDED end", "a FAILED a", "b FAILED b", j=2)
    assert endless["join_deadlocks"] == [("j", "endless")]
    few = facts("start SUCCEEDED a", "a SUCCEEDED j", "a SUCCEEDED end", "a FAILED end", j=2)
    assert few["join_deadlocks"] == [("j", "absorbed")]


def test_a_join_that_is_stopped_forgets_what_came_before_this_instant() -> None:
    lines = ("start SUCCEEDED a", "a SUCCEEDED j", "a SUCCEEDED b", "b SUCCEEDED stop j")
    assert facts(*lines, "b SUCCEEDED j", "b FAILED stop j", j=2)["join_deadlocks"] == [
        ("j", "stuck")
    ]
    assert facts(*lines, "b FAILED stop j", j=2)["join_deadlocks"] == []


def test_who_is_active_has_to_end() -> None:
    lines = ("start SUCCEEDED a", "start SUCCEEDED b", "b SUCCEEDED b", "b FAILED b")
    stops = ("a SUCCEEDED stop b", "a FAILED stop b", "a SUCCEEDED end", "a FAILED end")
    assert ends(facts(*lines, *stops)) == ["always", "never", "never", "never", "always"]
    # a is stopped and starts again and again: that is a run, and it has no end
    again = facts(*lines, *stops, "b SUCCEEDED stop a", "b SUCCEEDED a")
    assert again["endless"] == "sometimes"
    assert again["completes_if_fair"] == "sometimes"  # a has no outcome there: that is fair


def test_a_first_instant_may_complete_or_give_up() -> None:
    answer = facts("start SUCCEEDED end", "start SUCCEEDED lost", "start SUCCEEDED a")
    assert answer["gives_up"] == "always"
    answer = facts("start SUCCEEDED end", "start SUCCEEDED a", "a FAILED b", "b SUCCEEDED lost")
    assert ends(answer) == ["always", "never", "never", "never", "always"]
    assert answer["orphans"] == ["a"]
    assert answer["fewest_failures_to_give_up"] is None


def test_failures_count_at_every_visit() -> None:
    lines = ("start SUCCEEDED a", "a FAILED b", "a SUCCEEDED end", "b SUCCEEDED a", "b FAILED lost")
    assert facts(*lines)["fewest_failures_to_give_up"] == 2


def test_lassos() -> None:
    graph = machine("start SUCCEEDED a", "start SUCCEEDED b", "a FAILED a", "a SUCCEEDED end")
    whole = Machine(graph)
    assert is_lasso(whole, [("b", "FAILED")], [("a", "FAILED")])
    assert not is_lasso(whole, [], [("a", "FAILED")])  # b is active throughout
    assert not is_lasso(whole, [("b", "FAILED")], [("a", "SUCCEEDED")])
    assert not is_lasso(whole, [("b", "FAILED"), ("b", "FAILED")], [("a", "FAILED")])
    assert not is_lasso(whole, [("b", "HANG")], [("a", "FAILED")])


def test_too_many_configurations() -> None:
    with pytest.raises(TooLargeError):
        machine_facts(machine(*(f"start SUCCEEDED r{n}" for n in range(6))), most=50)
