"""Servers of services and actions on the graph: waiting for one, and why there is none.

A server can be listed and yet not answer: DDS matches by the whole definition, and the graph shows
only its name. So what is listed under a name is compared before anything is said about it.
"""

from __future__ import annotations

import asyncio
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from gpsfsm.model.printable import clip
from gpsfsm.ros.messages import definition, fill, first_definition
from gpsfsm.ros.node import Answer, RosError

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping, Sequence

    from gpsfsm.execution.records import RunValue
    from gpsfsm.ros.node import RosNode

_LOOK_S = 0.02
_MOST_NEAR = 3
_BEAT_S = 1.0
_MISSED = 2
"""Looks at the graph, a second apart, in which a server must be missing to count as gone."""
WAIT_S = 5.0
"""How long a server may take to appear, where nothing else is said."""


class NoServerError(RosError):
    """There is no server that could answer; the text says what is there instead."""


async def appeared(
    node: RosNode, ready: Callable[[], bool], why: Callable[[], str], wait_s: float
) -> None:
    """Wait for a server. Raises NoServerError with what ``why`` says in the thread of the node."""
    end = time.monotonic() + wait_s
    while not await asyncio.to_thread(node.do, ready):
        if time.monotonic() > end:
            raise NoServerError(await asyncio.to_thread(node.do, why))
        await asyncio.sleep(_LOOK_S)


async def published(node: RosNode, name: str, kind: str, wait_s: float) -> None:
    """Wait for a publisher of a topic. Raises NoServerError."""
    full = node.name(name)

    def ready() -> bool:
        infos = node.handle.get_publishers_info_by_topic(full)
        return any(info.topic_type == kind for info in infos)

    await appeared(node, ready, lambda: absence(node, "topic", name, kind, wait_s), wait_s)


def absence(node: RosNode, what: str, name: str, kind: str, wait_s: float) -> str:
    """The reason why an action, a service or a topic (``what``) has no server, by the graph.

    To be called in the thread of the node. ``name`` is as the client has it, ``kind`` its
    definition.
    """
    from rclpy.action import get_action_names_and_types

    handle = node.handle
    full = node.name(name)
    listed = {
        "action": lambda: get_action_names_and_types(handle),
        "service": handle.get_service_names_and_types,
        "topic": handle.get_topic_names_and_types,
    }[what]()
    offered = [each for other, kinds in listed if other == full for each in kinds]
    others = [each for each in offered if each != kind]
    clients_only = not others and not _served(handle, what, full)
    if offered and others:
        return f"the {what} {full} is a {others[0]} on the robot, not a {kind}"
    if offered and not clients_only:
        return (
            f"the {what} {full} is listed as {kind}, but the types do not match: the robot has "
            "another version of that definition; install that of its distribution"
        )
    domain = node.context.get_domain_id()
    return (
        f"the {what} {full} is not available (waited {wait_s:g} s in domain {domain}): start what "
        "offers it, or set domain, namespace and names in the robot profile"
        f"{_instead(handle, what, full, kind, listed)}"
    )


def _instead(
    handle: Any, what: str, full: str, kind: str, listed: Sequence[tuple[str, Sequence[str]]]
) -> str:
    """The servers on the graph that may be meant: of the same name elsewhere, or of the type."""
    last = full.rpartition("/")[2]
    near = [
        f"{name} ({', '.join(kinds)})"
        for name, kinds in listed
        if name != full
        and (name.rpartition("/")[2] == last or kind in kinds)
        and _served(handle, what, name)
    ]
    shown = ", ".join(near[:_MOST_NEAR])
    return f"; the robot has {clip(shown, 500)}" if near else ""


def _served(handle: Any, what: str, full: str) -> bool:
    """True if some node of the graph is the server of a name; clients are listed as well."""
    from rclpy.action import get_action_server_names_and_types_by_node

    if what == "topic":
        return bool(handle.count_publishers(full))
    for node, space in handle.get_node_names_and_namespaces():
        if (node, space) == (handle.get_name(), handle.get_namespace()):
            continue
        served: list[tuple[str, list[str]]] = []
        with suppress(Exception):  # it has left the graph meanwhile
            served = (
                get_action_server_names_and_types_by_node(handle, node, space)
                if what == "action"
                else handle.get_service_names_and_types_by_node(node, space)
            )
        if any(name == full for name, _ in served):
            return True
    return False


async def offered_definition(
    node: RosNode, full: str, types: Sequence[str], wait_s: float
) -> tuple[str, Any]:
    """The definition that a service has on the robot, of those that are installed.

    Where it cannot be seen in time it is the first that is installed. Raises RosError without any.
    """
    first = first_definition(types)
    end = time.monotonic() + wait_s
    while len(types) > 1 and time.monotonic() < end:
        listed = dict(await asyncio.to_thread(node.do, node.handle.get_service_names_and_types))
        for offered in listed.get(full, ()):
            if offered in types:
                return offered, definition(offered)
        if full in listed:
            break
        await asyncio.sleep(_LOOK_S)
    return first


class Service:
    """A client of one service; ``kind`` is the definition that it has."""

    def __init__(self, node: RosNode, client: Any, kind: Any) -> None:
        self._node, self._client, self.kind = node, client, kind

    @classmethod
    async def open(
        cls, node: RosNode, name: str, types: Sequence[str], wait_s: float = WAIT_S
    ) -> Service:
        """A client, once the server is there. Raises RosError."""
        full = node.name(name)
        offered, kind = await offered_definition(node, full, types, wait_s)
        client = await asyncio.to_thread(node.do, lambda: node.handle.create_client(kind, full))
        service = cls(node, client, kind)
        try:
            await appeared(
                node,
                client.service_is_ready,
                lambda: absence(node, "service", name, offered, wait_s),
                wait_s,
            )
        except BaseException:
            await service.close()
            raise
        return service

    async def ask(
        self,
        values: Mapping[str, RunValue],
        within_s: float,
        optional: Collection[str] = frozenset(),
        may_send: Callable[[], bool] = lambda: True,
        answered: Callable[[], object] | None = None,
    ) -> Any:
        """The response to a request whose fields have these values; 0 s: however long it takes.

        In the thread of the node ``may_send`` has the last word, and ``answered`` is called with
        the response, also if nobody waits for it any more.
        Raises TimeoutError, and RosError for fields that the definition does not have.
        """
        request = self.kind.Request()
        fill(request, values, optional)
        futures: list[Any] = []

        def send() -> Any:
            if not may_send():
                raise RosError("it was not asked, since the robot is being stopped")
            futures.append(self._client.call_async(request))
            if answered is not None:
                futures[0].add_done_callback(lambda _: answered())
            return futures[0]

        answer: Answer[Any] = Answer(self._node, send)
        try:
            async with asyncio.timeout(within_s or None):
                return await self._awaited(answer)
        finally:
            if not answer.done and futures and answered is None:
                self._node.call(lambda: self._client.remove_pending_request(futures[0]))

    async def _awaited(self, answer: Answer[Any]) -> Any:
        """The response, as long as its server is there.

        The graph takes some twenty seconds to notice that a server was killed, and that can be
        sooner than a service may take to answer.
        """
        missed = 0
        while True:
            with suppress(TimeoutError):
                return await answer.within(_BEAT_S)
            there = await asyncio.to_thread(self._node.do, self._client.service_is_ready)
            missed = 0 if there else missed + 1
            if missed == _MISSED:
                name = self._client.srv_name
                raise RosError(f"the server of {name} has gone, and the answer with it")

    async def close(self) -> None:
        """Let go of the client."""
        await asyncio.to_thread(self._node.do, self._client.destroy)
