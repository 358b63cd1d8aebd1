"""Driving in a world."""

from __future__ import annotations

import math

import pytest

from gpsfsm.execution.records import Status
from gpsfsm.simulation.world import Obstacle, Rectangle, Settings, Window
from tests.simulation.support import control, field_of, plan, run, runner

WALL = Rectangle(1.0, -5.0, 1.2, 5.0)


def test_a_drive_takes_as_long_as_the_way():
    ran = run(plan(runner("Waypoint", x="3.0", y="0.0")), field_of())
    assert ran.places == [(3.0, 0.0)]
    assert 3.0 <= ran.seconds < 3.4


def test_the_robot_faces_as_the_goal_says():
    half = math.sqrt(0.5)
    turned = runner("Waypoint", x="1.0", y="0.0", qz=half, qw=half)
    ran = run(plan(turned, runner("RobotPose")), field_of())
    assert ran.outputs[1] == {
        "x": 1.0,
        "y": 0.0,
        "z": 0.0,
        "qx": 0.0,
        "qy": 0.0,
        "qz": 0.707107,
        "qw": 0.707107,
    }


def test_a_yaw_is_a_direction_and_a_world_has_one_frame():
    turned = runner("WaypointYaw", x="1.0", y="0.0", yaw=math.pi / 2)
    ran = run(plan(turned, runner("RobotPose")), field_of())
    assert ran.outputs[1] | {"qz": 0.707107, "qw": 0.707107} == ran.outputs[1]
    assert ran.outputs[1]["x"] == 1.0
    ran = run(plan(runner("WaypointYaw", x="1.0", y="0.0", frame="odom")), field_of())
    assert ran.messages[0] == "the goal is in the frame 'odom': a world has 'map' only"


def test_an_unreachable_place_fails_after_trying():
    world = field_of(Obstacle(WALL), robot={"patience_s": 7.0})
    ran = run(plan(runner("Waypoint", x="3.0", y="0.0")), world)
    assert ran.status is Status.GAVE_UP
    assert ran.messages[0] == "no way leads to (3, 0)"
    assert 7.0 <= ran.seconds < 7.3
    pose = ran.world.pose(ran.seconds)
    assert (pose.x, pose.y) == (0.0, 0.0)


@pytest.mark.parametrize(("opens_s", "status"), [(4.0, Status.COMPLETED), (30.0, Status.GAVE_UP)])
def test_a_door_that_opens_in_time_is_waited_for(opens_s, status):
    door = Obstacle(WALL, window=Window(0.0, opens_s))
    ran = run(plan(runner("Waypoint", x="3.0", y="0.0")), field_of(door))
    assert ran.status is status
    if status is Status.COMPLETED:
        assert opens_s + 3.0 <= ran.seconds < opens_s + 4.5


def test_a_door_that_shuts_on_the_way_makes_the_robot_go_round():
    shut = Obstacle(Rectangle(2.0, -5.0, 2.2, 3.0), window=Window(1.0, math.inf))
    ran = run(plan(runner("Waypoint", x="4.0", y="0.0")), field_of(shut))
    assert ran.places == [(4.0, 0.0)]
    assert ran.seconds > 6.0  # straight on it would be 4


def test_a_later_goal_replaces_an_earlier_one():
    second = control("sequential", runner("Wait", seconds="1.0"), runner("Waypoint", x=-2, y=0))
    ran = run(plan(control("parallel_any", runner("Waypoint", x="4", y="0"), second)), field_of())
    assert ran.status is Status.COMPLETED
    assert ran.messages[0] == "another goal has replaced this one"
    assert 1.0 < ran.ended_s[0] < 1.8
    assert ran.places == [(-2.0, 0.0)]


def test_a_robot_that_is_stopped_stays_on_the_way():
    both = control("parallel_any", runner("Waypoint", x="4.0", y="0.0"), runner("Wait", seconds=2))
    ran = run(plan(both), field_of())
    assert ran.status is Status.COMPLETED
    assert ran.places == []
    pose, later = ran.world.pose(ran.seconds), ran.world.pose(ran.seconds + 100)
    assert pose == later
    assert 1.7 < pose.x < 2.0


