"""A client of whatever the servers offer, commanded like them: a call, a goal, a message.

The answer to a command is ``{"event": "answer", "value": …}``; feedback and results of goals come
as lines of their own.
"""

from __future__ import annotations

import threading
import time
from functools import cache
from typing import Any

from action_msgs.msg import GoalStatus
from action_msgs.srv import CancelGoal
from rcl_interfaces.msg import Log
from rcl_interfaces.srv import GetParameters
from rclpy.action import ActionClient
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_rosout_default
from rclpy.task import Future

from tests.ros.servers.base import FakeServer, uuid_of
from tests.ros.servers.messages import as_json, filled, type_named

PATIENCE = 30.0
"""The seconds that a server may need until it is there, and has answered a request."""


class Client(FakeServer):
    """A node without servers."""

    def __init__(self) -> None:
        super().__init__("fake_client")
        self.handles: dict[str, Any] = {}
        self._settled: set[str] = set()
        self._service = cache(self._new_service)
        self._action = cache(self._new_action)

    def do_call(self, name: str, of_type: str, timeout: float, request: dict[str, Any]) -> None:
        client = self._service(name, of_type)
        if not client.wait_for_service(timeout):
            self._answer(None)
            return
        if name not in self._settled:
            self._settle()
            self._settled.add(name)
        future = client.call_async(filled(type_named(of_type).Request(), request))
        self._answer(as_json(_result(future, timeout)))

    def do_calls(self, name: str, of_type: str, timeout: float, requests: list[Any]) -> None:
        """Several requests, none of which waits for the answer to another."""
        client = self._service(name, of_type)
        futures = []
        for request in requests:
            futures.append(client.call_async(filled(type_named(of_type).Request(), request)))
            time.sleep(0.02)  # a server keeps the latest ten that it has not taken yet
        self._answer([as_json(_result(future, timeout)) for future in futures])

    def do_services(self) -> None:
        self._answer({name: types[0] for name, types in self.node.get_service_names_and_types()})

    def do_nodes(self) -> None:
        self._answer(self.node.get_node_names())

    def do_goal(self, name: str, of_type: str, goal: dict[str, Any]) -> None:
        client = self._action(name, of_type)

        def report(message: Any) -> None:
            self.journal(
                "feedback", goal=uuid_of(message.goal_id), feedback=as_json(message.feedback)
            )

        sent = client.send_goal_async(filled(type_named(of_type).Goal(), goal), report)
        handle = _result(sent, PATIENCE)
        if handle is None:
            raise TimeoutError(f"no answer of {name} to a goal")
        if not handle.accepted:
            self._answer("")
            return
        key = uuid_of(handle.goal_id)
        self.handles[key] = handle
        handle.get_result_async().add_done_callback(lambda done: self._report(key, done.result()))
        self._answer(key)

    def do_cancel(self, goal: str) -> None:
        response = _result(self.handles[goal].cancel_goal_async(), PATIENCE)
        self._answer(
            CancelGoal.Response.ERROR_REJECTED if response is None else response.return_code
        )

    def do_listen(self, name: str, of_type: str) -> None:
        latched = name.endswith("map")
        quality = QoSProfile(depth=1)
        if latched:
            quality.durability = DurabilityPolicy.TRANSIENT_LOCAL
        future: Future[Any] = Future()

        def receive(message: Any) -> None:
            if not future.done():
                future.set_result(message)

        subscription = self.node.create_subscription(
            type_named(of_type), name, receive, quality, callback_group=self.group
        )
        self._answer(as_json(_result(future, PATIENCE)))
        self.node.destroy_subscription(subscription)

    def do_rosout(self) -> None:
        """Journal the lines of gpsfsm on /rosout from now on."""

        def take(line: Log) -> None:
            if line.name.rpartition(".")[2].startswith("gpsfsm"):
                row = {"level": line.level, "name": line.name, "file": line.file}
                self.journal("line", **row, text=line.msg)

        self.node.create_subscription(
            Log, "/rosout", take, qos_profile_rosout_default, callback_group=self.group
        )

    def _report(self, key: str, response: Any) -> None:
        names = {value: name for name, value in vars(GoalStatus).items() if "STATUS" in name}
        status = names.get(response.status, str(response.status))
        self.journal("result", goal=key, status=status, result=as_json(response.result))

    def _answer(self, value: Any) -> None:
        self.journal("answer", value=value)

    def _new_service(self, name: str, of_type: str) -> Any:
        return self.node.create_client(type_named(of_type), name, callback_group=self.group)

    def _new_action(self, name: str, of_type: str) -> Any:
        # in the node's own group, whose callbacks do not overtake each other
        client = self.keep(ActionClient(self.node, type_named(of_type), name))
        if not client.wait_for_server(PATIENCE):
            raise TimeoutError(f"no action {name}")
        self._settle()
        return client

    def _settle(self) -> None:
        """Wait until every server knows where to send its answers.

        A client sees its server before the server sees the client, and what is answered in between
        is lost. Servers hear of a node's endpoints one after the other: so one that answers to the
        newest of them knows them all.
        """
        own = f"{self.node.get_fully_qualified_name()}/get_parameters"
        for name, _ in self.node.get_service_names_and_types():
            if name == own or not name.endswith("/get_parameters"):
                continue
            client = self.node.create_client(GetParameters, name, callback_group=self.group)
            for _ in range(5):  # one that was killed never answers
                if not client.wait_for_service(1.0):
                    continue
                if _result(client.call_async(GetParameters.Request()), 1.0) is not None:
                    break
            self.node.destroy_client(client)


def _result(future: Any, seconds: float) -> Any:
    """The result of a future that the executor completes, or nothing if it does not in time."""
    done = threading.Event()
    future.add_done_callback(lambda _: done.set())
    return future.result() if done.wait(seconds) else None


if __name__ == "__main__":
    Client().run()
