"""A publisher of any topic, with any quality of service.

    python -m tests.ros.servers.publisher

``advertise`` makes a publisher, ``publish`` sends a message once, ``repeat`` sends it from now on
so many times a second, ``withdraw`` ends a publisher.
"""

from __future__ import annotations

import time
from typing import Any

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from tests.ros.servers.base import FakeServer
from tests.ros.servers.messages import filled, type_named


class Publisher(FakeServer):
    """The publishers by name, each with what it repeats."""

    def __init__(self) -> None:
        super().__init__("fake_publisher")
        self._made: dict[str, tuple[Any, Any]] = {}
        self._timers: dict[str, Any] = {}

    def do_advertise(
        self, name: str, of_type: str, reliability: str = "reliable", durability: str = "volatile"
    ) -> None:
        profile = QoSProfile(
            depth=10,
            reliability=ReliabilityPolicy[reliability.upper()],
            durability=DurabilityPolicy[durability.upper()],
        )
        kind = type_named(of_type)
        self._made[name] = self.node.create_publisher(kind, name, profile), kind

    def do_publish(self, name: str, age: float | None = None, **fields: Any) -> None:
        """Send a message; with an age it has a stamp so many seconds ago."""
        publisher, kind = self._made[name]
        message = filled(kind(), fields)
        if age is not None:
            stamp = time.time() - age
            message.header.stamp.sec = int(stamp)
            message.header.stamp.nanosec = int(stamp % 1 * 1e9)
        publisher.publish(message)

    def do_meet(self, name: str, count: int = 1) -> None:
        """Wait until there are so many subscriptions."""
        publisher, _ = self._made[name]
        while publisher.get_subscription_count() < count:
            time.sleep(0.01)

    def do_repeat(self, name: str, hertz: float, **fields: Any) -> None:
        self.do_cease(name)
        self._timers[name] = self.node.create_timer(
            1 / hertz, lambda: self.do_publish(name, **fields), callback_group=self.group
        )

    def do_cease(self, name: str) -> None:
        if name in self._timers:
            self.node.destroy_timer(self._timers.pop(name))

    def do_withdraw(self, name: str) -> None:
        self.do_cease(name)
        self.node.destroy_publisher(self._made.pop(name)[0])


if __name__ == "__main__":
    Publisher().run()
