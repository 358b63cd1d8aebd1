"""Poses of frames: the latest transforms of ``tf`` and ``tf_static``, put together.

tf2_ros cannot be installed beside a plain Python, and what is needed of it is small: no
interpolation in time, only where something is now. A frame has one parent, so the pose of ``base``
in ``map`` is the product along the way from ``base`` up to ``map``:

    map ─(1, 0)─▶ odom ─(2, 0)─▶ base     base in map: (3, 0)

A frame that both have above them serves as well: the pose of one in the other is the way up of the
one and the way down of the other.
"""

from __future__ import annotations

import math
import threading
from typing import TYPE_CHECKING, Any

from gpsfsm.ros.messages import definition

if TYPE_CHECKING:
    from collections.abc import Iterable

    from gpsfsm.ros.node import RosNode

Transform = tuple[float, float, float, float, float, float, float]
"""x, y, z and the quaternion qx, qy, qz, qw."""

TF = "tf2_msgs/msg/TFMessage"
UNIT: Transform = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
_FIELDS = ("x", "y", "z", "qx", "qy", "qz", "qw")
_MOST_FRAMES = 10_000
_DEEPEST = 100
_DIGITS = 6


def times(first: Transform, second: Transform) -> Transform:
    """The product: ``second`` is in the frame that ``first`` leads to.

    >>> times((1, 0, 0, 0, 0, 0, 1), (2, 0, 0, 0, 0, 0, 1))[:3]
    (3, 0, 0)
    """
    ax, ay, az, aw = first[3:]
    bx, by, bz, bw = second[3:]
    x, y, z = _turned(first[3:], second[:3])
    return (
        first[0] + x,
        first[1] + y,
        first[2] + z,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def inverse(transform: Transform) -> Transform:
    """The transform the other way round."""
    qx, qy, qz, qw = transform[3:]
    back = (-qx, -qy, -qz, qw)
    x, y, z = _turned(back, transform[:3])
    return (-x, -y, -z, *back)


def _turned(
    turn: tuple[float, ...], point: tuple[float, float, float]
) -> tuple[float, float, float]:
    qx, qy, qz, qw = turn
    x, y, z = point
    tx, ty, tz = 2 * (qy * z - qz * y), 2 * (qz * x - qx * z), 2 * (qx * y - qy * x)
    return (
        x + qw * tx + qy * tz - qz * ty,
        y + qw * ty + qz * tx - qx * tz,
        z + qw * tz + qx * ty - qy * tx,
    )


class Tree:
    """The latest transform of each frame from its parent. May be used from any thread."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Transform]] = {}
        self._lock = threading.Lock()

    def put(self, parent: str, child: str, transform: Transform) -> None:
        """Note a transform; one that is no transform is left out."""
        length = math.sqrt(sum(each * each for each in transform[3:]))
        if not (math.isfinite(sum(transform)) and length > 1e-6):
            return
        x, y, z = transform[:3]
        qx, qy, qz, qw = (each / length for each in transform[3:])
        with self._lock:
            if child in self._parents or len(self._parents) < _MOST_FRAMES:
                self._parents[child.strip("/")] = (parent.strip("/"), (x, y, z, qx, qy, qz, qw))

    def pose(self, outer: str, inner: str) -> Transform | None:
        """The pose of a frame in another one; None if nothing leads from one to the other."""
        with self._lock:
            above = dict(self._up(outer.strip("/")))
            for frame, transform in self._up(inner.strip("/")):
                if frame in above:
                    return times(inverse(above[frame]), transform)
        return None

    def frames(self) -> list[str]:
        """The names of all frames."""
        with self._lock:
            return sorted({*self._parents, *(parent for parent, _ in self._parents.values())})

    def _up(self, frame: str) -> Iterable[tuple[str, Transform]]:
        """A frame and all above it, each with the pose of the first one in it."""
        transform = UNIT
        yield frame, transform
        for _ in range(_DEEPEST):
            if frame not in self._parents:
                return
            frame, step = self._parents[frame]
            transform = times(step, transform)
            yield frame, transform


class Transforms:
    """The transforms that a robot publishes, from the time on when somebody wants them."""

    def __init__(self, node: RosNode) -> None:
        self._tree = Tree()
        node.do(lambda: self._subscribe(node))

    @classmethod
    def of(cls, node: RosNode) -> Transforms:
        """Those of a node, which subscribes once."""
        made = node.shared.get(cls.__name__)
        if not isinstance(made, cls):
            made = node.shared[cls.__name__] = cls(node)
        return made

    def _subscribe(self, node: RosNode) -> None:
        from rclpy.qos import DurabilityPolicy, QoSProfile

        kind = definition(TF)
        latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        node.handle.create_subscription(kind, node.name("tf"), self._take, QoSProfile(depth=100))
        node.handle.create_subscription(kind, node.name("tf_static"), self._take, latched)

    def _take(self, message: Any) -> None:
        for each in message.transforms:
            place, turn = each.transform.translation, each.transform.rotation
            transform = (place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w)
            self._tree.put(each.header.frame_id, each.child_frame_id, transform)

    def frames(self) -> list[str]:
        """The names of all frames that have been published."""
        return self._tree.frames()

    def pose(self, outer: str, inner: str) -> dict[str, float] | None:
        """The pose of a frame in another one, by x, y, z, qx, qy, qz, qw; None if unknown yet."""
        transform = self._tree.pose(outer, inner)
        if transform is None:
            return None
        return {
            name: round(value, _DIGITS) + 0.0
            for name, value in zip(_FIELDS, transform, strict=True)
        }
