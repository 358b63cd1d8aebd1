"""The proof of structural answers: right ones are proved, planted wrong ones are not."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from gpsfsm.analysis.constraints import constraints_of
from gpsfsm.analysis.decide import Deciders
from gpsfsm.analysis.decisions import analyses
from gpsfsm.analysis.decisions.dangling import DanglingEvent
from gpsfsm.analysis.decisions.joins import Deadlock
from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.analysis.proof.prove import prove
from gpsfsm.compile import compile_plan
from gpsfsm.errors import InternalError
from gpsfsm.model.report import By, Frequency
from tests.cases import many
from tests.strategies import plans
from tests.support import plan_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from tests import oracle

WHOLE, BY_UNITS = 200, 0
"""Up to how many runners the plan is one problem."""

either = pytest.mark.parametrize("up_to", [WHOLE, BY_UNITS])


def deciders_of(whole: oracle.P, up_to: int, assumptions: Sequence[str] = ()) -> Deciders:
    plan = plan_of(whole)
    compiled = compile_plan(plan)
    options = AnalysisOptions(second_opinion=up_to, assumptions=tuple(assumptions))
    return Deciders(compiled, constraints_of(plan, assumptions=assumptions), options)


def proposed(deciders: Deciders) -> dict[str, Any]:
    structure = deciders.structure
    assert structure is not None
    return {each.name: each.by_structure(structure) for each in analyses()}


@either
@settings(max_examples=many(150))
@given(whole=plans(min_runners=1))
def test_right_answers_are_proved(up_to: int, whole: oracle.P) -> None:
    deciders = deciders_of(whole, up_to)
    proof = prove(deciders, proposed(deciders))
    assert set(proof.decided_by) == {each.name for each in analyses()}
    assert proof.decided_by["stuck"] is By.Z3
    open_ = {name for name, by in proof.decided_by.items() if by is By.STRUCTURAL}
    if up_to == WHOLE:
        assert open_ == {"loading"}
        assert not proof.unproved
    else:  # what only z3 by itself could answer is left open, and named
        assert set(proof.unproved) == open_ - {"loading"}
        assert set(proof.unproved.values()) <= {"0 runners"}


@either
@settings(max_examples=many(60))
@given(whole=plans(min_runners=2, max_runners=8), data=st.data())
def test_right_answers_under_assumptions_are_proved(
    up_to: int, whole: oracle.P, data: st.DataObject
) -> None:
    number = len(plan_of(whole).runners)
    sure = st.sampled_from(["line {0} succeeds", "line {0} fails", ""])
    lines = {runner.line for runner in plan_of(whole).runners}
    texts = [data.draw(sure).format(line) for line in sorted(lines)] if number else []
    deciders = deciders_of(whole, up_to, [text for text in texts if text])
    assume(deciders.structure is not None)
    proof = prove(deciders, proposed(deciders))
    assert up_to == BY_UNITS or not proof.unproved


def wrong(answers: Mapping[str, Any], runners: int, blocks: int) -> Iterator[dict[str, Any]]:
    """The same answers, each with one mistake."""
    frequencies = list(Frequency)[:3]
    for place in (0, 1):
        for other in frequencies:
            if answers["completion"][place] is not other:
                changed = list(answers["completion"])
                changed[place] = other
                yield {**answers, "completion": tuple(changed)}
    for name in ("reachability", "orphans"):
        right = set(answers[name])
        for number in range(runners):
            yield {**answers, name: tuple(sorted(right ^ {number}))}
    fewest = answers["fewest"]
    for other_count in {None, 1, 2, (fewest or 0) + 1} - {fewest}:
        yield {**answers, "fewest": other_count}
    for index, dangler in enumerate(answers["dangling"]):
        effect = "dont_care" if dangler.effect == "give_up" else "give_up"
        danglers = list(answers["dangling"])
        danglers[index] = DanglingEvent(dangler.runner, dangler.event, effect)
        yield {**answers, "dangling": tuple(danglers)}
    waiting = dict(answers["joins"])
    for block in range(blocks):
        for effect in ("give_up", "absorbed", None):
            if waiting.get(block) not in (effect, "escalated"):
                joins = {**waiting, block: effect}
                kept = (Deadlock(each, to) for each, to in sorted(joins.items()) if to)
                yield {**answers, "joins": tuple(kept)}


@either
@settings(max_examples=many(30))
@given(whole=plans(min_runners=1, max_runners=6))
def test_a_wrong_answer_is_never_proved(up_to: int, whole: oracle.P) -> None:
    right = deciders_of(whole, up_to)
    answers = proposed(right)
    automaton = right.compiled.automaton
    for changed in wrong(answers, len(automaton.runners), len(automaton.blocks)):
        deciders = deciders_of(whole, up_to)
        (name,) = (each for each in changed if changed[each] != answers[each])
        try:
            proof = prove(deciders, changed)
        except (InternalError, AssertionError, KeyError, ValueError):
            continue  # where nothing shows it, no scenario can be made either
        assert name in proof.unproved, (name, changed[name], answers[name])
