"""The steps of a plan that act on ROS 2, as they are looked at before it begins."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.capabilities.library import builtin_capabilities
from gpsfsm.execution.journal import Heading
from gpsfsm.running.drivers import maker_of
from gpsfsm.running.looking import ros_steps
from gpsfsm.running.prepare import REAL, prepare

if TYPE_CHECKING:
    from gpsfsm.ros.look import Step

WAYPOINT = '<Runner interface="{0}/WaypointRunner" provider="{0}/WaypointRunner" x="1" y="2"/>'
POSE = '<Runner interface="{0}/RobotPoseRunner" provider="{0}/RobotPoseRunner"/>'
LOG = (
    '<Runner interface="generic_capabilities/LogRunner" '
    'provider="generic_capabilities/LogRunner" text="a"/>'
)


def steps(*lines: str) -> list[Step]:
    text = "\n".join(("<Plan>", *lines, "</Plan>")).format("nav2_capabilities")
    heading = Heading(plan=text.encode(), file="plan.xml", mode=REAL)
    prepared = prepare(heading, builtin_capabilities().library)
    return ros_steps(prepared, maker_of(prepared)[0])


def test_values_are_open_if_the_step_before_hands_them_over() -> None:
    first, pose, second, third = steps(WAYPOINT, LOG, POSE, WAYPOINT, WAYPOINT)
    assert [each.place for each in (first, pose, second, third)] == [
        "plan.xml:2",
        "plan.xml:4",
        "plan.xml:5",
        "plan.xml:6",
    ]
    assert (first.parameters["x"], first.parameters["qw"]) == (1, 1.0)
    assert first.open_names == third.open_names == frozenset()
    assert second.open_names == {"x", "y", "z", "qx", "qy", "qz", "qw"}


def test_a_recovery_may_get_values_from_what_has_failed_only_if_it_hands_them_over() -> None:
    recovery = f'<Control type="recovery">{WAYPOINT}</Control>'
    assert [each.open_names for each in steps(LOG, recovery)] == [frozenset()]
    assert steps(LOG) == []
