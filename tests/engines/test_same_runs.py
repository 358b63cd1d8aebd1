"""Plans that run on an engine as the paper has it, against playing both."""

from __future__ import annotations

from dataclasses import asdict

import pytest
from hypothesis import given

from corpus import generate
from gpsfsm.analysis.constraints import constraints_of
from gpsfsm.analysis.context import Context
from gpsfsm.analysis.decide import decide
from gpsfsm.analysis.on_engine import decided_like
from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.compile import compile_plan
from gpsfsm.compile.engine import same_runs
from gpsfsm.model.report import Frequency
from tests.engines.plans import plans
from tests.engines.test_facts import both, facts_of, reading_of
from tests.equivalence.test_engine_difference import differing


@both
@given(text=plans(most=4))
def test_same_runs_differ_nowhere_and_have_the_same_facts(engine: str, text: str) -> None:
    reading = reading_of(text, engine)
    paper = compile_plan(reading.plan)
    if not same_runs(paper.automaton, reading.compiled.automaton):
        return
    assert not list(differing(reading, paper.automaton))
    options = AnalysisOptions(second_opinion=0)
    on_paper = Context(decide(paper, constraints_of(reading.plan), options))
    decided = decided_like(on_paper, reading.compiled)
    assert decided is not None
    computed, expected = decided.facts(), facts_of(reading)
    assert computed is not None
    assert asdict(computed) == asdict(expected)


@both
@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("<Plan>{0}</Plan>", True),
        ('<Plan>{0}<Control type="recovery">{0}{0}</Control>{0}</Plan>', True),
        ('<Plan><Control type="sequential">{0}{0}</Control>{0}</Plan>', True),
        ('<Plan>{0}<Control type="recovery">{0}</Control></Plan>', True),
        ('<Plan>{0}<Control type="parallel_any">{0}{0}</Control>{0}</Plan>', False),
        (
            '<Plan>{0}<Control type="recovery">{0}</Control>'
            '<Control type="recovery">{0}</Control></Plan>',
            False,
        ),
        (
            '<Plan>{0}<Control type="recovery"><Control type="sequential">{0}</Control></Control>'
            "</Plan>",
            False,
        ),
    ],
)
def test_shapes(engine: str, text: str, same: bool) -> None:
    reading = reading_of(text.format('<Runner interface="a/A" provider="a/A"/>'), engine)
    paper = compile_plan(reading.plan).automaton
    assert same_runs(paper, reading.compiled.automaton) is same


@both
def test_a_long_chain_is_decided(engine: str) -> None:
    """The same verdicts as those of a short one, which z3 decides."""
    options = CheckOptions(engine=engine)
    short, long = (check_text(generate.chain(n), "plan.xml", options) for n in (5, 400))
    assert short.facts is not None
    assert long.facts is not None
    assert long.facts.engine == short.facts.engine
    assert long.facts.engine is not None
    assert long.facts.engine.hangs is Frequency.SOMETIMES
    assert long.facts.completes is short.facts.completes
    rules = [{finding.rule for finding in report.findings} for report in (short, long)]
    assert rules[0] == rules[1]
    effects = [{each.effect for each in facts.dangling} for facts in (short.facts, long.facts)]
    assert effects[0] == effects[1] == {"stuck"}
