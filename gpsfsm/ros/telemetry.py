"""The telemetry of a run on ROS 2: the topic ``gpsfsm/state``, the diagnostics, and ``/rosout``.

``gpsfsm/state`` (std_msgs/msg/String, the last message is kept for those who come late) holds JSON:

    {"plan": "plan.xml", "status": "RUNNING", "time_s": 3.2, "message": "",
     "active": [{"element": "/Plan/Runner[1]", "interface": "nav2_capabilities/WaypointRunner",
                 "line": 2, "since_s": 0.1, "feedback": {"distance_left_m": 1.5}}],
     "failed": ["/Plan/Runner[2]"]}

It is published at every change. ``/diagnostics`` (diagnostic_msgs/msg/DiagnosticArray) has a status
once a second: OK, WARN as soon as a runner has failed, ERROR if the run has ended in any other way
than complete. ``/rosout`` has the lines of the run under the name of the node. Nothing here can
disturb a run: what cannot be published is left out.
"""

from __future__ import annotations

import json
from collections import deque
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from gpsfsm.execution.records import AWAITED, DOUBTED, MARKS, Kind, Record, Status
from gpsfsm.ros.messages import definition
from gpsfsm.ros.node import RosError, node_if_made

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from gpsfsm.execution.kernel import Kernel
    from gpsfsm.execution.records import Input, RunValue
    from gpsfsm.ros.node import RosNode

_STATE = "gpsfsm/state"
_DIAGNOSTICS = "/diagnostics"
_PERIOD_S = 1.0
_MOST = 50  # of the active ones, and of the failed ones
_SECOND = 1_000_000
_WARNS = (Kind.FAILED, Kind.TIMEOUT, Kind.NOT_LOADED, Kind.CANCEL, Kind.LATE)
_OVER = frozenset({Kind.SUCCEEDED, Kind.FAILED, Kind.TIMEOUT, Kind.STOPPED})


