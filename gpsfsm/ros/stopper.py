"""The process that stops a robot: ``python -m gpsfsm.ros.stopper SETTINGS``.

It does nothing else, so nothing can keep it from doing so: it holds a node with a client for every
action of the robot, and waits for a line ``stop`` on standard input. Then it asks every server to
cancel all of its goals, whoever has sent them, and answers in a line of JSON. It ends with its
input.

This is no emergency stop: it needs the network and the robot's own servers. SETTINGS is JSON:
``{"ros": {…}, "actions": [names]}``; actions that it sees on the graph below the namespace of the
robot are cancelled as well.
"""

from __future__ import annotations

import json
import sys
import threading
import time
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import GpsfsmError
from gpsfsm.model.ros import RosKind, RosSettings
from gpsfsm.ros.node import RosNode
from gpsfsm.streams import to_stderr

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from gpsfsm.capabilities.library import Library

_CANCEL = "/_action/cancel_goal"
_ANSWER_S = 2.0
"""What a server may take to answer; all are asked at once."""
_LOOK_S = 1.0
_MOST = 500  # actions


def stopper_command(library: Library, settings: RosSettings) -> tuple[str, ...]:
    """The command of a stopper for the robot that a library describes; () if it has no actions."""
    calls = [each.ros for each in library.providers if each.ros is not None]
    actions = sorted({each.name for each in calls if each.kind is RosKind.ACTION})
    if not calls:
        return ()
    head = json.dumps({"ros": settings.data(), "actions": actions})
    return (sys.executable, "-m", "gpsfsm.ros.stopper", head)


class Stopper:
    """Cancels all goals of all actions of a robot.

    ``actions`` are names as capability files have them. Raises RosError without a node.
    """

    def __init__(self, settings: RosSettings, actions: Iterable[str]) -> None:
        from action_msgs.srv import CancelGoal

        self._kind = CancelGoal
        self._node = RosNode(settings, "gpsfsm_stopper")
        self._clients: dict[str, Any] = {}
        self._required = {f"{self._node.name(name)}{_CANCEL}" for name in actions}
        self._node.do(self._look)
        self._timer = self._node.do(lambda: self._node.handle.create_timer(_LOOK_S, self._look))

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

    def stop(self) -> dict[str, Any]:
        """Cancel everything: how many goals are being cancelled, and who did not answer.

        A server that nobody has seen has no goals, as far as anybody knows, and is left out.
        """
        arrived = threading.Event()
        pending: dict[str, Any] = {}

        def arrive(_: Any) -> None:
            if all(future.done() for future in pending.values()):
                arrived.set()

        def ask() -> None:
            self._look()
            for name, client in self._clients.items():
                if client.service_is_ready():
                    pending[name] = client.call_async(self._kind.Request())  # zeros: all goals
            for future in pending.values():
                future.add_done_callback(arrive)

        self._node.do(ask)
        if pending:
            arrived.wait(_ANSWER_S)
        cancelled, problems = 0, []
        for name, future in pending.items():
            action = name.removesuffix(_CANCEL)
            if not future.done() or future.result() is None:
                problems.append(f"{action} does not answer")
            elif future.result().return_code not in (0, 1):  # 1: there was nothing to cancel
                problems.append(f"{action} refuses to cancel")
            else:
                cancelled += len(future.result().goals_canceling)
        return {"cancelled": cancelled, "servers": len(pending), "problems": problems}

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
    _answer({"ready": True})
    try:
        for line in sys.stdin:
            if line.strip() == "stop":
                began = time.monotonic()
                answer = stopper.stop()
                _answer({**answer, "seconds": round(time.monotonic() - began, 4)})
    except KeyboardInterrupt:
        pass
    finally:
        stopper.close()
    return 0


def _answer(row: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(row) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
