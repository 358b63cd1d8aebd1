"""The proof of structural answers: right ones are proved, planted wrong ones are not."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import gpsfsm
from gpsfsm.analysis.constraints import constraints_of
from gpsfsm.analysis.decide import Deciders
from gpsfsm.analysis.decisions import analyses, fewest
from gpsfsm.analysis.decisions.dangling import DanglingEvent
from gpsfsm.analysis.decisions.joins import Deadlock
from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.analysis.proof.prove import prove
from gpsfsm.analysis.proof.refutation import Refutation
from gpsfsm.analysis.structure import Structure
from gpsfsm.compile import UnitKind, compile_plan
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


def deciders_of(whole: oracle.P | str, up_to: int, assumptions: Sequence[str] = ()) -> Deciders:
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


def chain(pairs: int) -> str:
    """A plan of so many parallel_any of two runners."""
    runner = '<Runner interface="A" provider="A"/>'
    both = f'<Control type="parallel_any">{runner}{runner}</Control>'
    return f"<Plan>{both * pairs}</Plan>"


def rules_of(text: str) -> set[str]:
    (report,) = gpsfsm.check(text).plans
    return {finding.rule for finding in report.findings if finding.severity == "error"}


both_sizes = pytest.mark.parametrize("pairs", [1, 125])


@both_sizes
def test_a_failure_too_many_is_a_defect_at_any_size(
    pairs: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The run has two failures where three are claimed, and the third class has no member."""
    assert rules_of(chain(pairs)) == set()
    right = fewest._parallel

    def wrong(children: Any, needed: int, *, waits: bool) -> Any:
        unit = right(children, needed, waits=waits)
        return unit._replace(failure=unit.failure + (needed == 1))

    monkeypatch.setattr(fewest, "_parallel", wrong)
    assert rules_of(chain(pairs)) == {"GP903"}
    monkeypatch.setattr(fewest, "_require_spans", lambda *_: None)
    assert rules_of(chain(pairs)) == {"GP903"}  # by the run alone


@both_sizes
def test_a_run_that_does_not_show_its_claim_is_a_defect_at_any_size(
    pairs: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Structure, "failing", lambda *_: iter([0]))  # of two that have to fail
    deciders = deciders_of(chain(pairs), WHOLE)
    answers = proposed(deciders)
    with pytest.raises(InternalError, match="does not show"):
        prove(deciders, answers)


@both_sizes
@pytest.mark.parametrize(
    "wrong",
    [
        lambda spans, unit, child: {**spans, child: spans[unit]},  # not disjoint
        lambda spans, unit, child: {**spans, child: (0, 0)},  # empty
        lambda spans, unit, child: {each: spans[each] for each in spans if each != child},
    ],
)
def test_classes_that_leave_a_failure_out_are_a_defect(pairs: int, wrong: Any) -> None:
    deciders = deciders_of(chain(pairs), WHOLE)
    structure = deciders.structure
    assert structure is not None
    spans = fewest.spans_of(structure, 2)
    units = structure.units
    unit = next(u for u in spans if units.kinds[u] is UnitKind.ANY)
    with pytest.raises(InternalError, match="classes of failures"):
        fewest._require_spans(structure, wrong(spans, unit, units.children[unit][0]))


def test_a_class_without_a_member_is_a_defect(monkeypatch: pytest.MonkeyPatch) -> None:
    deciders = deciders_of(chain(1), WHOLE)
    structure = deciders.structure
    assert structure is not None
    spans = fewest.spans_of(structure, 2)
    monkeypatch.setattr(fewest, "spans_of", lambda *_: spans)
    with pytest.raises(InternalError, match="no member"):
        fewest.refute(3, Refutation(structure))


def test_failures_that_must_come_and_are_not_needed_come_too_late() -> None:
    both = '<Control type="parallel_all"><Runner interface="A" provider="A"/>\n'
    text = f'<Plan>{both}<Runner interface="B" provider="B"/></Control></Plan>'
    deciders = deciders_of(text, WHOLE, ["A fails", "B fails"])
    answers = proposed(deciders)
    assert answers["fewest"] == 1
    assert not prove(deciders, answers).unproved
