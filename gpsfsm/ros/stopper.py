"""The process that stops a robot: ``python -P -m gpsfsm.ros.stopper SETTINGS``.

It does nothing else, so nothing can keep it from doing so: it holds a node with a client for every
action of the robot, and waits for lines on standard input. At ``stop`` it asks every server to
cancel all of its goals, whoever has sent them; at ``ping`` it says that it could. It answers in
lines of JSON, to ``stop 7`` with that number, and ends with its input.

It also offers the stop as a service of ROS 2, ``gpsfsm/stop`` (std_srvs/srv/Trigger), and leaves
it to the process that has started it: it writes ``{"called": 1}``, and is to read the response as
``answer 1 {"success": true, "message": "…"}``.

This is no emergency stop: it needs the network and the robot's own servers. SETTINGS is JSON:
``{"ros": {…}, "actions": [names]}``; actions that it sees on the graph below the namespace of the
robot are cancelled as well.
"""

from __future__ import annotations

import json
import sys
import threading
import time
from contextlib import suppress
from importlib.util import find_spec
from itertools import count
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import GpsfsmError
from gpsfsm.model.ros import RosKind, RosSettings
from gpsfsm.ros.ledger import IN_DOUBT
from gpsfsm.ros.messages import definition
from gpsfsm.ros.node import RosError, RosNode, rclpy_module
from gpsfsm.streams import Form, complain, to_stderr, to_stdout

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from gpsfsm.capabilities.library import Library

_CANCEL = "/_action/cancel_goal"
_STATUS = "/_action/status"
_ACTIVE = (1, 2)  # accepted, executing
_ANSWER_S = 2.0
"""What a server may take to answer; all get their requests at once."""
_APPEAR_S = 0.5
"""How long a server that should be there is looked for."""
_POLL_S = 0.005
_READY_S = 3.0
"""How long the start waits for the servers of the robot, which may start later themselves."""
_SEEN_S = 1.5
"""The same for a single stop."""
_LOOK_S = 1.0
SERVICE = "gpsfsm/stop"
_SILENT_S = 3.3
"""What the process that has started this one may take to stop everything."""
_NOT_SEEN = 2
_WHERE = "set the domain and the namespace in the robot profile, or after --ros-args"
_MOST = 500  # actions


def stopper_command(library: Library, place: Mapping[str, Any]) -> tuple[str, ...]:
    """The command of a stopper for the robot that a library describes; () if none can be needed.

    ``place`` is where the robot is, as ``RosSettings.data`` has it.
    """
    calls = [each.ros for each in library.providers if each.ros is not None]
    if not calls or find_spec("rclpy") is None:  # no plan can send a goal from here
        return ()
    head = json.dumps({"ros": dict(place), "actions": _actions(library)})
    return (sys.executable, "-P", "-m", "gpsfsm.ros.stopper", head)


def _actions(library: Library) -> list[str]:
    calls = [each.ros for each in library.providers if each.ros is not None]
    return sorted({each.name for each in calls if each.kind is RosKind.ACTION})


def stop_all(library: Library, place: Mapping[str, Any]) -> int:
    """Cancel all goals of a robot once, and say what came of it; the exit code.

    Raises RosError without a node.
    """
    stopper = Stopper(RosSettings.of(place), _actions(library), ready_s=_SEEN_S)
    try:
        stopped = stopper.stop()
    finally:
        stopper.close()
    for problem in stopped["problems"]:
        complain(problem)
    if not stopped["servers"]:
        complain("no server of an action can be seen, so nothing was cancelled", hint=_WHERE)
        return _NOT_SEEN
    goals, servers = stopped["cancelled"], stopped["servers"]
    to_stdout(f"goals cancelled: {goals}; servers that were asked: {servers}\n", Form.TEXT)
    return IN_DOUBT if stopped["problems"] else 0


