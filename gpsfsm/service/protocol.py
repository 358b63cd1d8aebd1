"""Connections that cost little, however long a client takes: what uvicorn's own does not bound.

uvicorn begins to count when the first answer is out. Here a client has to have sent the head of a
request within a time of the connection, or of its first byte; one that does not read what it is
sent is cut off; and there are only so many connections, of which each peer has its share. A peer
that has its share loses the connection on which it has said nothing for the longest time.
"""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any

import h11
import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

from gpsfsm.service.clients import Proxies, name_of
from gpsfsm.service.problems import CONTENT_TYPE, problem_body
from gpsfsm.service.shares import Share
from gpsfsm.streams import to_stderr

if TYPE_CHECKING:
    import socket
    from collections.abc import Callable, Iterable
    from types import FrameType

    from gpsfsm.service.core import Core


__all__ = ["Bounds", "Server", "guarded"]


class Bounds:
    """How long clients may take, and how many there may be.

    ``proxies`` speak for many clients, and have no share of their own.
    """

    def __init__(
        self, *, header_s: float, write_s: float, connections: int, proxies: Iterable[str] = ()
    ) -> None:
        self.header_s = header_s
        self.write_s = write_s
        self._share = Share(connections)
        self._proxies = Proxies(proxies)
        self._silent: dict[str, dict[_Guarded, None]] = {}  # by peer, who is silent longest first

    def admit(self, connection: _Guarded, host: str) -> bool:
        """Whether there is room for one more connection from there."""
        peer, trusted = name_of(host), host in self._proxies
        connection.peer = peer
        if self._share.take(peer, trusted=trusted):
            return True
        oldest = next(iter(self._silent.get(peer, ())), None)
        if oldest is None:
            return False
        oldest.cut_off()
        return self._share.take(peer, trusted=trusted)

    def leave(self, connection: _Guarded) -> None:
        """It is no more."""
        self.speaks(connection)
        self._share.give_back(connection.peer)

    def waits(self, connection: _Guarded) -> None:
        """No request of it is under way."""
        self._silent.setdefault(connection.peer, {}).setdefault(connection)

    def speaks(self, connection: _Guarded) -> None:
        """A request of it is under way."""
        silent = self._silent.get(connection.peer, {})
        silent.pop(connection, None)
        if not silent:
            self._silent.pop(connection.peer, None)


def _answer(status: int, detail: str, *headers: str) -> bytes:
    body = problem_body(status, detail, verdict="refuse", reason="inconclusive")
    reason = {400: "Bad Request", 503: "Service Unavailable"}[status]
    head = "\r\n".join(
        (
            f"HTTP/1.1 {status} {reason}",
            f"Content-Type: {CONTENT_TYPE}",
            f"Content-Length: {len(body)}",
            "Connection: close",
            *headers,
        )
    )
    return head.encode() + b"\r\n\r\n" + body


class _Guarded(H11Protocol):
    """A connection within bounds."""

    bounds: Bounds

    def __init__(self, *args: Any, **named: Any) -> None:
        super().__init__(*args, **named)
        self.peer = ""
        self._admitted = False
        self._head: asyncio.TimerHandle | None = None
        self._stuck: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        host = self.client[0] if self.client else ""
        self._admitted = self.bounds.admit(self, host)
        if not self._admitted:
            too_many = "there are too many connections; try again"
            transport.write(_answer(503, too_many, "Retry-After: 1"))
            self._close()
            return
        self.bounds.waits(self)
        self._expect_head()

    def cut_off(self) -> None:
        """End it at once: its place is needed."""
        self._leave()
        self.transport.abort()

    def data_received(self, data: bytes) -> None:
        if self.transport.is_closing():
            return
        super().data_received(data)
        if self.conn.their_state is not h11.IDLE:
            self._unset("_head")
            self.bounds.speaks(self)
        elif self._head is None and not self.transport.is_closing():
            self._expect_head()  # the beginning of a further request

    def on_response_complete(self) -> None:
        super().on_response_complete()
        if self._admitted and self.conn.their_state is h11.IDLE:
            self.bounds.waits(self)
        if self.transport.is_closing():
            self._stuck = self._stuck or self._later(self.bounds.write_s, self.transport.abort)

    def timeout_keep_alive_handler(self) -> None:
        self._close()

    def send_400_response(self, msg: str) -> None:
        self.transport.write(_answer(400, msg))
        self._close()

    def pause_writing(self) -> None:
        super().pause_writing()
        self._stuck = self._stuck or self._later(self.bounds.write_s, self.transport.abort)

    def resume_writing(self) -> None:
        super().resume_writing()
        if not self.transport.is_closing():
            self._unset("_stuck")

    def connection_lost(self, exc: Exception | None) -> None:
        self._unset("_head")
        self._unset("_stuck")
        self._leave()
        super().connection_lost(exc)
        self._unset_keepalive_if_required()

    def _leave(self) -> None:
        if self._admitted:
            self._admitted = False
            self.bounds.leave(self)

    def _expect_head(self) -> None:
        self._head = self._later(self.bounds.header_s, self._close)

    def _close(self) -> None:
        """Close, and do not wait for ever until everything is read."""
        self._unset("_head")
        self.transport.close()
        self._stuck = self._stuck or self._later(self.bounds.write_s, self.transport.abort)

    def _later(self, seconds: float, action: Callable[[], object]) -> asyncio.TimerHandle:
        return self.loop.call_later(seconds, action)

    def _unset(self, name: str) -> None:
        timer = getattr(self, name)
        if timer is not None:
            timer.cancel()
            setattr(self, name, None)


def guarded(bounds: Bounds) -> type[asyncio.Protocol]:
    """The protocol with these bounds."""
    return type("Guarded", (_Guarded,), {"bounds": bounds})


class Server(uvicorn.Server):
    """A server that tells when it is ready, and ends what would not end by itself."""

    def __init__(self, config: uvicorn.Config, core: Core, address: str) -> None:
        super().__init__(config)
        self._core, self._address = core, address

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Begin, and say where."""
        await super().startup(sockets=sockets)
        if self.started:
            to_stderr(f"gpsfsm: serving at {self._address}\n")

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """A signal says to stop."""
        super().handle_exit(sig, frame)
        self._captured_signals.clear()  # a stop that was asked for is no failure
        self._core.begin_closing()
