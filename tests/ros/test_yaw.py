"""Parts of the quaternion of a yaw as values of a request, without ROS 2."""

from __future__ import annotations

import math

import pytest

from gpsfsm.ros.node import RosError
from gpsfsm.ros.runner import _filled

REQUEST = tuple((axis, f"$yaw.q{axis}") for axis in "xyzw")


@pytest.mark.parametrize("yaw", [0, 0.0, math.pi / 2, -3.0, 7.0])
def test_a_yaw_turns_by_itself(yaw: float) -> None:
    values = _filled(REQUEST, {"yaw": yaw})
    x, y, z, w = (values[axis] for axis in "xyzw")
    assert (x, y) == (0, 0)
    assert isinstance(z, float)
    assert isinstance(w, float)
    turned = math.atan2(2 * w * z, 1 - 2 * z * z)
    assert math.remainder(turned - yaw, math.tau) == pytest.approx(0)


def test_without_a_yaw_the_field_stays_as_it_is() -> None:
    assert _filled(REQUEST, {"x": 1.0}) == {}


@pytest.mark.parametrize("yaw", ["north", True, math.nan, [1.0]])
def test_what_is_no_angle_is_an_error(yaw: object) -> None:
    with pytest.raises(RosError, match="yaw is no angle in radians"):
        _filled(REQUEST, {"yaw": yaw})  # type: ignore[dict-item]
