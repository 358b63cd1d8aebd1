"""z3's proof of an exploration: it holds, and it fails for everything that may be wrong."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st

from gpsfsm.analysis.machines.decide import Judge
from gpsfsm.analysis.machines.proof import Completeness, Formulas
from gpsfsm.analysis.machines.search import Exploration
from gpsfsm.analysis.options import InconclusiveError
from gpsfsm.errors import InternalError
from gpsfsm.model.event import Outcome
from tests.analysis.machines.random_machines import (
    PLAIN,
    automaton_of,
    machine,
    machines,
    outcomes,
)
from tests.cases import many

if TYPE_CHECKING:
    from collections.abc import Callable

STEPS = 50_000_000
LOOP = (
    *("start SUCCEEDED a", "a STARTED b", "a SUCCEEDED j", "b SUCCEEDED j", "j SUCCEEDED end"),
    *("a FAILED stop b", "a FAILED a", "a FAILED stop j"),
)


def explored(hang: bool = False) -> Exploration:
    """The exploration of a machine with a loop, a join and stops."""
    automaton = automaton_of(machine(*LOOP, j=2))
    return Exploration(automaton, [PLAIN | {Outcome.HANG} if hang else PLAIN] * 2)


def prove(exploration: Exploration, *claims: str, rlimit: int = STEPS) -> None:
    """Have it proved, and that the claims never hold."""
    formulas = Formulas(exploration.automaton, exploration.allowed_outcomes)
    Completeness(exploration, formulas).require(claims, rlimit=rlimit)


def test_a_complete_exploration_is_proved() -> None:
    prove(explored())
    prove(explored(hang=True))
    prove(explored(), "gave_up", "(and a0 completed)")


def test_claims_that_hold_in_a_configuration_are_not_proved() -> None:
    for claim in ("completed", "(and a0 (not i0))", "(not a0)"):
        with pytest.raises(InternalError):
            prove(explored(), claim)


def test_a_proof_has_a_limit_of_steps() -> None:
    with pytest.raises(InconclusiveError):
        prove(explored(), rlimit=100)
    text = Completeness(explored(), Formulas(explored().automaton, [PLAIN] * 2)).text(())
    with pytest.raises(InconclusiveError):
        prove(explored(), rlimit=10 * len(text) + 1)


def a_lost_configuration(exploration: Exploration) -> None:
    last = len(exploration.configurations) - 1
    exploration.configurations.pop()
    exploration.reached -= 1
    exploration.steps.pop()
    for number, steps in enumerate(exploration.steps):
        exploration.steps[number] = [step for step in steps if step.target != last]


def a_lost_step(exploration: Exploration) -> None:
    exploration.steps[0].pop()


def another_target(exploration: Exploration) -> None:
    step = exploration.steps[0][0]
    exploration.steps[0][0] = step._replace(target=(step.target + 1) % exploration.reached)


def another_end_of_a_visit(exploration: Exploration) -> None:
    step = exploration.steps[0][0]
    exploration.steps[0][0] = step._replace(moved=step.moved ^ 3)


def another_join(exploration: Exploration) -> None:
    step = exploration.steps[0][0]
    exploration.steps[0][0] = step._replace(joined=step.joined ^ 1)


def another_beginning(exploration: Exploration) -> None:
    first = exploration.configurations[0]
    exploration.configurations[0] = first._replace(active=first.active ^ 2)


@pytest.mark.parametrize(
    "tamper",
    [
        a_lost_configuration,
        a_lost_step,
        another_target,
        another_end_of_a_visit,
        another_join,
        another_beginning,
    ],
)
def test_a_wrong_exploration_is_refuted(tamper: Callable[[Exploration], None]) -> None:
    exploration = explored()
    tamper(exploration)
    with pytest.raises(InternalError):
        prove(exploration)


def test_what_is_compared_with_is_proved_too() -> None:
    automaton = automaton_of(machine("start SUCCEEDED a", "a SUCCEEDED b", "a FAILED lost"))
    exploration = Exploration(automaton, [frozenset({Outcome.FAILED}), PLAIN])
    answers = Judge(exploration).facts()
    assert [each.effect for each in answers.dangling] == ["give_up"]
    (key,) = exploration.others
    prove(exploration)
    exploration.others[key] = 0
    with pytest.raises(InternalError):
        prove(exploration)


@settings(max_examples=many(25))
@given(graph=machines(most_runners=4), data=st.data())
def test_explorations_are_proved(graph: Any, data: st.DataObject) -> None:
    automaton = automaton_of(graph)
    try:
        exploration = Exploration(automaton, data.draw(outcomes(len(automaton.runners))), limit=200)
    except InconclusiveError:
        reject()
    Judge(exploration).facts()
    prove(exploration)
    reached = exploration.configurations[data.draw(st.integers(0, exploration.reached - 1))]
    active = [
        f"a{number}" if reached.active >> number & 1 else f"(not a{number})"
        for number in range(len(automaton.runners))
    ]
    with pytest.raises(InternalError):
        prove(exploration, f"(and {' '.join(active)} true)")
