"""Ties: runners with one outcome until something resets it, against the brute force and z3."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import assume, given, reject, settings
from hypothesis import strategies as st

from gpsfsm.analysis.machines.decide import Judge
from gpsfsm.analysis.machines.proof import Completeness, Formulas
from gpsfsm.analysis.machines.search import Exploration
from gpsfsm.analysis.options import InconclusiveError
from gpsfsm.checking.machine_check import never
from gpsfsm.compile.instants import FAILED, SUCCEEDED
from gpsfsm.errors import InternalError
from gpsfsm.model.automaton import Reset, Signal, Tie
from gpsfsm.model.event import Event, Outcome
from tests.analysis.machines.random_machines import automaton_of, machine, machines, ties
from tests.cases import many
from tests.oracle import machines as oracle

if TYPE_CHECKING:
    from gpsfsm.model.automaton import Automaton

PLAIN = frozenset({Outcome.SUCCEEDED, Outcome.FAILED})


def proved(exploration: Exploration, *claims: str) -> None:
    """Have z3 prove an exploration, and that nothing claimed ever happens."""
    ties = exploration.instants.ties
    formulas = Formulas(exploration.automaton, exploration.allowed_outcomes, ties)
    nothing = never(Judge(exploration).facts(), formulas)
    Completeness(exploration, formulas).require([*nothing, *claims], rlimit=100_000_000)


def names_of(automaton: Automaton) -> list[str]:
    """The names that the graph gives to the nodes."""
    plan = automaton.plan
    return [
        plan.path(plan.elements[node.origin]).removeprefix("/machine/") for node in automaton.nodes
    ]


def of_the_oracle(automaton: Automaton, rows: list[Tie]) -> list[oracle.Tie]:
    """The ties with the names of the graph's nodes."""
    names = names_of(automaton)

    def name(number: int) -> str:
        return names[automaton.runner_node(number)]

    return [
        oracle.Tie(
            frozenset(map(name, tie.runners)),
            frozenset(map(name, tie.writers)),
            frozenset(
                (
                    (names[each.signal.node], str(each.signal.event)),
                    frozenset(map(name, each.before)),
                )
                for each in tie.resets
            ),
        )
        for tie in rows
    ]


@settings(max_examples=many(150))
@given(graph=machines(most_runners=4), data=st.data())
def test_facts_under_ties_are_those_of_the_brute_force(graph: Any, data: st.DataObject) -> None:
    automaton = automaton_of(graph)
    rows = data.draw(ties(automaton))
    assume(rows)
    allowed = [PLAIN] * len(automaton.runners)
    try:
        exploration = Exploration(automaton, allowed, ties=rows, limit=400)
        wanted = oracle.machine_facts(graph, ties=of_the_oracle(automaton, rows), most=1_000)
    except (InconclusiveError, oracle.TooLargeError):
        reject()
    answers = Judge(exploration).facts()
    names = names_of(automaton)
    for fact in ("completes", "gives_up", "stuck", "endless", "completes_if_fair"):
        assert str(getattr(answers, fact)) == wanted[fact], fact
    assert answers.fewest_failures == wanted["fewest_failures_to_give_up"]
    runners = [names[automaton.runner_node(number)] for number in range(len(allowed))]
    assert sorted(runners[number] for number in answers.unreachable) == sorted(
        wanted["unreachable"]
    )
    assert sorted(runners[number] for number, _ in answers.orphans) == sorted(wanted["orphans"])
    dangling = [
        (names[each.signal.node], str(each.signal.event), each.effect) for each in answers.dangling
    ]
    assert sorted(dangling) == sorted(wanted["dangling"])
    waiting = [(names[each.node], each.effect) for each in answers.waiting]
    assert sorted(waiting) == sorted(wanted["join_deadlocks"])
    proved(exploration)


CHAIN = (
    *("start SUCCEEDED a", "a SUCCEEDED w", "a FAILED w", "w SUCCEEDED b", "b SUCCEEDED end"),
    "b FAILED lost",
)


@pytest.mark.parametrize(
    ("tie", "both"),
    [
        (Tie((0, 2)), False),
        (Tie((0, 2), writers=(1,)), True),
        (Tie((0, 2), resets=(Reset(Signal(2, Event.STARTED)),)), True),
        (Tie((0, 2), resets=(Reset(Signal(2, Event.FAILED)),)), False),
    ],
)
def test_what_the_first_answers_the_second_does_until_it_is_reset(tie: Tie, both: bool) -> None:
    automaton = automaton_of(machine(*CHAIN))
    assert names_of(automaton)[1:4] == ["a", "w", "b"]
    exploration = Exploration(automaton, [PLAIN] * 3, ties=[tie])
    answers = {
        tuple(step.outcome for step in exploration.steps[at])
        for at, each in enumerate(exploration.configurations)
        if each.active == 4
    }
    assert answers == ({(SUCCEEDED, FAILED)} if both else {(SUCCEEDED,), (FAILED,)})
    proved(exploration)


@pytest.mark.parametrize("listed", [True, False])
def test_z3_notices_where_the_search_forgot_a_tie_or_made_one_up(listed: bool) -> None:
    automaton = automaton_of(machine(*CHAIN))
    exploration = Exploration(automaton, [PLAIN] * 3, ties=[Tie((0, 2))])
    at = next(n for n, each in enumerate(exploration.configurations) if each.active == 4)
    if listed:  # a step that the tie rules out
        (step,) = exploration.steps[at]
        other = FAILED if step.outcome == SUCCEEDED else SUCCEEDED
        exploration.steps[at].append(step._replace(outcome=other))
    else:
        exploration.steps[at].clear()
    formulas = Formulas(automaton, exploration.allowed_outcomes, exploration.instants.ties)
    with pytest.raises(InternalError):
        Completeness(exploration, formulas).require((), rlimit=100_000_000)
