"""The plans of the second experiment end on fabric-v2 as they ended on the robot."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

import gpsfsm
from gpsfsm.analysis.evaluate import Evaluator
from gpsfsm.capabilities.library import Library
from gpsfsm.checking import CheckOptions
from gpsfsm.compile.engine_text import EngineReading, read_for_engine
from gpsfsm.gating import GateOptions, gate_text
from gpsfsm.model.event import End, Outcome
from gpsfsm.model.report import Frequency
from tests.engines.test_runtime_traces import play

if TYPE_CHECKING:
    from pathlib import Path

WAYPOINT = "nav2_capabilities/WaypointRunner"
GOAL_ABORTED = ("it1_experiment_1", "it1_experiment_2", "it1_experiment_3")
COMPLETED = {"it2_plan_5": 7, "it2_plan_6": 9, "it2_plan_7": 12, "it2_plan_7a": 5}
"""How many instances ran, all of which succeeded."""
NEVER_RUN = {"it2_plan_7": 3}
"""The steps of its one recovery."""
TEXTS = ("llm_response_1", "fabric_parsed_2")


def reading_of(folder: Path, name: str, text: str) -> EngineReading:
    content = (folder / "experiment2" / f"{name}__{text}.xml").read_bytes()
    reading = read_for_engine(content, "fabric-v2", name, Library())
    assert isinstance(reading, EngineReading), reading
    return reading


@pytest.mark.parametrize("text", TEXTS)
@pytest.mark.parametrize("outcome", [Outcome.FAILED, Outcome.NO_START, Outcome.HANG])
@pytest.mark.parametrize("name", GOAL_ABORTED)
def test_the_first_goal_is_aborted(
    shared_corpus: Path, name: str, outcome: Outcome, text: str
) -> None:
    """It failed, and nothing was connected to that. A goal that is refused would end the same."""
    compiled = reading_of(shared_corpus, name, text).compiled
    runners = compiled.automaton.plan.runners
    assert runners[0].interface == WAYPOINT
    outcomes = [outcome, *[Outcome.SUCCEEDED] * (len(runners) - 1)]
    run = Evaluator(compiled.automaton).run(outcomes.__getitem__)
    assert run.ends is End.HANG
    assert list(run.triggered) == [1]
    lines, status = play(compiled, frozenset({WAYPOINT}))
    assert (lines, status) == ([f"trigger {WAYPOINT}", f"FAILED {WAYPOINT}"], "HANG")


@pytest.mark.parametrize("text", TEXTS)
@pytest.mark.parametrize("name", COMPLETED)
def test_everything_succeeds(shared_corpus: Path, name: str, text: str) -> None:
    compiled = reading_of(shared_corpus, name, text).compiled
    runners = compiled.automaton.plan.runners
    assert len(runners) == COMPLETED[name] + NEVER_RUN.get(name, 0)
    run = Evaluator(compiled.automaton).run(lambda _: Outcome.SUCCEEDED)
    assert run.ends is End.COMPLETED
    ran = [runner for node, runner in enumerate(runners, start=1) if node in run.triggered]
    assert len(ran) == COMPLETED[name]
    lines, status = play(compiled, frozenset())
    assert status == "COMPLETED"
    assert lines == [
        f"{word} {runner.interface}" for runner in ran for word in ("trigger", "SUCCEEDED")
    ]


@pytest.mark.parametrize("name", GOAL_ABORTED)
def test_what_hung_would_never_have_completed(shared_corpus: Path, name: str) -> None:
    """Had the goal been reached, the parallel_all behind it would have waited for ever."""
    file = shared_corpus / "experiment2" / f"{name}__llm_response_1.xml"
    report = gpsfsm.check(file, engine="fabric-v2").plans[0]
    assert report.facts is not None
    assert report.facts.engine is not None
    assert report.facts.engine.hangs is Frequency.ALWAYS
    rules = {finding.rule for finding in report.findings}
    assert {"GP302", "GP703", "GP705", "GP707"} <= rules
    assert not gate_text(
        file.read_bytes(), name, GateOptions(check=CheckOptions(engine="fabric-v2", trees=False))
    ).accepted


@pytest.mark.parametrize("name", COMPLETED)
def test_what_completed_does_so_sometimes_and_runs_as_the_paper_has_it(
    shared_corpus: Path, name: str
) -> None:
    file = shared_corpus / "experiment2" / f"{name}__llm_response_1.xml"
    report = gpsfsm.check(file, engine="fabric-v2").plans[0]
    assert report.facts is not None
    assert report.facts.engine is not None
    assert report.facts.completes is Frequency.SOMETIMES
    assert report.facts.engine.hangs is Frequency.SOMETIMES
    assert report.facts.engine.aborts is Frequency.NEVER
