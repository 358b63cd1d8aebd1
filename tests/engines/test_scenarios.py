"""Every scenario of a rule about engines happens in the executor as it is told."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings

from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.records import Input, Kind, Load, Start, Stop
from gpsfsm.model.event import Event, Outcome
from gpsfsm.model.report import Verdict
from tests.cases import many
from tests.engines.plans import plans
from tests.engines.test_facts import both, reading_of

if TYPE_CHECKING:
    from gpsfsm.compile import Compiled
    from gpsfsm.model.finding import Scenario

_ANSWERS = {Outcome.SUCCEEDED: Kind.SUCCEEDED, Outcome.FAILED: Kind.FAILED}


def ends(compiled: Compiled, scenario: Scenario) -> str:
    """How the executor ends: what the trace tells comes first and in its order."""
    plan = compiled.automaton.plan
    number_of = {plan.path(runner): number for number, runner in enumerate(plan.runners)}
    outcomes = {number_of[path]: outcome for path, outcome in scenario.outcomes}
    order = [number_of[step.element] for step in scenario.trace if step.event is not Event.STARTED]
    kernel = Kernel(compiled, apart=True)
    active: list[int] = []
    waiting = [Input(Kind.BEGIN)]
    while waiting or active:
        if not waiting:
            number = next((each for each in order if each in active), active[0])
            active.remove(number)
            waiting = [Input(_ANSWERS[outcomes.get(number, Outcome.SUCCEEDED)], number)]
        _, commands = kernel.step(waiting.pop(0))
        for command in commands:
            if isinstance(command, Load):
                waiting.append(Input(Kind.LOADED, runner=command.runner))
            elif isinstance(command, Start):
                active.append(command.number)
            elif isinstance(command, Stop):
                active.remove(command.number)
                waiting.append(Input(Kind.STOPPED, command.number))
    return kernel.status.value


@both
@given(text=plans())
def test_scenarios_replay(engine: str, text: str) -> None:
    report = check_text(text, "plan.xml", CheckOptions(engine=engine))
    assert report.verdict is not Verdict.UNDECIDED, report.findings
    compiled = reading_of(text, engine).compiled
    for finding in report.findings:
        scenario = finding.scenario
        there = finding.rule.startswith("GP7") or (scenario and scenario.ends.value == "HANG")
        if scenario is not None and there:
            assert ends(compiled, scenario) == scenario.ends.value, finding


@both
@pytest.mark.parametrize(
    "options",
    [
        AnalysisOptions(faults=("no-start",)),
        AnalysisOptions(faults=("hang", "no-start")),
        AnalysisOptions(consistent=True),
        AnalysisOptions(assumptions=("never fails: A",)),
    ],
    ids=["no-start", "hang", "consistent", "assume"],
)
@settings(max_examples=many(20))
@given(text=plans(most=5))
def test_every_plan_is_decided(engine: str, options: AnalysisOptions, text: str) -> None:
    """Whatever the options are, no scenario is claimed that does not replay (GP903)."""
    report = check_text(text, "plan.xml", CheckOptions(analysis=options, engine=engine))
    rules = {finding.rule for finding in report.findings}
    assert report.verdict is not Verdict.UNDECIDED or rules & {"GP902", "GP906"}
    assert "GP903" not in rules
