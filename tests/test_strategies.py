"""The strategies that users get: what they draw is what they say, and all of it."""

from __future__ import annotations

import builtins
import subprocess
import sys
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import HealthCheck, find, given, settings
from hypothesis import strategies as st

import gpsfsm
import gpsfsm.strategies
from gpsfsm.capabilities.library import Library, builtin_capabilities
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.compile.plan_text import read_plan
from gpsfsm.fuzzing import play, subject_of
from gpsfsm.model.capability import Interface, Parameter, Provider, ValueType
from gpsfsm.model.finding import Severity
from gpsfsm.simulation.load import read_world
from gpsfsm.strategies import (
    DEFECTS,
    Answer,
    answers,
    controls,
    forests,
    plans,
    runners,
    scenarios,
    worlds,
)
from gpsfsm.syntax import parse
from tests.cases import many

if TYPE_CHECKING:
    from collections.abc import Callable

ONCE = settings(database=None, suppress_health_check=list(HealthCheck))


@given(plans(max_runners=6))
def test_plans_read_without_errors(text: str) -> None:
    parsed = parse(text)
    assert parsed.plan is not None
    severe = [each for each in parsed.problems if each.rule not in ("GP109", "GP113")]
    assert severe == []
    assert 1 <= len(parsed.plan.runners) + (parsed.plan.dropped_completion is not None) <= 6


@given(st.data())
def test_the_bounds_of_plans_are_kept(data: st.DataObject) -> None:
    size = data.draw(st.integers(1, 5))
    runner = st.just('<Runner interface="a/Go" provider="a/Go"/>')
    text = data.draw(plans(runner, min_runners=size, max_runners=size, max_depth=0))
    assert text.count("<Runner") == size
    assert "<Control" not in text


@given(runners())
def test_runners_fit_the_library(text: str) -> None:
    report = check_text(f"<Plan>{text}</Plan>", "plan.xml", CheckOptions())
    wrong = {"GP201", "GP202", "GP203", "GP205", "GP206"}
    assert not wrong & {finding.rule for finding in report.findings}, report.findings


def test_values_keep_to_what_is_declared() -> None:
    described = (
        Parameter("level", ValueType.INT, required=True, minimum=3, maximum=5),
        Parameter("mode", ValueType.STRING, required=True, choices=("fast", "slow")),
        Parameter("cold", ValueType.DOUBLE, required=True, maximum=-2.0),
    )
    provider = Provider("a/A", implements="a/A", described=True, configuration=described)
    library = Library((Interface("a/A"),), (provider,))

    @given(runners(library))
    def check(text: str) -> None:
        parsed = parse(f"<Plan>{text}</Plan>").plan
        assert parsed is not None
        parameters = parsed.runners[0].parameters
        assert parameters["level"] in (3, 4, 5)
        assert parameters["mode"] in ("fast", "slow")
        assert float(parameters["cold"]) <= -2.0

    check()
    with pytest.raises(ValueError, match="no runner"):
        runners(Library())


def test_every_runner_of_the_library_is_drawn() -> None:
    names = {one.name for one in builtin_capabilities().library.providers if not one.deprecated}
    drawn: set[str] = set()

    @settings(max_examples=many(200), database=None, suppress_health_check=list(HealthCheck))
    @given(runners())
    def collect(text: str) -> None:
        drawn.add(text.partition('provider="')[2].partition('"')[0])

    collect()
    assert drawn <= names
    assert len(drawn) > 10


@given(controls(types=("parallel_any", "recovery"), min_children=1, max_children=3))
def test_controls(text: str) -> None:
    assert text.startswith(('<Control type="parallel_any">', '<Control type="recovery">'))
    assert 1 <= text.count("<Runner") <= 3


@given(forests(st.just(1), lambda _word, inside: sum(inside), size=7))
def test_forests_hold_exactly_as_many_runners_as_asked_for(expected: tuple[int, ...]) -> None:
    assert sum(expected) == 7


@given(st.data(), plans(max_runners=4))
def test_scenarios_can_be_played(data: st.DataObject, text: str) -> None:
    subject = subject_of(text)
    scenario = data.draw(scenarios(subject, max_faults=1))
    assert len(scenario.faults) <= 1 or any(fates[0] != "SUCCEEDED" for fates in subject.fates)
    assert play(subject, scenario).status in ("COMPLETED", "GAVE_UP", "STUCK")


def test_scenarios_shrink_to_the_plain_one() -> None:
    go = '<Runner interface="a/Go" provider="a/Go"/>'
    subject = subject_of(f"<Plan>{go * 3}</Plan>")
    assert find(scenarios(subject), lambda _: True, settings=ONCE) == subject.plain
    example = find(scenarios(subject), lambda each: len(each.faults) > 1, settings=ONCE)
    assert len(example.faults) == 2
    assert {act.fate for act in example.acts} == {"SUCCEEDED", "FAILED"}


@given(worlds())
def test_worlds_read_without_errors(text: str) -> None:
    world = read_world(text.encode(), library=builtin_capabilities().library)
    assert world.name == "drawn"


# --- answers -------------------------------------------------------------------------------------

