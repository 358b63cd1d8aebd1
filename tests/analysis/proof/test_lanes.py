"""Runs side by side against the evaluator, which plays one at a time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.analysis.evaluate import Evaluator
from gpsfsm.analysis.proof.witnesses import Lanes, at_least
from gpsfsm.compile import compile_plan
from gpsfsm.model.event import Outcome
from tests.strategies import plans
from tests.support import plan_of

if TYPE_CHECKING:
    from tests import oracle


@given(data=st.data(), whole=plans(min_runners=1))
def test_each_lane_is_a_run(data: st.DataObject, whole: oracle.P) -> None:
    automaton = compile_plan(plan_of(whole)).automaton
    numbers, count = range(len(automaton.runners)), 7
    masks = st.integers(0, 2**count - 1)
    failing = {number: data.draw(masks) for number in numbers}
    held = {number: data.draw(masks) for number in numbers}
    lanes = Lanes(automaton, count, failing, held, {})
    evaluator = Evaluator(automaton)
    for lane in range(count):
        run = evaluator.run(
            lambda n, bit=lane: Outcome.FAILED if failing[n] >> bit & 1 else Outcome.SUCCEEDED,
            withheld=[number for number in numbers if held[number] >> lane & 1],
        )
        shown = {node for node, each in enumerate(lanes.triggered) if each >> lane & 1}
        assert shown - {0} == set(run.triggered) - {0}
        assert lanes.failures(1 << lane) == run.failures


@given(lanes=st.lists(st.integers(0, 255), min_size=1, max_size=9), need=st.integers(1, 10))
def test_counting_is_that_of_each_lane(lanes: list[int], need: int) -> None:
    counted = at_least(need, lanes)
    for lane in range(8):
        assert (counted >> lane & 1) == (sum(each >> lane & 1 for each in lanes) >= need)
