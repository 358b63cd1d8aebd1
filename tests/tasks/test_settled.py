"""What can come between two events, held against the moves of the plans."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import event, given

from gpsfsm.analysis.constraints import constraints_of
from gpsfsm.compile import compile_plan
from gpsfsm.tasks.counterexample import Plays
from gpsfsm.tasks.following import Settled
from gpsfsm.tasks.ltlf import TooLargeError
from tests.oracle import P, par_all, par_any, plan, rec, seq
from tests.support import plan_of
from tests.tasks.test_deciding import small_plans
from tests.tasks.test_symbolic import OPTIONS

if TYPE_CHECKING:
    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.compile import Compiled


def together(compiled: Compiled, constraints: Constraints) -> set[tuple[int, int]]:
    """The pairs of nodes of instances that are triggered and not over at some moment of a run."""
    plays = Plays(compiled, constraints)
    pairs: set[tuple[int, int]] = set()
    todo = [plays.first()]
    seen = set(todo)
    while todo:
        position = todo.pop()
        mask = position.waiting | position.active | position.silent
        here = [node for node in range(mask.bit_length()) if mask >> node & 1]
        pairs |= {(one, other) for one in here for other in here if one != other}
        if position.end is not None and not position.waiting:
            continue
        after = {plays.after(position, move) for move in plays.moves(position)} - seen
        seen |= after
        todo += after
    return pairs


def compiled_of(whole: P, **options: object) -> tuple[Compiled, Constraints]:
    made = plan_of(whole)
    constraints = constraints_of(made, **options)  # type: ignore[arg-type]
    return compile_plan(made, start_chain=constraints.no_start), constraints


@given(small_plans(6), OPTIONS)
def test_whoever_is_active_at_once_is_said_to_be(whole: P, options: dict) -> None:
    compiled, constraints = compiled_of(whole, **options)
    settled = Settled(compiled.automaton)
    pairs = together(compiled, constraints)
    event(f"one at a time: {settled.alone}")
    assert not (settled.alone and pairs)
    for one, other in pairs:
        assert settled.beside(one) >> other & 1


@pytest.mark.parametrize(
    ("whole", "pairs"),
    [
        (plan("demo/A", rec("demo/B"), "demo/C"), set()),
        (plan(par_all("demo/A", "demo/B"), "demo/C"), {(1, 2)}),
        (plan(par_any("demo/A", "demo/B"), "demo/C"), {(1, 2), (1, 3), (2, 3)}),
        (
            plan(par_all(seq("demo/A", "demo/B"), "demo/C"), rec("demo/D")),
            {(1, 3), (2, 3), (1, 4), (2, 4), (3, 4)},
        ),
    ],
)
def test_pairs(whole: P, pairs: set[tuple[int, int]]) -> None:
    settled = Settled(compiled_of(whole)[0].automaton)
    nodes = range(1, len(whole.children) + 4)
    assert {
        (one, other)
        for one in nodes
        for other in nodes
        if one < other and settled.beside(one) >> other & 1
    } == pairs


def test_a_large_plan_with_instances_side_by_side_is_beyond_the_limit() -> None:
    whole = plan(par_all(*["demo/A"] * 2_000))
    with pytest.raises(TooLargeError):
        Settled(compiled_of(whole)[0].automaton)
    assert Settled(compiled_of(plan(*["demo/A"] * 2_001))[0].automaton).alone
