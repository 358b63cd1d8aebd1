"""Our plans for the tasks of the paper, each in its world."""

from __future__ import annotations

from dataclasses import replace

import pytest

import gpsfsm
from gpsfsm.execution.records import Status
from gpsfsm.simulation.load import load_world
from tests.conftest import REPO
from tests.simulation.support import run

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
    assert report.verdict.value == "accept"
    assert not report.findings


def test_no_mission_is_forgotten():
    names = {path.stem for path in MISSIONS.glob("*.xml")}
    assert names == {
        *NAVIGATION,
        "ask_and_replan",
        "describe_view",
        "bring_back_name",
        "bring_back_name_or_go_on",
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


def world(name):
    return load_world(WORLDS / f"{name}.yaml")


def mission(name, **changes):
    found = replace(world("home"), **changes)
    return run((MISSIONS / f"{name}.xml").read_text("utf-8"), found)
