"""A client of the stream for Groot2, and trees to look at."""

from __future__ import annotations

import socket
import struct
from contextlib import contextmanager
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET  # our own texts, so no defence is needed

import pytest

from gpsfsm.compile import compile_plan
from gpsfsm.compile.plan_text import forest_in, read_plan
from gpsfsm.watch.groot_tree import GrootTree, groot_tree
from tests.cli.support import TIMEOUT_S

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

zmq = pytest.importorskip("zmq", reason="pyzmq is not installed")

LEAVES = ("A0", "A1", "A2", "A3", "A8", "A9", "C0", "C1")
"""Actions, and conditions."""


def whole(body: str) -> str:
    """A file with a main tree, and two others that it may use."""
    models = "".join(
        f'<{"Action" if name[0] == "A" else "Condition"} ID="{name}"/>' for name in LEAVES
    )
    return (
        f'<root BTCPP_format="4" main_tree_to_execute="Main"><BehaviorTree ID="Main">{body}'
        '</BehaviorTree><BehaviorTree ID="Sub"><Sequence name="all of it"><A8/>'
        '<SubTree ID="Deep" port="{key}"/></Sequence></BehaviorTree><BehaviorTree ID="Deep">'
        f"<Fallback><A9/><AlwaysSuccess/></Fallback></BehaviorTree>"
        f"<TreeNodesModel>{models}</TreeNodesModel></root>"
    )


SEQUENCE = whole("<Sequence><A0/><C0/><A1/></Sequence>")
NESTED = whole('<Sequence><SubTree ID="Sub"/><SubTree ID="Deep" name="again"/></Sequence>')


def free_port() -> int:
    """A port that is free, and the one after it, too."""
    while True:
        with socket.socket() as first, socket.socket() as second:
            first.bind(("127.0.0.1", 0))
            port = first.getsockname()[1]
            try:
                second.bind(("127.0.0.1", port + 1))
            except (OSError, OverflowError):
                continue
            return int(port)


def header(kind: str, number: int = 7, protocol: int = 2) -> bytes:
    return struct.pack("<BBI", protocol, ord(kind), number)


@contextmanager
def asking(port: int) -> Iterator[Callable[..., list[bytes]]]:
    """A client that sends the parts of a request and gets those of the answer."""
    context = zmq.Context()
    client = context.socket(zmq.REQ)
    client.setsockopt(zmq.RCVTIMEO, TIMEOUT_S * 1000)
    client.connect(f"tcp://127.0.0.1:{port}")

    def ask(*parts: bytes) -> list[bytes]:
        client.send_multipart(parts)
        return list(client.recv_multipart())

    try:
        yield ask
    finally:
        client.close(linger=0)
        context.term()


def tree_of(text: str) -> GrootTree:
    plan, forest = read_plan(text).plan, forest_in(text)
    assert plan is not None
    assert forest is not None
    return groot_tree(forest, compile_plan(plan))


def parsed(text: str | bytes) -> ET.Element:
    """A text of the stream."""
    return ET.fromstring(text)  # noqa: S314
