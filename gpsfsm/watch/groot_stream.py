"""The stream for Groot2: the protocol of BehaviorTree.CPP's publisher, read only.

A client sends a header of six bytes (protocol 2, a letter, a number) over ZeroMQ, perhaps with a
second part, and the answer begins with that header and sixteen bytes that name the tree:

    02 53 07000000            S: the statuses?
    02 53 07000000 <tree id>  010001 020002 …    node 1 is RUNNING, node 2 a SUCCESS

What would change the run (breakpoints, replaced results) is refused, as the protocol refuses: with
the parts ``error`` and why. What removes such things is done at once, since there are none.
"""

from __future__ import annotations

import hashlib
import importlib
import re
import struct
import threading
from time import monotonic
from typing import TYPE_CHECKING
from uuid import UUID

from gpsfsm.compile.plan_text import holds_trees
from gpsfsm.errors import UsageError, installing
from gpsfsm.watch.groot_tree import Statuses, text_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from types import TracebackType
    from typing import Self

    import zmq

    from gpsfsm.execution.records import Record
    from gpsfsm.watch.groot_tree import GrootTree

    _Socket = zmq.Socket[bytes]
    _Context = zmq.Context[_Socket]

PORT = 1667
"""Where Groot2 looks, if nobody says otherwise. One port further are messages of breakpoints."""

_HEADER = struct.Struct("<BBI")
_PROTOCOL = 2
_MOST_BYTES = 1 << 16
_POLL_MS = 50
_LINGER_MS = 500
_LAST_S = 2.0
"""A client whose last request is not older than this may see how the run has ended."""

_ADDRESS = re.compile(r"(?:(?P<host>[^\s\[\]:]+|\[[0-9a-fA-F:.]+\]):)?(?P<port>[0-9]{1,5})")
_READ_ONLY = "read only: gpsfsm takes no breakpoints, and records runs with --journal"
_NO_BLACKBOARD = b"\xc0"  # null in MessagePack


def address_of(text: str) -> tuple[str, int]:
    """The host and the port of an address; this machine, if it names no host.

    >>> address_of("1667"), address_of("0.0.0.0:1700")
    (('127.0.0.1', 1667), ('0.0.0.0', 1700))
    """
    match = _ADDRESS.fullmatch(text)
    if match is None or not 0 < int(match["port"]) < 65_535:
        raise UsageError(
            f"--groot takes a port, such as {PORT}, or host:port, not '{text[:80]}' "
            "(the port after it is used, too)"
        )
    host = match["host"] or "127.0.0.1"
    return "127.0.0.1" if host == "localhost" else host, int(match["port"])


class Shown:
    """The tree of one run as it stands, and the answers to requests."""

    def __init__(self, tree: GrootTree) -> None:
        self.xml = text_of(tree).encode()
        digest = hashlib.sha256(self.xml).digest()
        self.identity = UUID(bytes=digest[:16], version=4).bytes  # the same for the same tree
        self._statuses = Statuses(tree)
        self.buffer = self._statuses.buffer()

    def add(self, records: Sequence[Record]) -> None:
        """Take in what has happened; another thread reads the buffer, which is replaced whole."""
        if records:
            self._statuses.add(records)
            self.buffer = self._statuses.buffer()

    def answer(self, kind: str, parts: Sequence[bytes]) -> list[bytes] | str:
        """The parts behind the header, or why the request is refused."""
        plain = {"T": self.xml, "S": self.buffer, "D": b"[]", "t": b""}
        if kind in plain:  # the tree, the statuses, no hooks, no transitions
            return [plain[kind]]
        if kind in ("A", "X"):  # no hook is left
            return []
        if kind not in "BIRUr":
            return "Request not recognized"
        if len(parts) != 1:
            return "must be 2 parts message"
        if kind == "B":
            return [_NO_BLACKBOARD]
        return [] if kind == "r" and parts[0] != b"start" else _READ_ONLY


def reply(shown: Shown, parts: Sequence[bytes]) -> list[bytes]:
    """The answer to a request, whatever it holds."""
    if not parts or len(parts[0]) != _HEADER.size:
        return [b"error", b"wrong request header"]
    _, kind, number = _HEADER.unpack(parts[0])
    answer = shown.answer(chr(kind), parts[1:])
    if isinstance(answer, str):
        return [b"error", answer.encode()]
    return [_HEADER.pack(_PROTOCOL, kind, number) + shown.identity, *answer]


def stream_of(
    address: str, plans: Iterable[tuple[str, str]], *, from_response: bool = False
) -> GrootStream:
    """A stream, not yet open, for plans with their names. Raises UsageError if one is no tree."""
    stream = GrootStream(*address_of(address))
    for name, text in plans:
        if not holds_trees(text, from_response=from_response):
            raise UsageError(f"--groot shows behaviour trees, and {name} holds none; leave it out")
    return stream


class GrootStream:
    """A server for Groot2, in a thread of its own, from entering it to leaving it."""

    def __init__(self, host: str, port: int) -> None:
        try:
            importlib.import_module("zmq")
        except ModuleNotFoundError:
            raise UsageError(f"--groot needs pyzmq: {installing('groot')}") from None
        self._host, self._port = host, port
        self._shown: Shown | None = None
        self._over = threading.Event()
        self._thread: threading.Thread | None = None

    def show(self, tree: GrootTree) -> Shown:
        """Show the tree of a run from now on."""
        self._shown = Shown(tree)
        return self._shown

    def __enter__(self) -> Self:
        import zmq

        context = zmq.Context()
        sockets = [context.socket(kind) for kind in (zmq.REP, zmq.PUB)]
        for number, socket in enumerate(sockets):
            socket.setsockopt(zmq.MAXMSGSIZE, _MOST_BYTES)
            socket.setsockopt(zmq.IPV6, int(":" in self._host))
            where = f"{self._host}:{self._port + number}"
            try:
                socket.bind(f"tcp://{where}")
            except zmq.ZMQError as error:
                _close(context, sockets)
                why = zmq.strerror(error.errno or 0).lower()
                hint = "name another port, or an address of this machine"
                raise UsageError(f"--groot cannot use {where}: {why}; {hint}") from error
        self._thread = threading.Thread(target=self._serve, args=(context, sockets), daemon=True)
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """No more answers, but for a last one about the end."""
        self._over.set()
        if self._thread is not None:
            self._thread.join()

    def _serve(self, context: _Context, sockets: list[_Socket]) -> None:
        """Answer from the first tree on, until all is over and a client has seen how it ended."""
        server, last, seen = sockets[0], monotonic() - _LAST_S, b""
        try:
            while not self._over.is_set() or self._is_news(seen, last):
                if self._shown is None:
                    self._over.wait(_POLL_MS / 1000)
                elif server.poll(_POLL_MS):
                    answer = reply(self._shown, server.recv_multipart())
                    server.send_multipart(answer)
                    last, seen = monotonic(), answer[-1]
        finally:
            _close(context, sockets)

    def _is_news(self, seen: bytes, last: float) -> bool:
        """True if a client sent a request lately, and has not seen the last statuses."""
        shown = self._shown
        return shown is not None and seen != shown.buffer and monotonic() - last < _LAST_S


def _close(context: _Context, sockets: list[_Socket]) -> None:
    for socket in sockets:
        socket.close(linger=_LINGER_MS)  # the last answer is to arrive
    context.term()
