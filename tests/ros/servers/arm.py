"""An arm with an action of our own, whose goals and results are lists in lists.

    python -m tests.ros.servers.arm

``answer`` sets fields of the next result.
"""

from __future__ import annotations

from typing import Any

from rclpy.action import ActionServer

from tests.ros.servers.base import FakeServer
from tests.ros.servers.messages import as_json, filled, type_named


class Arm(FakeServer):
    """The server of one action, which succeeds at once."""

    def __init__(self) -> None:
        super().__init__("fake_arm")
        self._answers: list[dict[str, Any]] = []
        self._type = type_named("arm_msgs/action/Move")
        server = ActionServer(
            self.node, self._type, "move_arm", self._move, callback_group=self.group
        )
        self.keep(server)

    def do_answer(self, **result: Any) -> None:
        self._answers.append(result)

    def _move(self, goal: Any) -> Any:
        self.journal("goal", request=as_json(goal.request))
        goal.succeed()
        return filled(self._type.Result(), self._answers.pop(0) if self._answers else {})


if __name__ == "__main__":
    Arm().run()
