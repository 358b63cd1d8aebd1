"""Structural answers about pairs of runner instances against brute force."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.analysis.structure import Paths, Structure
from tests import oracle
from tests.oracle import FAILED, SUCCEEDED
from tests.strategies import plans
from tests.support import decided

if TYPE_CHECKING:
    from collections.abc import Sequence


def together(whole: oracle.P, sure: Sequence[str] = ()) -> set[tuple[str, str, str]]:
    """(runner, its outcome, later runner) where some run has the outcome and triggers the later.

    ``sure`` are the paths of runners that never fail. By the structure of the plan.
    """
    paths = oracle.runner_paths(whole)
    said = [f"never fails: {', '.join(sure)}"] if sure else []
    deciders = decided(whole, assumptions=said, solver="structural").deciders
    structure = Structure(deciders.compiled, deciders.constraints)
    walks, unit_of = Paths(structure), structure.unit_of
    return {
        (path, outcome, other)
        for number, path in enumerate(paths)
        for later, other in enumerate(paths[number + 1 :], number + 1)
        for outcome in (SUCCEEDED, FAILED)
        if walks.happen_together(unit_of[number], outcome == SUCCEEDED, unit_of[later])
    }


def by_brute_force(whole: oracle.P, sure: Sequence[str] = ()) -> set[tuple[str, str, str]]:
    system = oracle.System(whole)
    runs = system.allowed(
        consistent=False,
        constraint=lambda scenario: all(scenario[path] == SUCCEEDED for path in sure),
    )
    pairs = set()
    for run in runs:
        triggered = [path for path in system.paths if run.triggers(path)]
        scenario = run.scenario
        pairs |= {
            (path, scenario[path], other)
            for number, path in enumerate(triggered)
            for other in triggered[number + 1 :]
        }
    return pairs


def test_every_unit_of_a_parallel_any_fails_before_its_recovery() -> None:
    a, b = (f"/Plan/Control[1]/Runner[{number}]" for number in (1, 2))
    help_ = "/Plan/Control[2]/Runner[1]"
    whole = oracle.plan(oracle.par_any("A", "B"), oracle.rec("Help"))
    assert {(a, FAILED, help_), (b, FAILED, help_)} <= together(whole)
    assert together(whole) == by_brute_force(whole)
    assert not {each for each in together(whole, sure=[b]) if each[2] == help_}


@given(plans(max_runners=8), st.data())
def test_what_happens_together(whole: oracle.P, data: st.DataObject) -> None:
    paths = oracle.runner_paths(whole)
    sure = data.draw(st.lists(st.sampled_from(paths), unique=True, max_size=3)) if paths else []
    assert together(whole, sure) == by_brute_force(whole, sure)


def test_by_hand() -> None:
    go, say = "demo/GoRunner x=1", "demo/SayRunner"
    first, inner = "/Plan/Runner[1]", "/Plan/Control[1]/Runner[1]"
    assert together(oracle.plan(go, say)) == {(first, SUCCEEDED, "/Plan/Runner[2]")}
    guarded = oracle.plan(go, oracle.rec(say))
    assert together(guarded) == {(first, FAILED, inner)}
    assert together(guarded, [first]) == set()
    beside = oracle.plan(oracle.par_any(go, say))
    other = "/Plan/Control[1]/Runner[2]"
    assert together(beside) == {(inner, SUCCEEDED, other), (inner, FAILED, other)}
