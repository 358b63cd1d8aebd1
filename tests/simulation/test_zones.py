"""Zones that are closed and opened while a plan runs."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.execution.records import Kind, Status
from gpsfsm.simulation.base import Pose, WorldState, Zones
from gpsfsm.simulation.world import Change, Map, Rectangle, Robot, World, Zone
from tests.simulation.support import control, plan, run, runner

AREA = Rectangle(-5.0, -5.0, 5.0, 5.0)
GATE = Zone("gate", Rectangle(1.0, -5.0, 1.4, 5.0))
PEN = Zone("pen", Rectangle(2.0, -1.0, 4.0, 1.0))
THERE, BACK = runner("Waypoint", x="3.0", y="0.0"), runner("Waypoint", x="-1.0", y="0.0")


def world_of(*zones, changes=(), patience_s=2.0):
    robot = Robot(speed=1.0, turn_speed=1e9, patience_s=patience_s)
    return World(map=Map(AREA, 0.1, (), zones), robot=robot, changes=changes)


def notes(ran):
    return [row.message for _, row, _ in ran.rows if row.kind is Kind.LOG]


def test_an_open_zone_is_no_hindrance():
    ran = run(plan(THERE), world_of(GATE, PEN))
    assert ran.places == [(3.0, 0.0)]
    assert notes(ran) == []


@pytest.mark.parametrize("zone", [GATE, PEN])
def test_a_closed_zone_is_told(zone):
    closed = Zone(zone.name, zone.area, closed=True)
    ran = run(plan(THERE), world_of(closed, Zone("far", Rectangle(-5, 4, -4, 5), closed=True)))
    assert ran.status is Status.GAVE_UP
    assert ran.messages[0] == f"no way leads to (3, 0): the zone '{zone.name}' is closed"


def test_only_what_is_in_the_way_is_blamed():
    both = (Zone("gate", GATE.area, closed=True), Zone("pen", PEN.area, closed=True))
    assert (
        run(plan(THERE), world_of(*both)).messages[0].endswith("the zones 'gate', 'pen' are closed")
    )
    outside = run(plan(runner("Waypoint", x="9.0", y="0.0")), world_of(*both))
    assert outside.messages[0] == "no way leads to (9, 0)"


def test_a_zone_closes_at_a_time_on_the_way():
    ran = run(plan(THERE), world_of(GATE, changes=(Change("gate", closed=True, at_s=0.5),)))
    assert ran.status is Status.GAVE_UP
    assert notes(ran) == ["the zone 'gate' is closed now"]
    assert ran.seconds == pytest.approx(2.5, abs=0.01)
    assert ran.world.pose(ran.seconds).x < 0.8


def test_a_zone_that_opens_in_time_is_waited_for():
    changes = (Change("gate", closed=True, at_s=0.0), Change("gate", closed=False, at_s=1.5))
    ran = run(plan(THERE), world_of(GATE, changes=changes))
    assert ran.status is Status.COMPLETED
    assert notes(ran) == ["the zone 'gate' is closed now", "the zone 'gate' is open now"]
    assert 4.5 <= ran.seconds < 6.0


def test_a_zone_closes_after_the_second_arrival():
    changes = (Change("gate", closed=True, after_arrivals=2),)
    ran = run(plan(THERE, BACK, THERE), world_of(GATE, changes=changes))
    assert ran.status is Status.GAVE_UP
    assert ran.places == [(3.0, 0.0), (-1.0, 0.0)]
    assert ran.messages[2] == "no way leads to (3, 0): the zone 'gate' is closed"
    assert notes(ran) == ["the zone 'gate' is closed now"]


def test_a_drive_that_fails_is_no_arrival():
    changes = (Change("gate", closed=True, after_arrivals=1),)
    lost = runner("Waypoint", x="9.0", y="0.0")
    tried = f"{lost}{control('recovery', THERE)}"
    ran = run(plan(tried, BACK), world_of(GATE, changes=changes))
    assert ran.places == [(3.0, 0.0)]
    assert ran.messages[2].endswith("the zone 'gate' is closed")


def test_a_robot_in_a_closed_zone_can_leave_it_but_not_stay_in_it():
    changes = (Change("pen", closed=True, after_arrivals=1),)
    world = world_of(PEN, changes=changes)
    out = run(plan(THERE, BACK), world)
    assert out.places == [(3.0, 0.0), (-1.0, 0.0)]
    inside = run(plan(THERE, runner("Waypoint", x="3.5", y="0.0")), world)
    assert inside.messages[1] == "no way leads to (3.5, 0): the zone 'pen' is closed"


def test_the_zone_that_the_robot_may_leave_is_not_blamed():
    changes = tuple(Change(name, closed=True, after_arrivals=1) for name in ("pen", "gate"))
    ran = run(plan(THERE, BACK), world_of(GATE, PEN, changes=changes))
    assert ran.messages[1] == "no way leads to (-1, 0): the zone 'gate' is closed"


def test_arrivals_count_over_all_plans_of_a_world():
    state = WorldState(world_of(GATE, changes=(Change("gate", closed=True, after_arrivals=2),)))
    state.arrive(3.0, 3.0, 0.0)
    state.put(Pose(-1.0, 0.0, 0.0))
    state.next_plan(5.0)
    assert state.route(5.0, 3.0, 0.0) is not None
    state.arrive(6.0, -1.0, 0.0)
    assert state.route(6.0, 3.0, 0.0) is None


def test_the_map_shows_closed_zones():
    closed = Zone("gate", GATE.area, closed=True)
    ran = run(plan(runner("OccupancyGrid")), world_of(closed))
    rows = ran.outputs[0]["OccupancyGrid"].splitlines()[1:]
    assert {row[60:64] for row in rows} == {"####"}
    assert {row[:60] for row in rows} == {"." * 60}


times = st.integers(0, 6).map(float)
some_changes = st.lists(
    st.builds(
        lambda zone, closed, at_s: Change(zone, closed=closed, at_s=at_s),
        st.sampled_from("ab"),
        st.booleans(),
        times,
    ),
    max_size=8,
)


@given(some_changes, st.booleans(), times)
def test_the_latest_change_counts_and_the_later_line_of_two(changes, closed, now_s):
    zones = (Zone("a", PEN.area, closed=closed), Zone("b", PEN.area))
    actual = Zones(World(map=Map(AREA, zones=zones), changes=tuple(changes)))
    expected = []
    for number, zone in enumerate(zones):
        past = [one for one in changes if one.zone == zone.name and one.at_s <= now_s]
        latest = max((one.at_s for one in past), default=0.0)
        last = [one.closed for one in past if one.at_s == latest]
        if last[-1] if last else zone.closed:
            expected.append(number)
    assert actual.closed(now_s) == tuple(expected)
    later = [one.at_s for one in changes if one.at_s > now_s]
    assert actual.next_change(now_s) == min(later, default=float("inf"))
    assert len(actual.news(now_s)) == sum(one.at_s <= now_s for one in changes)
    assert actual.news(now_s) == []
