"""A bond: both ends tell each other that they live, until one of them ends it or falls silent.

The messages are those of the package ``bond``. What an end holds in the name of a bond is let go of
when the bond breaks, so what a process leaves behind that dies ends with its bond.
"""

from __future__ import annotations

import asyncio
import time
import uuid
from typing import TYPE_CHECKING, Any

from gpsfsm.ros.messages import definition

if TYPE_CHECKING:
    from collections.abc import Iterable

    from gpsfsm.ros.node import RosNode

PERIOD_S = 0.1
TIMEOUT_S = 10.0
_GOODBYE_S = 2.0


class Bond:
    """One end of a bond. ``begin`` and ``end`` are not for the thread of the node."""

    def __init__(self, node: RosNode, topics: Iterable[str]) -> None:
        self.name = ""
        self.over = False
        self._node = node
        self._topics = tuple(dict.fromkeys(topics))
        self._own = str(uuid.uuid4())
        self._kind: Any = None
        self._publishers: list[Any] = []
        self._subscriptions: list[Any] = []
        self._timer: Any = None
        self._heard = 0.0
        self._timeout = TIMEOUT_S
        self._ended_by_other = False

    def begin(self, name: str) -> None:
        """Form the bond of this name. Raises RosError if the definitions are missing."""
        self.name = name
        self._kind = definition("bond/msg/Status")
        self._node.do(self._join)

    def _join(self) -> None:
        from rclpy.qos import QoSProfile

        handle, profile = self._node.handle, QoSProfile(depth=100)
        for topic in self._topics:
            self._publishers.append(handle.create_publisher(self._kind, topic, profile))
            self._subscriptions.append(
                handle.create_subscription(self._kind, topic, self._take, profile)
            )
        self._timer = handle.create_timer(PERIOD_S, self._tell)

    def _tell(self) -> None:
        message = self._kind()
        message.header.stamp = self._node.handle.get_clock().now().to_msg()
        message.id, message.instance_id = self.name, self._own
        message.active = not self.over
        message.heartbeat_timeout, message.heartbeat_period = TIMEOUT_S, PERIOD_S
        for publisher in self._publishers:
            publisher.publish(message)

    def _take(self, message: Any) -> None:
        if message.id != self.name or message.instance_id == self._own:
            return
        self._heard = time.monotonic()
        self._ended_by_other = not message.active
        if 0 < message.heartbeat_timeout < 1e6:
            self._timeout = message.heartbeat_timeout

    @property
    def problem(self) -> str:
        """The reason why the bond holds no more; "" if it does, as far as this end can tell."""
        if self._ended_by_other:
            return "the capability server has ended the bond"
        if self._heard and time.monotonic() - self._heard > self._timeout:
            return f"the bond is broken: nothing of the server for {self._timeout:g} s"
        return ""

    async def end(self) -> None:
        """Say goodbye, until the other end has heard it or cannot hear any more."""
        self.over = True
        if not self._publishers:
            return
        wait = _GOODBYE_S if self._heard and not self.problem else 0.0
        end = time.monotonic() + wait
        await asyncio.to_thread(self._node.do, self._tell)
        while not self._ended_by_other and time.monotonic() < end:
            await asyncio.sleep(PERIOD_S / 2)
        await asyncio.to_thread(self._node.do, self._leave)

    def _leave(self) -> None:
        handle = self._node.handle
        handle.destroy_timer(self._timer)
        for each in self._publishers:
            handle.destroy_publisher(each)
        for each in self._subscriptions:
            handle.destroy_subscription(each)
        self._publishers, self._subscriptions = [], []
