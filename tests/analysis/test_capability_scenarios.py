"""Scenarios of the capability rules: they replay, they show the claim, both deciders tell the same.

That a scenario replays is checked in the product, where a failure is GP903; here it is drawn out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.capabilities.library import Capabilities
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.model.event import Outcome
from tests.cases import many
from tests.oracle import to_xml
from tests.oracle.capabilities import World
from tests.strategies import faults
from tests.strategies_capabilities import (
    libraries,
    plans_over,
    races,
    to_library,
    with_own_providers,
)

if TYPE_CHECKING:
    from collections.abc import Iterable

    from gpsfsm.analysis.options import SolverChoice
    from gpsfsm.model.finding import Finding
    from tests import oracle
    from tests.oracle.capabilities import Described

QUESTIONS = {
    "values": {"values": True, "prompts": False, "clocks": False},
    "prompts": {"values": False, "prompts": True, "clocks": False},
    "clocks": {"values": False, "prompts": False, "clocks": True},
    "everything": {"values": True, "prompts": True, "clocks": True},
}
each_question = pytest.mark.parametrize("question", QUESTIONS)


def findings(
    whole: oracle.P,
    library: tuple[Described, ...],
    *,
    models: Iterable[str] = (),
    consistent: bool = False,
    solver: SolverChoice = "auto",
) -> tuple[Finding, ...]:
    """What is found in a plan over a library, with a deadline and an energy limit."""
    options = CheckOptions(
        analysis=AnalysisOptions(
            faults=tuple(sorted(models)),
            consistent=consistent,
            solver=solver,
            deadline_s=3.0,
            energy_limit_j=3.0,
        ),
        capabilities=Capabilities(to_library(library)),
    )
    return check_text(to_xml(whole), "plan.xml", options).findings


def sound(actual: tuple[Finding, ...]) -> None:
    """No defect of the product, and no scenario that the rules should not have."""
    assert [finding.message for finding in actual if finding.rule == "GP903"] == []
    for finding in actual:
        if finding.rule == "GP501":
            assert finding.scenario is not None
            first, second = (place.location.element for place in finding.related)
            started = {step.element for step in finding.scenario.trace}
            outcomes = dict(finding.scenario.outcomes)
            for element in {first, second} - started:  # it is triggered, but does not start
                assert outcomes[element] is Outcome.NO_START


@each_question
@given(data=st.data())
def test_free_outcomes(question: str, data: st.DataObject) -> None:
    library = data.draw(libraries(**QUESTIONS[question], outcomes=False))
    whole, library = with_own_providers(data.draw(plans_over(library)), library)
    reported = findings(whole, library)
    sound(reported)
    assert findings(whole, library, solver="z3") == reported


@each_question
@given(data=st.data(), models=faults(), consistent=st.booleans())
def test_declared_outcomes_faults_and_consistency(
    question: str, data: st.DataObject, models: frozenset[str], consistent: bool
) -> None:
    library = data.draw(libraries(**QUESTIONS[question], outcomes=True))
    whole, library = with_own_providers(data.draw(plans_over(library)), library)
    sound(findings(whole, library, models=models, consistent=consistent))


@settings(max_examples=many(40))
@given(race=races())
def test_races(race: tuple[oracle.P, tuple[Described, ...]]) -> None:
    whole, library = race
    world = World(whole, library)
    assert world.instances
    reported = findings(whole, library)
    sound(reported)
    assert findings(whole, library, solver="z3") == reported
