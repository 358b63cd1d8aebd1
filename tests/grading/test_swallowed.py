"""A plan that hides its failures is told so, graded lower, worth less, and refused with its task.

The second plan is what ``gpsfsm fix --select GP302 --unsafe-fixes`` once made of the first.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

import gpsfsm
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.checking.selection import Selection
from gpsfsm.fixing import fix_text
from gpsfsm.model.finding import Severity
from gpsfsm.report import render

if TYPE_CHECKING:
    from pathlib import Path

    from gpsfsm.model.report import PlanReport

TASK = """
interface: WaypointRunner
places: {lab: {x: 1, y: 2}, store: {x: 3, y: 4}}
actions: {log: {interface: LogRunner}}
steps: [{do: lab, else: store}]
allow: log
"""
_GO = "nav2_capabilities/WaypointRunner"
_LOG = "generic_capabilities/LogRunner"
LAB = f'<Runner interface="{_GO}" provider="{_GO}" x="1" y="2"/>'
STORE = f'<Runner interface="{_GO}" provider="{_GO}" x="3" y="4"/>'
LOG = f'<Runner interface="{_LOG}" provider="{_LOG}" text="lost"/>'
HONEST = f'<Plan>\n{LAB}\n<Control type="recovery">\n{STORE}\n</Control>\n</Plan>\n'
HIDING = HONEST.replace(f"{STORE}\n", f'{STORE}\n<Control type="recovery">\n{LOG}\n</Control>\n')


def checked(text: str) -> PlanReport:
    return check_text(text, "a.xml", CheckOptions())


def test_the_check_tells_it() -> None:
    (finding,) = (each for each in checked(HIDING).findings if each.rule == "GP315")
    assert finding.severity is Severity.WARNING
    assert (finding.location.line, [each.location.line for each in finding.related]) == (4, [6])
    assert finding.message == (
        "the plan completes even if WaypointRunner (x=3, y=4) at line 4 fails: "
        "only LogRunner (text=lost) at line 6 succeeds then"
    )
    assert finding.scenario is not None
    assert finding.scenario.story[-1] == "the plan completes anyway"
    assert "GP315" not in {each.rule for each in checked(HONEST).findings}


def test_nothing_mends_a_plan_so() -> None:
    for selected in (["GP302"], ["GP3"], ["ALL"]):
        options = CheckOptions(selection=Selection.of(selected))
        assert fix_text(HONEST, options, unsafe=True).text == HONEST


def test_it_is_graded_lower_and_worth_less() -> None:
    honest, hiding = (gpsfsm.grade(text, TASK).grades[0] for text in (HONEST, HIDING))
    assert (honest.grade, hiding.grade) == ("success", "partial")
    assert hiding.reason.startswith("GP607 the plan completes even if step 1 ('lab') and its")
    assert gpsfsm.rewards([HONEST, HIDING], TASK) == [1.0, 0.2]
    honest_value, hiding_value = gpsfsm.rewards([HONEST, HIDING], TASK, shaping=True)
    assert honest_value > hiding_value


@pytest.mark.parametrize(("text", "accepted"), [(HONEST, True), (HIDING, False)])
def test_the_gate_refuses_it_with_its_task(text: str, accepted: bool, tmp_path: Path) -> None:
    task = tmp_path / "task.yaml"
    task.write_text(TASK, encoding="utf-8")
    assert gpsfsm.gate(text, task=task).accepted is accepted
    assert gpsfsm.gate(text).accepted


def test_a_model_is_told_so() -> None:
    report = gpsfsm.check(HIDING)
    text = render(report, "llm")
    assert "GP315" in text
    assert "replace it with another way to reach the goal" in text
