"""V1 of the fake capability server: connections of a runner by their order, parameters as XML.

What a runner is connected to counts for its n-th execution if it was configured as the n-th, no
event names an instance, and events are logged on one topic for all nodes.
"""

from __future__ import annotations

import threading
import xml.etree.ElementTree as ET
from typing import TYPE_CHECKING, Any

from event_logger_msgs.msg import Event

from tests.ros.servers.capabilities2 import FAILED, MULTIPLEXERS, SUCCEEDED, Base, Runner

if TYPE_CHECKING:
    import argparse

_ON = {SUCCEEDED: "target_on_success", FAILED: "target_on_failure"}


class ServerV1(Base):
    """V1."""

    def __init__(self, options: argparse.Namespace) -> None:
        super().__init__(options)
        self._events = self.node.create_publisher(Event, "/events", 10)
        self._configured: dict[str, list[Any]] = {}
        self._executed: dict[str, int] = {}
        self._counting = threading.Lock()
        self.offer("configure_capability", "ConfigureCapability", self._configure)

    def _configure(self, request: Any, response: Any) -> Any:
        self._configured.setdefault(request.source.capability, []).append(request)
        return response

    def _trigger(self, request: Any, response: Any) -> Any:
        self.journal("triggered", capability=request.capability, xml=request.parameters)
        self._run(request.capability, request.parameters)
        return response

    def _run(self, capability: str, parameters: str) -> None:
        runner = self.runners.get(capability)
        if runner is None:
            self.die(f"an event for {capability}, which is freed")
            return
        element = ET.fromstring(parameters)  # noqa: S314  (of the tests)
        if runner.short in MULTIPLEXERS and not self._is_full(runner, element):
            return
        with self._counting:
            number = self._executed[capability] = self._executed.get(capability, -1) + 1

        def act() -> None:
            outcome = "succeed" if runner.short in MULTIPLEXERS else self.outcome(runner)
            if outcome in ("succeed", "fail"):
                self._emit(runner, number, SUCCEEDED if outcome == "succeed" else FAILED)
            elif outcome == "hang":
                self.hang()

        self.start(runner, str(number), act)

    def _is_full(self, runner: Runner, element: ET.Element) -> bool:
        """Count an input: a multiplexer executes nothing before it has the last one."""
        instance, count = element.get("id", ""), int(element.get("input_count", "-1"))
        if not instance or count < 0:
            self.die("a multiplexer without id and input_count")
            return False
        with self._counting:
            runner.inputs[instance] = runner.inputs.get(instance, 0) + 1
            return runner.inputs[instance] == count

    def _emit(self, runner: Runner, number: int, code: int) -> None:
        configured = self._configured.get(runner.capability, [])
        if number >= len(configured):
            return
        target = getattr(configured[number], _ON[code])
        if not target.capability:
            return
        message = Event(event=code, type=Event.RUNNER_EVENT, thread_id=number % 128, pid=-1)
        message.source.capability, message.source.provider = runner.capability, runner.provider
        message.target.capability, message.target.provider = target.capability, target.provider
        self._events.publish(message)
        self._run(target.capability, target.parameters)
