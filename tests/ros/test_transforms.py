"""Transforms against matrices, and the tree that puts them together."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.ros.runner import flat
from gpsfsm.ros.transforms import UNIT, Transform, Tree, inverse, times

Matrix = list[list[float]]

metres = st.floats(-100, 100)


@st.composite
def transforms(draw: st.DrawFn) -> Transform:
    quaternion = [draw(st.floats(-1, 1)) for _ in range(4)]
    length = math.sqrt(sum(each * each for each in quaternion))
    if length < 0.1:
        quaternion, length = [0.0, 0.0, 0.0, 1.0], 1.0
    x, y, z, w = (each / length for each in quaternion)
    return draw(metres), draw(metres), draw(metres), x, y, z, w


def matrix(transform: Transform) -> Matrix:
    """The same as a matrix of four rows, by the textbook and not by the code."""
    px, py, pz, x, y, z, w = transform
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), px],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), py],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), pz],
        [0.0, 0.0, 0.0, 1.0],
    ]


def product(first: Matrix, second: Matrix) -> Matrix:
    return [[sum(first[i][k] * second[k][j] for k in range(4)) for j in range(4)] for i in range(4)]


def close(first: Matrix, second: Matrix) -> bool:
    return all(
        math.isclose(first[i][j], second[i][j], abs_tol=1e-6) for i in range(4) for j in range(4)
    )


@given(transforms(), transforms())
def test_a_product_is_that_of_the_matrices(first: Transform, second: Transform) -> None:
    assert close(matrix(times(first, second)), product(matrix(first), matrix(second)))


@given(transforms())
def test_an_inverse_undoes_it(transform: Transform) -> None:
    assert close(matrix(times(transform, inverse(transform))), matrix(UNIT))


@given(st.lists(transforms(), min_size=4, max_size=4))
def test_frames_of_two_branches(steps: list[Transform]) -> None:
    tree = Tree()
    names = [("map", "odom"), ("odom", "base"), ("map", "dock"), ("dock", "plug")]
    for (parent, child), step in zip(names, steps, strict=True):
        tree.put(parent, child, step)
    odom, base, dock, plug = map(matrix, steps)
    pose = tree.pose("map", "base")
    assert pose is not None
    assert close(matrix(pose), product(odom, base))
    across = tree.pose("plug", "base")
    assert across is not None
    assert close(product(product(dock, plug), matrix(across)), product(odom, base))


def test_what_nothing_leads_to_has_no_pose() -> None:
    tree = Tree()
    tree.put("map", "odom", UNIT)
    tree.put("elsewhere", "base", UNIT)
    assert tree.pose("map", "base") is None
    assert tree.pose("map", "map") == UNIT


def test_a_circle_and_rubbish_do_no_harm() -> None:
    tree = Tree()
    tree.put("a", "b", UNIT)
    tree.put("b", "a", UNIT)
    assert tree.pose("c", "a") is None
    tree.put("map", "nan", (math.nan, 0, 0, 0, 0, 0, 1))
    tree.put("map", "zero", (1, 2, 3, 0, 0, 0, 0))
    assert tree.pose("map", "nan") is None
    assert tree.pose("map", "zero") is None


@pytest.mark.parametrize("yaw", [0.0, 1.0, -3.0])
def test_a_pose_on_the_floor(yaw: float) -> None:
    assert flat((1.0, 2.0, 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))) == (1.0, 2.0, yaw)