EXPECTED: dict[str, set[str]] = {
    "plan-attributes": {"GP112"},
    "hallucinated-element": {"GP105"},
    "no-runner": {"GP105"},
    "packed-coordinates": {"GP111", "GP203", "GP205", "GP204"},
    "unknown-control-type": {"GP106"},
    "missing-control-type": {"GP106", "GP107"},
    "foreign-attribute": {"GP112"},
    "empty-control": {"GP109"},
    "recovery-first": {"GP307"},
    "recovery-before-goal": {"GP307"},
    "missing-attribute": {"GP107", "GP202", "GP201"},
    "misspelt-interface": {"GP201", "GP202", "GP212"},
    "explicit-completion": {"GP113"},
    "truncated": {"GP101", "GP104", "GP108"},
    "missing-close": {"GP101"},
    "mismatched-tag": {"GP101"},
    "duplicated-attribute": {"GP110", "GP101"},
    "unquoted-attribute": {"GP101"},
    "doubled-equals": {"GP101"},
    "space-in-tag": {"GP101"},
    "entity": {"GP101", "GP102"},
    "missing-root": {"GP104"},
    "empty": {"GP104"},
    "prose-only": {"GP104"},
}
"""What a check says of an answer with this defect alone: one of these at least."""

HARMLESS = ("declaration", "several-plans", "fence", "prose-before", "prose-after")
SIMPLE = plans(
    st.just(
        '<Runner interface="nav2_capabilities/WaypointRunner" '
        'provider="nav2_capabilities/WaypointRunner" x="1.0" y="2.0"/>'
    ),
    min_runners=2,
    max_runners=3,
    max_depth=1,
)


def with_defect(name: str) -> Any:
    return answers(SIMPLE, defects=(name,), min_defects=1).filter(lambda actual: actual.defects)


def rules_of(answer: Answer) -> set[str]:
    report = check_text(answer.text, "answer", CheckOptions(from_response=True))
    return {finding.rule for finding in report.findings}


@pytest.mark.parametrize("name", EXPECTED)
@settings(max_examples=many(15), suppress_health_check=list(HealthCheck))
@given(st.data())
def test_a_defect_is_what_it_is_called(name: str, data: st.DataObject) -> None:
    answer = data.draw(with_defect(name))
    assert answer.defects == (name,)
    assert EXPECTED[name] & rules_of(answer), (answer.text, rules_of(answer))


@pytest.mark.parametrize("name", HARMLESS)
@settings(max_examples=many(15), suppress_health_check=list(HealthCheck))
@given(st.data())
def test_what_is_around_a_plan_leaves_it_as_it_is(name: str, data: st.DataObject) -> None:
    answer = data.draw(with_defect(name))
    read = parse(answer.text, from_response=True)
    meant = parse(answer.plan)
    assert read.plan is not None
    assert meant.plan is not None
    assert [each.action for each in read.plan.runners] == [
        each.action for each in meant.plan.runners
    ]


def test_all_defects_are_tried_here_and_have_a_line_of_words() -> None:
    structure = {"recovery-holds-goal", "goals-in-parallel", "rest-in-recovery", "behaviour-tree"}
    assert set(EXPECTED) | set(HARMLESS) | structure == set(DEFECTS)
    assert all(value.endswith(".") for value in DEFECTS.values())


@settings(suppress_health_check=list(HealthCheck))
@given(answers(max_defects=6))
def test_no_answer_is_too_much_for_the_front_end(answer: Answer) -> None:
    assert (answer.text == answer.plan) == (not answer.defects)
    for from_response in (True, False):
        parsed = read_plan(answer.text, from_response=from_response)
        assert parsed.plan is not None or parsed.problems
    report = check_text(answer.text, "answer", CheckOptions(from_response=True))
    assert "GP903" not in {finding.rule for finding in report.findings}
    assert all(isinstance(finding.severity, Severity) for finding in report.findings)


def test_answers_shrink_to_a_plan() -> None:
    example = find(answers(SIMPLE), lambda _: True, settings=ONCE)
    assert example.defects == ()
    assert example.text == example.plan


def test_an_unknown_defect_is_refused() -> None:
    with pytest.raises(
        ValueError, match="there is no defect 'typo'; the defects are plan-attributes"
    ):
        answers(defects=("typo",))


# --- the package ---------------------------------------------------------------------------------


def test_the_names_of_the_package() -> None:
    assert dir(gpsfsm.strategies) == sorted(gpsfsm.strategies.__all__)
    for name in gpsfsm.strategies.__all__:
        assert getattr(gpsfsm.strategies, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = gpsfsm.strategies.nothing


def test_hypothesis_is_imported_when_it_is_used() -> None:
    code = "import gpsfsm.strategies, gpsfsm.fuzzing, sys; print('hypothesis' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


def test_without_hypothesis_it_is_said_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    imported: Callable[..., Any] = builtins.__import__

    def refuse(name: str, *args: Any, **named: Any) -> Any:
        if name.partition(".")[0] == "hypothesis":
            raise ModuleNotFoundError("No module named 'hypothesis'", name="hypothesis")
        return imported(name, *args, **named)

    monkeypatch.setattr(builtins, "__import__", refuse)
    monkeypatch.delitem(sys.modules, "gpsfsm.strategies._runs")
    with pytest.raises(ImportError, match=r"pip install 'gpsfsm\[fuzz\]'"):
        gpsfsm.strategies.__getattr__("worlds")
