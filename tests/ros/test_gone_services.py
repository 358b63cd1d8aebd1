"""A service whose server goes while it is asked, without ROS 2: the error says which it was."""

from __future__ import annotations

import asyncio
from concurrent.futures import Future
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.ros import services
from gpsfsm.ros.capabilities2 import Server
from gpsfsm.ros.node import RosError
from gpsfsm.ros.services import Service

if TYPE_CHECKING:
    from collections.abc import Callable


class Node:
    """A node that calls what it is handed at once."""

    def call(self, function: Callable[[], Any]) -> Future[Any]:
        future: Future[Any] = Future()
        future.set_result(function())
        return future

    def do(self, function: Callable[[], Any]) -> Any:
        return function()


def test_a_server_that_has_gone_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """As in ``capabilities pull``, which asks several services."""
    monkeypatch.setattr(services, "_BEAT_S", 0.01)
    name, node = "/capabilities/get_interfaces", Node()
    client = SimpleNamespace(
        call_async=lambda _: SimpleNamespace(add_done_callback=lambda _: None),
        remove_pending_request=lambda _: None,
        service_is_ready=lambda: False,
        srv_name=name,
    )
    service = Service(node, client, SimpleNamespace(Request=object))  # type: ignore[arg-type]
    server = Server(node, "/capabilities", 2, clients={name: service})  # type: ignore[arg-type]
    with pytest.raises(RosError, match=f"^the server of {name} has gone, and the answer with it$"):
        asyncio.run(server.request("get_interfaces", "GetInterfaces", {}))
