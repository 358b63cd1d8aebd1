"""The server: uvicorn within bounds, and what happens when it is told to stop."""

from __future__ import annotations

import logging
import socket
from contextlib import suppress
from typing import TYPE_CHECKING

from gpsfsm.errors import GpsfsmError, UsageError
from gpsfsm.service.application import INSTALL, make_app

if TYPE_CHECKING:
    from gpsfsm.service.settings import Settings

__all__ = ["run"]

_FILES = 65_536
_BACKLOG = 2_048
_LEAST_BODY_FILES = 64


def run(settings: Settings) -> int:
    """Serve until a signal says to stop.

    Raises GpsfsmError if it cannot begin, and at the end if its plan queue could not go on.
    """
    try:
        import uvicorn  # noqa: PLC0415  (an extra)
    except ImportError as error:
        raise UsageError(f"{INSTALL} ({error})") from error
    from gpsfsm.service.protocol import Bounds, Server, guarded  # noqa: PLC0415

    app = make_app(settings)
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
        h11_max_incomplete_event_size=32_768,
    )
    logging.getLogger("uvicorn").setLevel(logging.CRITICAL)
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
        found = socket.getaddrinfo(
            settings.host, settings.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )
        family, kind, protocol, _, place = found[0]
        listening = socket.socket(family, kind, protocol)
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(place)
    except OSError as error:
        where = f"{settings.host}:{settings.port}"
        raise GpsfsmError(f"cannot serve at {where}: {error.strerror or error}") from error
    return listening


def _address(settings: Settings, listening: socket.socket) -> str:
    host = f"[{settings.host}]" if ":" in settings.host else settings.host
    return f"http://{host}:{listening.getsockname()[1]}"


def _allow_files(settings: Settings) -> None:
    """As many open files as there may be connections, if the system lets us."""
    with suppress(ImportError, OSError, ValueError):
        import resource  # noqa: PLC0415  (not on every system)

        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        workers = settings.workers + settings.reserved
        wanted = settings.connections + workers * 4 + _LEAST_BODY_FILES
        most = _FILES if hard == resource.RLIM_INFINITY else hard
        if soft != resource.RLIM_INFINITY and soft < wanted:
            resource.setrlimit(resource.RLIMIT_NOFILE, (min(wanted, most), hard))
