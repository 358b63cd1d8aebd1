"""Our plans for the tasks of the paper, each in its world."""

from __future__ import annotations

from dataclasses import replace

import pytest

import gpsfsm
from gpsfsm.execution.records import Status
from gpsfsm.simulation.load import load_world
from tests.conftest import REPO
from tests.simulation.support import LIBRARY, control, plan, run, runner

MISSIONS = REPO / "corpus" / "missions"
WORLDS = REPO / "corpus" / "worlds"
FIRST, NORTH, WEST, SOUTH = (2.0, -0.5), (0.0, 2.0), (-2.0, 0.0), (0.0, -2.0)
POINT_A, POINT_B, ORIGIN = (5.0, 2.0), (-3.0, -2.0), (0.0, 0.0)
NAVIGATION = {
    "navigation_1": ([FIRST], []),
    "navigation_2": ([FIRST, NORTH, WEST, SOUTH], []),
    "navigation_3": ([FIRST, NORTH, WEST, SOUTH], [1]),
    "navigation_4": ([FIRST, NORTH, WEST, SOUTH], [1, 3]),
    "navigation_5": ([FIRST, NORTH, WEST, SOUTH], [2, 4]),
}


@pytest.mark.parametrize("path", sorted(MISSIONS.glob("*.xml")), ids=lambda path: path.stem)
def test_every_mission_is_accepted_without_findings(path):
    (report,) = gpsfsm.check(path.read_text(encoding="utf-8")).plans
    assert report.verdict.value == "accepted"
    assert not report.findings


def test_no_mission_is_forgotten():
    names = {path.stem for path in MISSIONS.glob("*.xml")}
    assert names == {
        *NAVIGATION,
        "ask_and_replan",
        "describe_view",
        "bring_back_name",
        "bring_back_name_or_go_on",
        "closed_door",
        "look_for_person",
    }


@pytest.mark.parametrize("name", NAVIGATION)
@pytest.mark.parametrize("seed", [0, 7])
def test_the_robot_has_been_where_it_could(name, seed):
    places, failed = NAVIGATION[name]
    ran = run((MISSIONS / f"{name}.xml").read_text("utf-8"), world("arena"), seed=seed)
    assert ran.status is Status.COMPLETED
    assert ran.places == places
    assert [number for number, said in sorted(ran.messages.items()) if said] == failed
    pose = ran.world.pose(ran.seconds)
    assert (pose.x, pose.y) == places[-1]


def test_what_is_seen_is_said():
    ran = mission("describe_view")
    assert ran.status is Status.COMPLETED
    assert ran.places == [(1.0, 0.0)]
    assert ran.said == ["I see a woman in a red jacket and a plant."]


def test_the_name_survives_the_drive():
    ran = mission("bring_back_name")
    assert ran.status is Status.COMPLETED
    assert ran.places == [POINT_A, ORIGIN]
    assert ran.said[-1] == "Your name is Ada."


def test_who_is_there_is_asked_and_their_name_brought_back():
    ran = mission("bring_back_name_or_go_on")
    assert ran.status is Status.COMPLETED
    assert ran.places == [POINT_A, ORIGIN]
    assert ran.said[-1] == "Your name is Ada."


def test_where_nobody_is_the_robot_goes_on():
    ran = mission("bring_back_name_or_go_on", people=())
    assert ran.status is Status.COMPLETED
    assert ran.places == [POINT_A, POINT_B]
    assert ran.messages[2] == "nothing was heard"


def test_whoever_is_seen_decides_where_the_robot_goes():
    there = mission("look_for_person")
    assert there.status is Status.COMPLETED
    assert there.places == [POINT_A, ORIGIN]
    assert there.outputs[1] == {"answer": "yes", "said": "Yes, I see a woman in a red jacket."}
    empty = mission("look_for_person", people=())
    assert empty.status is Status.COMPLETED
    assert empty.places == [POINT_A, POINT_B]
    assert empty.messages[1] == "the answer is no: No, I see nobody."


def test_a_question_that_cannot_fail_does_not_decide():
    """The plan that seems right: it completes, and nobody goes to B (robot runs 7 and 7a)."""
    text = (MISSIONS / "look_for_person.xml").read_text("utf-8")
    text = text.replace("CheckRunner", "ImageAnalysisRunner")
    ran = run(text, replace(world("home"), people=()))
    assert ran.status is Status.COMPLETED
    assert ran.places == [POINT_A, ORIGIN]
    assert ran.outputs[1] == {"text": "No, I see nobody."}


def test_a_check_finds_the_question_in_front_of_a_recovery():
    steps = runner("ImageAnalysis", prompt="Is there a person?"), runner("Waypoint", x=-3, y=-2)
    text = plan(steps[0], control("recovery", steps[1]))
    ran = run(text, replace(world("home"), people=()))
    assert (ran.status, ran.places) == (Status.COMPLETED, [])  # the recovery is left out
    (report,) = gpsfsm.check(text).plans
    (finding,) = [each for each in report.findings if each.rule == "GP312"]
    assert "succeeds whatever the answer is" in finding.message
    assert "CheckRunner" in finding.hint
    checked = text.replace("ImageAnalysisRunner", "CheckRunner")
    assert run(checked, replace(world("home"), people=())).places == [POINT_B]
    assert not [each for each in gpsfsm.check(checked).plans[0].findings if each.rule == "GP312"]


OFFICE, ANNEX, PORCH, WINDOW = (6.5, 4.5), (6.5, 1.5), (1.0, 1.0), (4.0, 3.0)


def test_the_office_is_locked_and_another_place_is_not():
    first = run((MISSIONS / "closed_door.xml").read_text("utf-8"), world("closing"))
    assert first.status is Status.GAVE_UP
    assert first.places == [(2.0, 5.0)]
    assert first.messages[1] == "no way leads to (6.5, 4.5): the zone 'office door' is closed"
    annex = then(first, ANNEX)
    assert annex.status is Status.COMPLETED
    assert annex.places[1:] == [ANNEX]


def test_it_takes_two_more_plans_if_the_second_goes_to_the_porch_first():
    first = run((MISSIONS / "closed_door.xml").read_text("utf-8"), world("closing"))
    second = then(first, PORCH, ANNEX)
    assert second.status is Status.GAVE_UP
    assert second.messages[1] == "no way leads to (6.5, 1.5): the zone 'annex door' is closed"
    third = then(second, WINDOW)
    assert third.status is Status.COMPLETED
    assert third.places == [(2.0, 5.0), PORCH, WINDOW]


def test_without_changes_the_office_is_reached():
    changed = replace(world("closing"), changes=())
    ran = run((MISSIONS / "closed_door.xml").read_text("utf-8"), changed)
    assert ran.status is Status.COMPLETED
    assert ran.places == [(2.0, 5.0), OFFICE]


def then(ran, *places):
    """Another plan, in the world as a run has left it."""
    state = ran.world
    state.next_plan(state.begun_s + ran.seconds)
    text = plan(*(runner("Waypoint", x=x, y=y) for x, y in places))
    return run(text, state.world, state=state)


def world(name):
    return load_world(WORLDS / f"{name}.yaml", library=LIBRARY)


def mission(name, **changes):
    changed = replace(world("home"), **changes)
    return run((MISSIONS / f"{name}.xml").read_text("utf-8"), changed)
