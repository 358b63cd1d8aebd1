"""What is decided about plans on engines, against a brute force that plays the connections."""

from __future__ import annotations

import pytest
from hypothesis import example, given

from gpsfsm.analysis.constraints import constraints_of
from gpsfsm.analysis.decide import decide
from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.capabilities.library import Library
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.compile.engine_text import EngineReading, read_for_engine
from gpsfsm.model.event import End
from gpsfsm.model.report import Facts, Frequency
from tests.engines.plans import plans
from tests.oracle.engine import Machine, scenarios

both = pytest.mark.parametrize("engine", ["fabric-v1", "fabric-v2"])


def reading_of(text: str, engine: str) -> EngineReading:
    reading = read_for_engine(text, engine, "plan.xml", Library())
    assert isinstance(reading, EngineReading), reading
    return reading


def facts_of(reading: EngineReading) -> Facts:
    constraints = constraints_of(reading.plan, bindings=reading.compiled.bindings)
    facts = decide(reading.compiled, constraints, AnalysisOptions(solver="z3")).facts()
    assert facts is not None
    return facts


def frequency(ends: list[set[str]], end: str) -> Frequency:
    if not any(end in each for each in ends):
        return Frequency.NEVER
    return Frequency.ALWAYS if all(each == {end} for each in ends) else Frequency.SOMETIMES


MAP = '<Runner interface="nav2_capabilities/OccupancyGridRunner" provider="a/P"/>'
GO = '<Runner interface="a/A" provider="a/A"/>'


@both
@given(text=plans())
@example(f'<Plan><Control type="parallel_all">{MAP}{GO}</Control></Plan>')  # 2 of 2, and it breaks
@example(f'<Plan>{MAP}<Control type="parallel_all">{MAP}{GO}</Control>{GO}</Plan>')
def test_facts(engine: str, text: str) -> None:
    reading = reading_of(text, engine)
    facts = facts_of(reading)
    machine = Machine(reading.connections)
    played = [machine.ends(scenario) for scenario in scenarios(machine)]
    ends = [one for one, _ in played]
    reached = set().union(*(some for _, some in played))
    assert facts.engine is not None
    assert facts.completes is frequency(ends, "COMPLETED")
    assert facts.engine.hangs is frequency(ends, "HANG")
    assert facts.engine.aborts is frequency(ends, "ABORT")
    assert facts.gives_up is Frequency.NEVER
    assert facts.stuck is Frequency.NEVER
    of_element = {
        each.source.element or 0: number
        for number, each in machine.of.items()
        if number in machine.leaves
    }
    numbers = [of_element[element] for element in sorted(of_element)]  # in document order
    lost = tuple(
        reading.plan.path(runner)
        for runner, number in zip(reading.plan.runners, numbers, strict=True)
        if number not in reached
    )
    assert facts.unreachable == lost


def test_a_scenario_in_which_two_joins_break_is_shown() -> None:
    """The last join breaks after completion, another one may do so before."""
    one, two = f'<Control type="parallel_any">{GO}</Control>', f"{GO}{GO}"
    text = f"<Plan>{GO}{one}{two}{one}{two}{one}</Plan>"
    report = check_text(
        text,
        "plan.xml",
        CheckOptions(analysis=AnalysisOptions(faults=("hang",)), engine="fabric-v1"),
    )
    rules = [finding.rule for finding in report.findings]
    assert "GP903" not in rules
    shown = [each.scenario for each in report.findings if each.rule == "GP704"]
    assert len(shown) == 3
    assert {scenario.ends for scenario in shown if scenario is not None} == {End.ABORT}
