"""The table of options against everything that is written out beside it."""

from __future__ import annotations

import inspect
from dataclasses import fields
from typing import Any

import pytest

from gpsfsm import UsageError, check, gate
from gpsfsm.analysis.constraints import FAULTS
from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.api import CheckSettings
from gpsfsm.checking import CheckOptions
from gpsfsm.checking.option_table import BY_KEYWORD, BY_NAME, NO_EFFECT, OPTIONS, Group, Kind
from gpsfsm.checking.settings import Settings
from gpsfsm.cli._options import CheckValues, FailValues
from gpsfsm.gating.gate_call import DEFAULT_TOTAL_RLIMIT
from gpsfsm.grading.grader import Grader, graded_options
from gpsfsm.grading.rewards import Rewards
from gpsfsm.service.shapes import Wishes
from gpsfsm.tasks.task import Task

KEYWORDS = {keyword: option.initial for keyword, option in BY_KEYWORD.items()}
PLAN = "<Plan><Runner/></Plan>"


def defaults(function: Any) -> dict[str, Any]:
    parameters = inspect.signature(function).parameters.values()
    return {one.name: one.default for one in parameters if one.default is not one.empty}


def test_each_option_is_there_once() -> None:
    assert len(BY_NAME) == len(OPTIONS)
    assert {each.keyword for each in OPTIONS if each.keyword} == set(BY_KEYWORD)


def test_check_has_the_keywords_of_the_table() -> None:
    assert defaults(check) == {**KEYWORDS, "limits": None, "progress": None}
    expected = {**KEYWORDS, "limits": None}
    assert {each.name: each.default for each in fields(CheckSettings)} == expected


def test_gate_has_those_that_do_something() -> None:
    own = {
        "allow",
        "budget_ms",
        "fail_on",
        "allow_suppressions",
        "allow_empty",
        "allow_trees",
        "allow_approximated",
        "task",
    }
    shared = {name: value for name, value in defaults(gate).items() if name not in own}
    left_out = {"select", "max_scenarios", "require_proof"}  # a gate always requires the proof
    expected = {name: value for name, value in KEYWORDS.items() if name not in left_out}
    # a gate has a clock, and its steps run out before the time is up
    assert shared == {**expected, "limits": None, "total_rlimit": DEFAULT_TOTAL_RLIMIT}


def test_the_command_line_takes_the_same() -> None:
    names = {each.name for each in OPTIONS if each.group is not Group.OUTPUT}
    of_commands = {each.name for kind in (CheckValues, FailValues) for each in fields(kind)}
    assert of_commands == {*names, "configured"}
    assert CheckValues().options() == CheckSettings().options()


def test_requests_have_the_fields_of_the_table() -> None:
    expected = {each.keyword for each in OPTIONS if each.service is not None}
    assert set(Wishes.model_fields) == expected
    for name, field in Wishes.model_fields.items():
        option = BY_KEYWORD[name]
        assert option.service is not None
        if not option.service.undefined:
            default = field.get_default()
            assert (tuple(default) if isinstance(default, list) else default) == option.initial
        assert field.description == (option.service.description or None)


def test_files_have_the_keys_of_the_table() -> None:
    assert list(Settings.model_fields) == [*BY_NAME, "model"]


def test_the_analysis_has_the_same_defaults() -> None:
    analysis = AnalysisOptions()
    for name in ("consistent", "faults", "solver", "rlimit", "total_rlimit", "max_scenarios"):
        assert getattr(analysis, name) == KEYWORDS[name]
    assert BY_NAME["faults"].choices == tuple(FAULTS)


WRONG: list[tuple[str, Any]] = [
    *((name, "GP3") for name, option in BY_KEYWORD.items() if option.kind.is_list),
    *((name, 3) for name, option in BY_KEYWORD.items() if option.kind.is_list),
    *((name, [3]) for name, option in BY_KEYWORD.items() if option.kind.is_list),
    *((name, b"GP3") for name, option in BY_KEYWORD.items() if option.kind.is_list),
    *((name, "yes") for name, option in BY_KEYWORD.items() if option.kind is Kind.FLAG),
    *((name, "5") for name, option in BY_KEYWORD.items() if option.kind is Kind.COUNT),
    *((name, 1.5) for name, option in BY_KEYWORD.items() if option.kind is Kind.COUNT),
    *((name, True) for name, option in BY_KEYWORD.items() if option.kind is Kind.COUNT),
    *((name, "5") for name, option in BY_KEYWORD.items() if option.kind is Kind.AMOUNT),
    *((name, 5) for name, option in BY_KEYWORD.items() if option.kind is Kind.CHOICE),
    *((name, ["z3"]) for name, option in BY_KEYWORD.items() if option.kind is Kind.CHOICE),
]


@pytest.mark.parametrize(("name", "value"), WRONG)
def test_a_value_of_another_type_is_refused(name: str, value: Any) -> None:
    with pytest.raises(UsageError, match=name.split("_", maxsplit=1)[0]):
        CheckSettings(**{name: value}).options()


@pytest.mark.parametrize("option", [each for each in OPTIONS if each.kind is Kind.COUNT])
def test_bounds_hold_in_python_as_well(option: Any) -> None:
    if not option.keyword:
        return
    for wrong in (option.least - 1, *([option.most + 1] if option.most else [])):
        with pytest.raises(UsageError, match=option.keyword):
            CheckSettings(**{option.keyword: wrong}).options()
    CheckSettings(**{option.keyword: option.least}).options()


# --- what has no effect --------------------------------------------------------------------------

IDLE = {
    "deadline_s": 5.0,
    "energy_limit_j": 5.0,
    "tolerate": 2,
    "max_scenarios": 1,
    "total_rlimit": 1_000,
    "require_proof": True,
    "from_response": True,
    "select": ["GP3"],
    "ignore": ["GP3"],
    "engine": "fabric-v2",
}


@pytest.mark.parametrize("name", [BY_NAME[name].keyword for name in NO_EFFECT["grade"]])
def test_a_grade_refuses_what_it_cannot_honour(name: str) -> None:
    options = CheckSettings(**{name: IDLE[name]}).options()  # type: ignore[arg-type]
    for make in (lambda: Grader(Task("t"), options), lambda: Rewards(options)):
        with pytest.raises(UsageError, match=f"^{name} has no effect on grade: "):
            make()
    assert Grader(Task("t"), graded_options(options)).options == CheckOptions(
        capabilities=options.capabilities
    )
    Rewards(options, shaping=True)  # here the findings count


@pytest.mark.parametrize("codes", [["GP111"], ["empty-control", "GP203"]])
def test_a_gate_refuses_to_ignore_warnings_that_refuse_nothing(codes: list[str]) -> None:
    with pytest.raises(UsageError, match=r"^ignore has no effect on a gate .* GP111|empty-control"):
        gate(PLAN, ignore=codes, budget_ms=None)
    gate(PLAN, ignore=codes, fail_on="warning", budget_ms=None)


@pytest.mark.parametrize("codes", [["ALL"], ["GP1"], ["GP111", "GP101"]])
def test_a_gate_may_be_told_to_ignore_more_than_warnings(codes: list[str]) -> None:
    gate(PLAN, ignore=codes, budget_ms=None)
