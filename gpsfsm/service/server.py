"""The server: uvicorn with connections that cost little, and its end between two requests.

uvicorn begins to count when the first answer is out. Here a client has to have sent the head of a
request within a time of the connection, or of its first byte; one that does not read what it is
sent is cut off; and there are only so many connections, of which each peer has its share. A peer
that has its share loses the connection on which it has said nothing for the longest time.
"""

from __future__ import annotations

import asyncio
import errno
import socket
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import h11
import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

from gpsfsm import logs
from gpsfsm.errors import GpsfsmError
from gpsfsm.service.application import make_app
from gpsfsm.service.clients import Proxies, Share, name_of
from gpsfsm.service.shapes import CONTENT_TYPE, problem_body
from gpsfsm.service.traces import start_traces

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from types import FrameType

    from gpsfsm.service.core import Core
    from gpsfsm.service.settings import Settings

_FAILED = 2
_FILES = 65_536
_BACKLOG = 2_048
_HEAD_BYTES = 32_768
_LEAST_BODY_FILES = 64


def run(settings: Settings) -> int:
    """Serve until a signal says to stop.

    Raises GpsfsmError if it cannot begin, and at the end if its plan queue could not go on.
    """
    with logs.writing(settings.log_level, settings.log_format):
        try:
            return _run(settings)
        except GpsfsmError as error:
            if not logs.is_json():  # else it is an event, and not a message of the command
                raise
            logs.event("error", "failed", str(error))
            return _FAILED


def _run(settings: Settings) -> int:
    app = make_app(settings, start_traces(settings.otel))
    bounds = Bounds(
        header_s=settings.header_s,
        write_s=settings.body_s,
        connections=settings.connections,
        proxies=settings.proxies,
    )
    _allow_files(settings)
    listening = _bound(settings)
    config = uvicorn.Config(
        app,
        http=guarded(bounds),
        ws="none",
        lifespan="on",
        loop="asyncio",
        log_config=None,
        access_log=False,
        proxy_headers=False,
        server_header=False,
        timeout_keep_alive=max(1, round(settings.idle_s)),
        timeout_graceful_shutdown=max(1, round(settings.grace_s)),
        backlog=_BACKLOG,
        h11_max_incomplete_event_size=_HEAD_BYTES,
    )
    server = Server(config, app.state.core, _address(settings, listening))
    try:
        server.run(sockets=[listening])
    except SystemExit:  # uvicorn's way to say that it could not begin
        if app.state.failure is None:
            raise GpsfsmError("the service could not begin") from None
    finally:
        listening.close()
    if app.state.failure is not None:
        raise app.state.failure
    if app.state.core.failure:
        raise GpsfsmError(f"the plan queue could not go on: {app.state.core.failure}")
    return 0


def _bound(settings: Settings) -> socket.socket:
    """A socket that is bound before anything else begins, so that a port in use costs no time."""
    try:
        addresses = socket.getaddrinfo(
            settings.host, settings.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )
        family, kind, protocol, _, place = addresses[0]
        listening = socket.socket(family, kind, protocol)
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(place)
    except OSError as error:
        where = f"{settings.host}:{settings.port}"
        hint = "; --port takes another port" if error.errno == errno.EADDRINUSE else ""
        raise GpsfsmError(f"cannot serve at {where}: {error.strerror or error}{hint}") from error
    return listening


def _address(settings: Settings, listening: socket.socket) -> str:
    host = f"[{settings.host}]" if ":" in settings.host else settings.host
    return f"http://{host}:{listening.getsockname()[1]}"


def _allow_files(settings: Settings) -> None:
    """As many open files as there may be connections, if the system lets us."""
    with suppress(ImportError, OSError, ValueError):
        import resource

        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        workers = settings.workers + settings.reserved
        wanted = settings.connections + workers * 4 + _LEAST_BODY_FILES
        most = _FILES if hard == resource.RLIM_INFINITY else hard
        if soft != resource.RLIM_INFINITY and soft < wanted:
            resource.setrlimit(resource.RLIMIT_NOFILE, (min(wanted, most), hard))


class Bounds:
    """The time that clients may take, and the number of them that there may be.

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
        """True if there is room for one more connection from there."""
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
    body = problem_body(status, detail, verdict="undecided", reason="inconclusive")
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


class _Connection(h11.Connection):
    """A connection whose requests end where everybody says that they end.

    h11 refuses two lengths that differ and unknown codings. It lets a coding win over a length, and
    over HTTP/1.0; a proxy that does not sees another request in the rest of the body.
    """

    def next_event(self) -> Any:
        """The next event. Raises RemoteProtocolError."""
        event = super().next_event()
        if isinstance(event, h11.Request):
            names = {name for name, _ in event.headers}
            coded = b"transfer-encoding" in names
            if coded and (b"content-length" in names or event.http_version == b"1.0"):
                raise h11.RemoteProtocolError("the length of the body is not clear")
        return event


class _Guarded(H11Protocol):
    """A connection within bounds."""

    bounds: Bounds

    def __init__(self, *args: Any, **named: Any) -> None:
        super().__init__(*args, **named)
        self.conn = _Connection(h11.SERVER, _HEAD_BYTES)
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
        self._drained_s: float | None = None  # when it is to stop

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Begin, and say where."""
        await super().startup(sockets=sockets)
        if self.started:
            where = {"address": self._address, "root_path": self._core.settings.root_path or None}
            logs.event("info", "serving", f"serving at {self._address}", **where)
            if (text := _hint(self._core.settings)) is not None:
                logs.event("info", "reachable", text)

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """A signal says to stop: at once, or at the first one when it has drained."""
        drain_s = self._core.settings.drain_s
        if drain_s and self._drained_s is None:
            self._drained_s = time.monotonic() + drain_s
            self._core.begin_draining()
            return
        super().handle_exit(sig, frame)
        self._captured_signals.clear()  # a stop that was asked for is no failure
        self._core.begin_closing()

    async def on_tick(self, counter: int) -> bool:
        """See whether it has drained; True if it is time to stop."""
        if self._drained_s is not None and time.monotonic() >= self._drained_s:
            self.should_exit = True
            self._core.begin_closing()
        return await super().on_tick(counter)


def _hint(settings: Settings) -> str | None:
    """A word on who can reach the service, where its address does not say that by itself."""
    if settings.host in ("", "::") or settings.host.strip("0.") == "":
        return (
            "it listens on all addresses of this machine; clients need the header "
            "'Authorization: Bearer TOKEN', and a reverse proxy has to provide TLS"
        )
    if settings.root_path and not (settings.hosts or settings.tokens):
        return (
            "a reverse proxy passes on the Host header of its clients: name the service with "
            "--allow-name NAME, or it answers them with 421"
        )
    return None
