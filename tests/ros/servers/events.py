"""The topic on which the Capabilities2 server tells what becomes of runners, and no more of it.

    python -m tests.ros.servers.events [--topic /capabilities/events]

Commands: ``event`` publishes one; ``raw`` publishes what no client could send by mistake.
"""

from __future__ import annotations

import argparse
from typing import Any

from capabilities2_msgs.msg import CapabilityEventCode, CapabilityEventStamped, CapabilityParameter
from rclpy.serialization import serialize_message

from tests.ros.servers.base import FakeServer, arguments


class Events(FakeServer):
    """A publisher."""

    def __init__(self, options: argparse.Namespace) -> None:
        super().__init__("fake_capabilities")
        self.publisher = self.node.create_publisher(CapabilityEventStamped, options.topic, 1_000)

    def do_listeners(self) -> None:
        """Wait until somebody listens."""
        while not self.publisher.get_subscription_count() and not self.stopping.wait(0.02):
            pass

    def do_event(
        self,
        code: str,
        source: tuple[str, int],
        target: tuple[str, int] | None = None,
        plan_id: str = "",
    ) -> None:
        """Source and target are an interface and the number that the server gave the instance."""
        message = CapabilityEventStamped()
        event = message.event
        event.code.code = getattr(CapabilityEventCode, code)
        event.trigger_id = str(source[1])
        self._fill(event.connection.source, source)
        if target is not None:
            self._fill(event.connection.target, target)
        if plan_id:
            parameter = CapabilityParameter(key="plan_id", value=[plan_id])
            event.connection.target.parameters = [parameter]
        self.publisher.publish(message)

    def do_raw(self) -> None:
        """Bytes that are no message, and a message with a text that is no UTF-8."""
        self.publisher.publish(bytes.fromhex("0001000000"))
        message = CapabilityEventStamped()
        message.event.code.code = CapabilityEventCode.SUCCEEDED
        message.event.connection.source.capability = "ABCDEFGH"
        written = serialize_message(message)
        self.publisher.publish(written.replace(b"ABCDEFGH", b"\xff\xfe\xed\xa0\x80\xc0GH"))

    def _fill(self, capability: Any, named: tuple[str, int]) -> None:
        capability.capability = capability.provider = named[0]
        capability.instance_id = str(named[1])


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--topic", default="/capabilities/events")
    Events(parser.parse_args(arguments())).run()