def test_a_cancelled_drive_stays_on_the_way():
    text = plan(runner("Waypoint", x="4.0", y="0.0"))
    ran = run(
        text,
        field_of(),
        prepare=lambda driver: driver.at(3_000_000, lambda: driver.cancel("enough")),
    )
    assert ran.status is Status.CANCELLED
    assert 2.7 < ran.world.pose(99.0).x < 3.0


def test_a_chance_to_fail_breaks_the_drive_off():
    world = field_of(settings={"WaypointRunner": Settings(fails=1.0, message="wheel lost")})
    ran = run(plan(runner("Waypoint", x="4.0", y="0.0")), world)
    assert ran.messages[0] == "wheel lost"
    assert 0.0 < ran.world.pose(ran.seconds).x < 4.0
    assert ran.places == []


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        ({"x": "inf", "y": "0.0"}, "no place"),
        ({"x": "here", "y": "0.0"}, "no place"),
        ({"x": "1.0", "y": "0.0", "qw": "0.0"}, "no direction"),
        ({"x": "1e9", "y": "0.0"}, "no way"),
        ({"x": "-1e308", "y": "0.0"}, "no way"),
        ({"x": "9" * 400, "y": "0.0"}, "no place"),
        ({"x": "nan", "y": "0.0"}, "no place"),
        ({"x": "1.0", "y": "0.0", "qz": "inf"}, "no direction"),
        ({"x": "5.0", "y": "0.0"}, "no way"),
        ({"x": "5.1", "y": "0.0"}, "no way"),
    ],
)
def test_goals_that_make_no_sense_fail(attributes, message):
    ran = run(plan(runner("Waypoint", **attributes)), field_of())
    assert ran.status is Status.GAVE_UP
    assert message in ran.messages[0]


def test_a_goal_in_an_obstacle_is_not_reached():
    crate = Obstacle(Rectangle(2.0, -0.5, 3.0, 0.5), low=True)
    ran = run(plan(runner("Waypoint", x="2.5", y="0.0")), field_of(crate))
    assert ran.messages[0] == "no way leads to (2.5, 0)"


def test_a_goal_where_the_robot_is_takes_no_drive():
    ran = run(plan(runner("Waypoint", x="0.0", y="0.0")), field_of())
    assert ran.places == [(0.0, 0.0)]
    assert ran.seconds < 0.3


def test_an_obstacle_on_the_robot_keeps_it_there():
    fallen = Obstacle(Rectangle(-1.0, -1.0, 1.0, 1.0), window=Window(2.0, math.inf))
    here, away = (runner("Waypoint", x=x, y="0.0") for x in ("0.0", "3.0"))
    ran = run(plan(runner("Wait", seconds=3), here, away), field_of(fallen))
    assert ran.places == [(0.0, 0.0)]
    assert ran.messages[2] == "no way leads to (3, 0)"


def test_a_robot_too_wide_for_the_gap_does_not_pass():
    walls = (Obstacle(Rectangle(1.0, -5.0, 1.2, -0.3)), Obstacle(Rectangle(1.0, 0.3, 1.2, 5.0)))
    goal = plan(runner("Waypoint", x="3.0", y="0.0"))
    assert run(goal, field_of(*walls, robot={"radius": 0.2})).status is Status.COMPLETED
    assert run(goal, field_of(*walls, robot={"radius": 0.4})).status is Status.GAVE_UP


def test_the_grid_shows_what_is_there():
    world = field_of(Obstacle(Rectangle(-5.0, -5.0, 0.0, -4.0)))
    ran = run(plan(runner("OccupancyGrid")), world)
    head, *rows = ran.outputs[0]["OccupancyGrid"].splitlines()
    assert head == "width=100 height=100 resolution=0.1 origin=(-5, -5)"
    assert rows[0] == "#" * 50 + "." * 50
    assert rows[10] == "." * 100
    assert len(rows) == 100


def test_the_same_seed_gives_the_same_run():
    text = plan(runner("Waypoint", x="3.0", y="1.0"), runner("RobotPose"))
    first, second, other = (run(text, field_of(), seed=seed) for seed in (5, 5, 6))
    assert first.rows == second.rows
    assert first.rows != other.rows