class Stopper:
    """Cancels all goals of all actions of a robot.

    ``actions`` are names as capability files have them. Raises RosError without a node.
    """

    def __init__(
        self, settings: RosSettings, actions: Iterable[str], *, ready_s: float = _READY_S
    ) -> None:
        rclpy_module()
        from action_msgs.msg import GoalStatusArray
        from action_msgs.srv import CancelGoal
        from rclpy.qos import DurabilityPolicy, QoSProfile

        self._kind = CancelGoal
        self._node = RosNode(settings, "gpsfsm_stopper")
        self._clients: dict[str, Any] = {}
        self._active: dict[str, int] = {}
        self._numbers = count(1)
        self._calls: dict[int, Any] = {}
        self._status = GoalStatusArray
        self._latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._required = {f"{self._node.name(name)}{_CANCEL}" for name in actions}
        self._node.do(self._look)
        end = time.monotonic() + ready_s
        while not self._node.do(self._complete) and time.monotonic() < end:
            time.sleep(_POLL_S)
        self._timer = self._node.do(lambda: self._node.handle.create_timer(_LOOK_S, self._look))

    def _complete(self) -> bool:
        """True if every server that the library names can be reached."""
        return all(self._clients[name].service_is_ready() for name in self._required)

    def _look(self) -> None:
        """Have a client for each action there is, before it is needed."""
        handle = self._node.handle
        space = handle.get_namespace().rstrip("/") + "/"
        names = {
            name
            for name, _ in handle.get_service_names_and_types()
            if name.endswith(_CANCEL) and name.startswith(space)
        }
        for name in sorted(self._required | names)[:_MOST]:
            if name not in self._clients:
                self._clients[name] = handle.create_client(self._kind, name)
                handle.create_subscription(
                    self._status,
                    name.removesuffix(_CANCEL) + _STATUS,
                    lambda message, name=name: self._count(name, message),
                    self._latched,
                )

    def _count(self, name: str, message: Any) -> None:
        """Note how many goals of a server have not ended."""
        self._active[name] = sum(each.status in _ACTIVE for each in message.status_list)

    def stop(self) -> dict[str, Any]:
        """Cancel everything: how many goals are being cancelled, and who did not answer.

        Those that can be seen get their requests at once. One that the library names and that
        cannot be seen is looked for a moment longer, and then has no goals, as far as anybody
        knows: it is a problem if it had some when it was seen last.
        """
        pending: dict[str, Any] = {}

        def ask() -> bool:
            """Ask those that are there by now; true once all have answered that should be there."""
            self._look()
            for name, client in self._clients.items():
                if name not in pending and client.service_is_ready():
                    pending[name] = client.call_async(self._kind.Request())  # zeros: all goals
            return self._required <= pending.keys() and all(
                future.done() for future in pending.values()
            )

        end, late = time.monotonic() + _ANSWER_S, time.monotonic() + _APPEAR_S
        while not self._node.do(ask) and time.monotonic() < end:
            if time.monotonic() > late and all(future.done() for future in pending.values()):
                break
            time.sleep(_POLL_S)
        while any(map(self._active.get, pending)) and time.monotonic() < min(end, late + _APPEAR_S):
            time.sleep(_POLL_S)  # a goal that is being cancelled is not active any more
        cancelled, problems = 0, []
        for name, future in pending.items():
            action = name.removesuffix(_CANCEL)
            if not future.done() or future.result() is None:
                problems.append(f"{action} does not answer")
            else:
                cancelled += (some := len(future.result().goals_canceling))
                if left := self._active.get(name):
                    refused = f"{left} of its goals" if some else "its goals"
                    problems.append(f"{action} refuses to cancel {refused}")
        for name in sorted(self._active.keys() - pending.keys()):
            if self._active[name]:
                action = name.removesuffix(_CANCEL)
                problems.append(f"{action} cannot be seen any more, and had active goals")
        return {"cancelled": cancelled, "servers": len(pending), "problems": problems}

    def offer(self) -> None:
        """Offer the stop as a service; without its definition it is not there."""
        try:
            kind = definition("std_srvs/srv/Trigger")
        except RosError as error:
            to_stderr(f"gpsfsm: the service {SERVICE} is not offered: {error}\n")
            return
        from rclpy.callback_groups import ReentrantCallbackGroup
        from rclpy.task import Future

        async def stop(_request: Any, response: Any) -> Any:
            number, said = next(self._numbers), Future()
            self._calls[number] = said
            silent = {"success": False, "message": "the service of gpsfsm does not answer"}
            timer = threading.Timer(_SILENT_S, self.answer, (number, silent))
            timer.daemon = True
            timer.start()
            _answer({"called": number})
            row = await said
            timer.cancel()
            del self._calls[number]
            response.success, response.message = row["success"] is True, str(row["message"])
            return response

        name, apart = self._node.name(SERVICE), ReentrantCallbackGroup()  # it holds up nothing
        make = self._node.handle.create_service
        self._node.do(lambda: make(kind, name, stop, callback_group=apart))

    def answer(self, number: int, row: dict[str, Any]) -> None:
        """Answer who has called the service; the first answer counts."""

        def settle() -> None:
            said = self._calls.get(number)
            if said is not None and not said.done():
                said.set_result(row)
                self._node.call(lambda: None)  # the executor looks at what waits when it is woken

        self._node.call(settle)

    def alive(self) -> bool:
        """True if the node spins; one that does not could cancel nothing."""
        return self._node.do(lambda: True)

    def close(self) -> None:
        """End the node."""
        self._node.close()


def main(arguments: Sequence[str] | None = None) -> int:
    """Wait for lines, and stop the robot at each ``stop``; exit code 2 if there can be no node."""
    words = sys.argv[1:] if arguments is None else list(arguments)
    try:
        head = json.loads(words[0])
        stopper = Stopper(RosSettings.of(head["ros"]), head["actions"])
    except (GpsfsmError, ImportError, ValueError, KeyError, IndexError) as error:
        _answer({"failed": str(error)})
        to_stderr(f"gpsfsm: no goal can be cancelled: {error}\n")
        return 2
    stopper.offer()
    _answer({"ready": True})
    try:
        for line in sys.stdin:
            word, _, number = line.strip().partition(" ")
            if word == "stop":
                which = {"stop": int(number)} if number.isdecimal() else {}
                _answer({**which, **stopper.stop()})
            elif word == "answer":
                number, _, text = number.partition(" ")
                with suppress(ValueError, KeyError):
                    stopper.answer(int(number), json.loads(text))
            elif word == "ping":
                _answer({"alive": stopper.alive()})
    except KeyboardInterrupt:
        pass
    finally:
        stopper.close()
    return 0


_WRITING = threading.Lock()


def _answer(row: dict[str, Any]) -> None:
    with _WRITING:
        to_stdout(json.dumps(row) + "\n", Form.JSON)


if __name__ == "__main__":
    sys.exit(main())
