"""Facts about machines: known ones, z3's fixed points, and the facts of plans."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import gpsfsm
from gpsfsm.analysis.machines.decide import Answers, Judge
from gpsfsm.analysis.machines.search import Exploration
from gpsfsm.analysis.options import InconclusiveError
from gpsfsm.compile import compile_plan
from gpsfsm.compile.machines import machine_of
from gpsfsm.model.event import Outcome
from gpsfsm.model.report import Frequency
from tests import oracle
from tests.analysis.machines.fixpoint import Fixpoint
from tests.analysis.machines.random_machines import (
    PLAIN,
    automaton_of,
    machine,
    machines,
    outcomes,
)
from tests.cases import many
from tests.strategies import plans
from tests.support import plan_of

ALWAYS, SOMETIMES, NEVER = Frequency.ALWAYS, Frequency.SOMETIMES, Frequency.NEVER


def answers(*connections: str, hang: bool = False, **needs: int) -> Answers:
    """The answers about a machine."""
    automaton = automaton_of(machine(*connections, **needs))
    allowed = PLAIN | {Outcome.HANG} if hang else PLAIN
    return Judge(Exploration(automaton, [allowed] * len(automaton.runners))).facts()


def ends(facts: Answers) -> tuple[Frequency, ...]:
    """Completes, gives up, stuck, endless."""
    return facts.completes, facts.gives_up, facts.stuck, facts.endless


def test_a_loop_that_a_success_leads_out_of() -> None:
    replies = answers("start SUCCEEDED a", "a FAILED a", "a SUCCEEDED end")
    assert ends(replies) == (SOMETIMES, NEVER, NEVER, SOMETIMES)
    assert replies.completes_if_fair is ALWAYS
    (loop,) = replies.loops
    assert not loop.trap
    assert (loop.lasso.prefix, loop.lasso.loop) == ((), ((0, 2),))


def test_a_loop_that_nothing_leads_out_of() -> None:
    replies = answers("start SUCCEEDED a", "a FAILED end", "a SUCCEEDED b", "b SUCCEEDED c")
    assert not replies.loops
    trap = answers(
        "start SUCCEEDED a", "a FAILED end", "a SUCCEEDED b", "b SUCCEEDED b", "b FAILED b"
    )
    (loop,) = trap.loops
    assert loop.trap
    assert loop.lasso.prefix == ((0, 1),)
    assert trap.completes_if_fair is SOMETIMES


def test_an_unfair_choice_is_left_out_step_by_step() -> None:
    # fair runs take b's failure, which leads out of the loop of a and b
    replies = answers(
        "start SUCCEEDED a", "a SUCCEEDED b", "a FAILED b", "b SUCCEEDED a", "b FAILED end"
    )
    assert (replies.completes, replies.completes_if_fair) == (SOMETIMES, ALWAYS)


def test_a_runner_that_is_active_for_ever_is_no_run() -> None:
    # b goes round only as long as a has not ended, and a ends
    replies = answers(
        *("start SUCCEEDED a", "start SUCCEEDED b", "b SUCCEEDED b", "b FAILED b"),
        *("a SUCCEEDED stop b", "a FAILED stop b", "a SUCCEEDED end", "a FAILED lost"),
    )
    assert ends(replies) == (SOMETIMES, SOMETIMES, NEVER, NEVER)
    assert replies.loops == ()
    hanging = answers(
        *("start SUCCEEDED a", "start SUCCEEDED b", "b SUCCEEDED b", "b FAILED b"),
        *("a SUCCEEDED stop b", "a FAILED stop b", "a SUCCEEDED end", "a FAILED lost"),
        hang=True,
    )
    assert hanging.endless is SOMETIMES
    assert hanging.stuck is SOMETIMES


def test_a_join_waits_for_ever_stuck_or_in_a_loop() -> None:
    stuck = answers(
        "start SUCCEEDED a",
        "start SUCCEEDED b",
        "a SUCCEEDED j",
        "b SUCCEEDED j",
        "j SUCCEEDED end",
        j=2,
    )
    assert [each.effect for each in stuck.waiting] == ["stuck"]
    endless = answers(
        *("start SUCCEEDED a", "start SUCCEEDED b", "a SUCCEEDED j", "b SUCCEEDED j"),
        *("j SUCCEEDED end", "a FAILED a", "b FAILED b"),
        j=2,
    )
    assert [each.effect for each in endless.waiting] == ["endless"]
    assert endless.completes_if_fair is ALWAYS


def test_failures_count_at_every_visit() -> None:
    replies = answers(
        "start SUCCEEDED a", "a FAILED b", "a SUCCEEDED end", "b SUCCEEDED a", "b FAILED lost"
    )
    assert replies.fewest_failures == 2
    assert [(each.signal.node, each.effect) for each in replies.dangling] == [(2, "give_up")]


def test_orphans_are_active_after_completion() -> None:
    replies = answers("start SUCCEEDED a", "a STARTED b", "a SUCCEEDED end")
    assert [number for number, _ in replies.orphans] == [1]
    stopped = answers("start SUCCEEDED a", "a STARTED b", "a SUCCEEDED end", "a SUCCEEDED stop b")
    assert stopped.orphans == ()


def test_a_machine_with_too_many_configurations_is_inconclusive() -> None:
    automaton = automaton_of(machine(*(f"start SUCCEEDED r{number}" for number in range(9))))
    with pytest.raises(InconclusiveError):
        Exploration(automaton, [PLAIN] * 9, limit=500)
    assert len(Exploration(automaton, [PLAIN] * 9, limit=513).configurations) == 512


@settings(max_examples=many(8))
@given(graph=machines(most_runners=3), data=st.data())
def test_z3_and_the_search_agree(graph: Any, data: st.DataObject) -> None:
    plan, problems = machine_of(graph)
    assume(plan is not None)
    assert plan is not None
    assert not problems
    automaton = plan.automaton
    allowed = data.draw(outcomes(len(automaton.runners)))
    answer = Judge(Exploration(automaton, allowed)).facts()
    proved = Fixpoint(automaton, allowed, rlimit=50_000_000)
    claims = {
        "completed": answer.completes is not NEVER,
        "gave_up": answer.gives_up is not NEVER,
        f"(and {proved.still} (not completed) (not gave_up))": answer.stuck is not NEVER,
    }
    numbers = range(len(automaton.runners))
    claims |= {f"a{number}": number not in answer.unreachable for number in numbers}
    assert {claim: proved.ever([claim]) for claim in claims} == claims
    assert proved.endless() == (answer.endless is not NEVER)
    orphans = dict(answer.orphans)
    assert [proved.orphaned([number]) for number in numbers] == [
        each in orphans for each in numbers
    ]


@settings(max_examples=many(60))
@given(whole=plans(max_runners=6))
def test_the_machine_of_a_plan_has_the_facts_of_the_plan(whole: oracle.P) -> None:
    automaton = compile_plan(plan_of(whole)).automaton
    machine_plan, problems = machine_of(automaton.graph)
    assert machine_plan is not None, problems
    answer = Judge(Exploration(machine_plan.automaton, [PLAIN] * len(automaton.runners))).facts()
    facts = oracle.facts(whole)
    assert facts is not None
    paths = [automaton.plan.path(runner) for runner in automaton.plan.runners]
    assert [answer.completes, answer.gives_up, answer.stuck] == [
        facts["completes"],
        facts["gives_up"],
        facts["stuck"],
    ]
    assert answer.endless is NEVER
    assert not answer.loops
    assert [paths[number] for number in answer.unreachable] == list(facts["unreachable"])
    assert [paths[number] for number, _ in answer.orphans] == list(facts["orphans"])
    assert answer.fewest_failures == facts["fewest_failures_to_give_up"]
    dangling = [
        (paths[automaton.runner_number(each.signal.node)], each.signal.event, each.effect)
        for each in answer.dangling
    ]
    assert dangling == [
        (each["runner"], each["event"], each["effect"]) for each in facts["dangling"]
    ]


def test_a_change_of_the_graph_changes_the_verdict() -> None:
    graph = machine("start SUCCEEDED a", "a FAILED a", "a SUCCEEDED end")
    assert gpsfsm.check(graph).ok
    graph.remove_edge("a", "end")
    graph.add_edge("a", "a", event="SUCCEEDED")
    (report,) = gpsfsm.check(graph, select=["GP3"]).plans
    assert [finding.rule for finding in report.findings] == ["GP304", "GP313"]