class Telemetry:
    """A watcher of a run that publishes how it stands, as soon as there is a node.

    ``plan`` is the name of the plan; ``now_us`` the clock of the run.
    """

    def __init__(self, kernel: Kernel, plan: str, now_us: Callable[[], int]) -> None:
        self._kernel, self._plan, self._now_us = kernel, plan, now_us
        self._since: dict[int, float] = {}
        self._feedback: dict[int, Mapping[str, RunValue]] = {}
        self._failed: dict[str, None] = {}
        self._message = ""

    def __call__(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        """Publish what has changed."""
        self._take(at_us, happened, records)
        node = node_if_made()
        if node is None:
            return
        with suppress(RosError, RuntimeError):  # the node is being closed: nobody listens
            _Topics.of(node).publish(self.state(), over=self._kernel.status.ended)

    def _take(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        for record in records:
            if record.kind is Kind.STARTED:
                self._since[record.node] = at_us / _SECOND
            elif record.kind in _OVER:
                self._since.pop(record.node, None)
                self._feedback.pop(record.node, None)
                if record.kind in (Kind.FAILED, Kind.TIMEOUT):
                    self._failed[self._kernel.automaton.name(record.node)] = None
            if record.message:
                self._message = record.message
        if happened.kind is Kind.LOG and "feedback" in happened.outputs and happened.number >= 0:
            node = self._kernel.automaton.runner_node(happened.number)
            values = {name: each for name, each in happened.outputs.items() if name != "feedback"}
            self._feedback[node] = values

    def state(self) -> dict[str, Any]:
        """The state of the run, as JSON has it."""
        automaton = self._kernel.automaton
        active = []
        for node, since_s in [*self._since.items()][:_MOST]:
            element = automaton.plan.elements[automaton.nodes[node].origin]
            row: dict[str, Any] = {
                "element": automaton.name(node),
                "interface": element.interface,
                "line": element.line,
                "since_s": round(since_s, 3),
            }
            if node in self._feedback:
                row["feedback"] = dict(self._feedback[node])
            active.append(row)
        return {
            "plan": self._plan,
            "status": self._kernel.status.value,
            "time_s": round(self._now_us() / _SECOND, 3),
            "message": self._message,
            "active": active,
            "failed": [*self._failed][:_MOST],
        }


class Rosout:
    """A watcher of a run whose lines go to ``/rosout``, as soon as there is a node.

    ``sentence`` makes the line of a record, "" for one that is not worth a line; ``plan`` is the
    name of the plan. The logger of rclpy would write them to standard error as well, into the tree
    of a live view, so they are published here, under its name and by its level.
    """

    def __init__(self, sentence: Callable[[Record], str], plan: str) -> None:
        self._sentence, self._plan = sentence, plan
        self._waiting: deque[tuple[int, str]] = deque(maxlen=_MOST)

    def __call__(self, _at_us: int, happened: Input, records: Sequence[Record]) -> None:
        """Publish what has happened."""
        if happened.kind in MARKS:  # a line of a runner, say: it becomes a record
            number = happened.number + 1 if happened.number >= 0 else -1
            data = happened.outputs or None
            records = [Record(happened.kind, number, data=data, message=happened.message)]
        lines = [(_severity(each), self._sentence(each)) for each in records]
        self._waiting += [(severity, line) for severity, line in lines if line]
        node = node_if_made()
        if node is not None and self._waiting:
            with suppress(RosError, RuntimeError):  # the node is being closed
                _Topics.of(node).log(self._plan, [*self._waiting])
            self._waiting.clear()


def _severity(record: Record) -> int:
    """INFO, WARN or ERROR, as rcl_interfaces/msg/Log numbers them."""
    ending = (record.data or {}).get("status") if record.kind is Kind.ENDED else None
    if ending in (None, Status.COMPLETED) and not record.message.startswith((AWAITED, DOUBTED)):
        return 30 if record.kind in _WARNS else 20
    return 30 if ending == Status.CANCELLED else 40


class _Topics:
    """The publishers of a node. All but ``of``, ``publish`` and ``log`` happens in its thread."""

    def __init__(self, node: RosNode) -> None:
        self._node = node
        self._state: dict[str, Any] = {}
        self._publishers: tuple[Any, Any] | None = None
        self._log: Any = None
        node.call(self._open)

    @classmethod
    def of(cls, node: RosNode) -> _Topics:
        """Those of a node, whichever runs publish."""
        made = node.shared.get(_STATE)
        if not isinstance(made, cls):
            made = node.shared[_STATE] = cls(node)
        return made

    def _open(self) -> None:
        from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_rosout_default

        handle = self._node.handle
        text = definition("std_msgs/msg/String")
        kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        states = handle.create_publisher(text, self._node.name(_STATE), kept)
        diagnostics = None
        with suppress(RosError):  # the state is published all the same
            array = definition("diagnostic_msgs/msg/DiagnosticArray")
            diagnostics = handle.create_publisher(array, _DIAGNOSTICS, QoSProfile(depth=10))
            handle.create_timer(_PERIOD_S, self._diagnose)
        if "--disable-rosout-logs" not in self._node.settings.arguments:
            kind, quality = definition("rcl_interfaces/msg/Log"), qos_profile_rosout_default
            self._log = handle.create_publisher(kind, "/rosout", quality)
        self._publishers = states, diagnostics

    def publish(self, state: dict[str, Any], *, over: bool) -> None:
        """Publish a state; at the end of a run its diagnosis at once as well."""

        def publish() -> None:
            self._state = state
            if self._publishers is not None:
                text = definition("std_msgs/msg/String")
                self._publishers[0].publish(text(data=json.dumps(state)))
                if over:
                    self._diagnose()

        self._node.call(publish)

    def log(self, file: str, lines: Sequence[tuple[int, str]]) -> None:
        """Publish lines of ``/rosout`` with their severities; ``file`` is the plan."""

        def publish() -> None:
            if self._log is None:
                return
            handle, kind = self._node.handle, definition("rcl_interfaces/msg/Log")
            logger = handle.get_logger()
            for severity, line in lines:
                if severity >= logger.get_effective_level():
                    message = kind(level=severity, name=logger.name, msg=line, file=file)
                    message.stamp = handle.get_clock().now().to_msg()
                    self._log.publish(message)

        self._node.call(publish)

    def _diagnose(self) -> None:
        state = self._state
        if not state or self._publishers is None or self._publishers[1] is None:
            return
        status = definition("diagnostic_msgs/msg/DiagnosticStatus")
        pair = definition("diagnostic_msgs/msg/KeyValue")
        array = definition("diagnostic_msgs/msg/DiagnosticArray")
        active = ", ".join(f"line {each['line']}" for each in state["active"])
        values = {"plan": state["plan"], "active": active, "failed": ", ".join(state["failed"])}
        message = array(
            status=[
                status(
                    level=_level(state),
                    name="gpsfsm: plan",
                    message=f"{state['status']} {state['message']}".strip(),
                    hardware_id="gpsfsm",
                    values=[pair(key=key, value=str(value)) for key, value in values.items()],
                )
            ]
        )
        message.header.stamp = self._node.handle.get_clock().now().to_msg()
        self._publishers[1].publish(message)


def _level(state: Mapping[str, Any]) -> bytes:
    """OK, WARN or ERROR of diagnostic_msgs."""
    status = Status(state["status"])
    if status.ended and status is not Status.COMPLETED:
        return b"\x02"
    return b"\x01" if state["failed"] else b"\x00"
