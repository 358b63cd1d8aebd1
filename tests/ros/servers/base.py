"""A fake server: a node of ROS 2 that is commanded over stdin and tells on stdout what it received.

Both are JSON lines. ``{"do": "place", "x": 1.0}`` calls the method ``do_place(x=1.0)`` and is
answered by ``{"event": "done", "do": "place"}`` when it has taken effect. All other lines are the
journal, of which the first is ``{"event": "ready"}``. A server ends by SIGINT, SIGTERM or the end
of stdin, so none of them outlives the tests.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import rclpy
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

if TYPE_CHECKING:
    from collections.abc import Sequence

_ENDS = {signal.SIGINT, signal.SIGTERM}
_THREADS = 16
"""Each goal that runs and each service that hangs keeps one of them."""


def arguments() -> list[str]:
    """The arguments of the command line, without those that ROS 2 takes."""
    return remove_ros_args(sys.argv)[1:]


def uuid_of(goal_id: Any) -> str:
    """The id of a goal in hexadecimal digits."""
    return bytes(goal_id.uuid).hex()


class FakeServer:
    """A node and its executor; subclasses add actions, services and commands."""

    def __init__(self, name: str) -> None:
        # The threads of numpy are older and may take a signal: so it is not waited for, but whoever
        # takes it writes to a pipe. Those of the middleware are let alone.
        self._ends, told = os.pipe()
        os.set_blocking(told, False)
        signal.set_wakeup_fd(told)
        for number in _ENDS:
            signal.signal(number, lambda *_: None)
        signal.pthread_sigmask(signal.SIG_BLOCK, _ENDS)
        rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
        self.node = rclpy.create_node(name)
        self.group = ReentrantCallbackGroup()
        self.stopping = threading.Event()
        self._entities: list[Any] = []
        self._writing = threading.Lock()
        self._executor = MultiThreadedExecutor(_THREADS)
        self._executor.add_node(self.node)

    def journal(self, event: str, **fields: Any) -> None:
        """Write a line of the journal."""
        with self._writing:
            sys.stdout.write(json.dumps({"event": event, **fields}) + "\n")
            sys.stdout.flush()

    def serve(self, service_type: Any, name: str, callback: Any) -> None:
        """Offer a service; its name is relative to the namespace unless it begins with a slash."""
        self.node.create_service(service_type, name, callback, callback_group=self.group)

    def keep(self, entity: Any) -> Any:
        """A server or a client of an action, which has to be destroyed before its node."""
        self._entities.append(entity)
        return entity

    def hang(self) -> None:
        """Wait until the server is stopped."""
        self.stopping.wait()

    def now(self) -> Any:
        """The time, as messages have it."""
        return self.node.get_clock().now().to_msg()

    def run(self) -> None:
        """Serve until the process is told to end, and leave in the order in which rclpy can."""
        spinning = threading.Thread(target=self._spin, name="executor")
        spinning.start()
        threading.Thread(target=self._read_commands, daemon=True, name="commands").start()
        self.journal("ready")
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _ENDS)
        os.read(self._ends, 1)
        self.stopping.set()
        self.stop()
        self._executor.shutdown()
        spinning.join()
        for entity in self._entities:
            entity.destroy()  # else the node lives on, and Fast DDS leaves its files behind
        self.node.destroy_node()
        rclpy.try_shutdown()

    def end(self) -> None:
        """End the server, from any of its threads."""
        os.kill(os.getpid(), signal.SIGTERM)

    def stop(self) -> None:
        """Join the threads that a subclass has started."""

    def _spin(self) -> None:
        with suppress(ExternalShutdownException):
            self._executor.spin()

    def _read_commands(self) -> None:
        for line in sys.stdin:
            row = json.loads(line)
            name = row.pop("do")
            try:
                getattr(self, f"do_{name}")(**row)
            except Exception as error:  # a mistake in a test has to end the test, not to stall it
                self.journal("error", do=name, message=f"{type(error).__name__}: {error}")
            else:
                self.journal("done", do=name)
        self.end()


def scripted(answers: list[Any], usual: Any) -> Any:
    """The next answer of a script, and the usual one when the script is over."""
    return answers.pop(0) if answers else usual


def of_choices(value: str, choices: Sequence[str]) -> str:
    """A word of a command, if it is one of those that there are."""
    if value not in choices:
        raise ValueError(f"{value!r} is none of {', '.join(choices)}")
    return value
