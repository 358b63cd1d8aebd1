"""Options by their definitions, against all scenarios, and mistakes planted in the preparation."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gpsfsm
from gpsfsm.analysis import constraints as prepared
from gpsfsm.analysis import decide as deciding
from gpsfsm.analysis.assumptions import parse_assumption
from gpsfsm.analysis.assumptions.formula import evaluate
from gpsfsm.analysis.constraints import constraints_under
from gpsfsm.analysis.context import Context
from gpsfsm.analysis.definitions import Definitions, truths
from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.compile import compile_plan
from gpsfsm.model.event import Outcome
from tests.cases import many
from tests.strategies import constraints, plans
from tests.support import plan_of

if TYPE_CHECKING:
    from tests import oracle

PAIR = """<Plan>
    <Control type="parallel_any">
        <Runner interface="Look" provider="Look" at="shelf"/>
        <Runner interface="Look" provider="Look" at="shelf"/>
    </Control>
    <Runner interface="Go" provider="Go"/>
</Plan>"""


@settings(max_examples=many(60))
@given(whole=plans(min_runners=1, max_runners=4), data=st.data())
def test_what_is_admitted_has_a_scenario(whole: oracle.P, data: st.DataObject) -> None:
    assumed = data.draw(constraints(whole))
    compiled = compile_plan(plan_of(whole))
    numbers = range(len(compiled.automaton.runners))
    options = AnalysisOptions(consistent=data.draw(st.booleans()), assumptions=(str(assumed),))
    definitions, limits = Definitions(compiled, options), constraints_under(options, compiled)
    every = [each for each in product(Outcome, repeat=len(numbers)) if limits.admit(each)]
    assert list(definitions.scenarios(1_000)) == sorted(every)
    assert definitions.contradictory() is (not every)
    for one, other in product(numbers, numbers):
        for outcomes in product((Outcome.SUCCEEDED, Outcome.FAILED), repeat=2):
            partial = dict(zip((one, other), outcomes, strict=True))
            possible = any(all(each[n] is o for n, o in partial.items()) for each in every)
            if len(partial) == 2 or outcomes[0] is outcomes[1]:
                assert definitions.admits(partial) is possible, partial


TEXTS = (
    "at most 1 of * fails",
    "exactly 2 of * succeed",
    "same: *",
    "not (any Look fails) iff Go succeeds",
    "line 3 fails xor line 4 fails",
    "Go fails implies (all Look succeed or no Look succeeds)",
)


@pytest.mark.parametrize("text", TEXTS)
def test_truth_values_of_open_outcomes(text: str) -> None:
    """None is missing, and where all outcomes are known there is one."""
    formula = parse_assumption(text).bind(plan_of(PAIR)).formula
    both = (Outcome.SUCCEEDED, Outcome.FAILED)
    for rows in product([both, both[:1], both[1:]], repeat=3):
        possible = {evaluate(formula, each.__getitem__) for each in product(*rows)}
        values = truths(formula, rows.__getitem__)
        assert possible <= values
        if all(len(row) == 1 for row in rows):
            assert possible == values


def rules_of(subject: Any, **options: Any) -> set[str]:
    (report,) = gpsfsm.check(subject, **options).plans
    return {finding.rule for finding in report.findings}


@pytest.mark.parametrize(
    "options",
    [
        {"consistent": True, "assume": ["line 3 fails iff Go fails"]},
        {"assume": ["at most 1 of Look fails"]},
        {"faults": ["hang"], "assume": ["Look never hangs", "Go never hangs"]},
    ],
)
def test_a_mistake_of_the_preparation_is_a_defect(
    options: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both deciders of a plan make it: they get what was prepared."""
    assert "GP903" not in rules_of(PAIR, **options)
    right = prepared.constraints_of

    def wrong(plan: Any, **chosen: Any) -> Any:
        return right(plan, **chosen | {"consistent": False, "assumptions": ()})

    monkeypatch.setattr(prepared, "constraints_of", wrong)
    assert "GP903" in rules_of(PAIR, **options)


def test_a_scenario_that_an_option_rules_out_is_a_defect(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(deciding, "_require_definitions", lambda _: None)
    right = Context._canonical

    def wrong(self: Any, claim: Any) -> Any:
        outcome_of = right(self, claim)
        return lambda number: Outcome.FAILED if number == 0 else outcome_of(number)

    monkeypatch.setattr(Context, "_canonical", wrong)
    assert "GP903" in rules_of(PAIR, assume=["line 3 succeeds"])
