"""The entrance: what every request passes first, and every answer last.

It gives the request a number (``X-Request-ID``), takes the prefix of a reverse proxy off its path,
and writes the access log and the span of the request. Neither of these ever holds what stands
behind the question mark of an address, a header, or anything of a body.
"""

from __future__ import annotations

import re
import secrets
import time
from typing import TYPE_CHECKING, Any

from gpsfsm import logs
from gpsfsm.model.printable import clip
from gpsfsm.service.clients import Proxies, address_of, client_of, name_of
from gpsfsm.service.settings import is_prefix

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

    from gpsfsm.service.settings import Settings
    from gpsfsm.service.traces import Traces

ENDPOINT = "gpsfsm.endpoint"
"""Where a scope names the endpoint that answers."""
VERDICT = "gpsfsm.verdict"
"""Where a scope holds the verdict of a gate."""
PREFIX = "gpsfsm.prefix"
"""Where a scope holds the path below which the client sees the service."""

_HEADER = b"x-request-id"
_REQUEST_ID = re.compile(rb"[A-Za-z0-9._~:/+=@-]{1,128}")
_LONGEST_PATH = 200
_REDIRECT = 308
_QUIET = frozenset(("health", "livez", "metrics", "page_file", "readyz"))
"""Endpoints that programs ask all the time; if all is well nobody wants to read that."""


class Entrance:
    """The outermost layer of the application."""

    def __init__(self, app: ASGIApp, settings: Settings, traces: Traces) -> None:
        self._app = app
        self._root = settings.root_path
        self._proxies = Proxies(settings.proxies)
        self._traces = traces

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, and write down how it was answered."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        passage = _Passage(scope, send)
        where = self._locate(scope)
        with self._traces.request(scope, address_of(scope)) as span:
            try:
                if where:
                    await _redirect(where, passage.send)
                else:
                    await self._app(scope, receive, passage.send)
            except Exception:
                passage.status = passage.status or 500
                raise
            finally:
                route = getattr(scope.get(ENDPOINT), "path", "")
                span.answered(scope["method"], route, passage.status, address_of(scope))
                passage.log(span.trace_id)

    def _locate(self, scope: Scope) -> str:
        """Take the prefix off the path; the address that is meant if the path is no more than it.

        A proxy may take the prefix off by itself or leave it, so the service answers to both.
        """
        peer = str(scope["client"][0]) if scope.get("client") else ""
        trusted = peer in self._proxies
        headers = scope["headers"]
        forwarded = _single(headers, b"x-forwarded-prefix").rstrip("/") if trusted else ""
        if trusted and (scheme := _single(headers, b"x-forwarded-proto")) in ("http", "https"):
            scope["scheme"] = scheme
        mounted = scope.get("root_path", "")  # of a server or an application around this one
        prefix = forwarded if is_prefix(forwarded) else self._root or mounted
        scope[PREFIX], scope["root_path"] = prefix, ""
        for each in dict.fromkeys((mounted, self._root, prefix)):
            if not each:
                continue
            if scope["path"] == each:
                query = scope["query_string"].decode("latin-1")
                return f"{prefix}/?{query}" if query else f"{prefix}/"
            if scope["path"].startswith(f"{each}/"):
                scope["path"] = scope["path"][len(each) :]
        return ""


def _single(headers: list[tuple[bytes, bytes]], name: bytes) -> str:
    """The value of a header that is there once; else ""."""
    values = [value for key, value in headers if key == name]
    return values[0].decode("latin-1").strip() if len(values) == 1 else ""


async def _redirect(where: str, send: Send) -> None:
    headers = [(b"location", where.encode("latin-1")), (b"content-length", b"0")]
    await send({"type": "http.response.start", "status": _REDIRECT, "headers": headers})
    await send({"type": "http.response.body", "body": b""})


class _Passage:
    """One request on its way through, and what the access log says of it."""

    def __init__(self, scope: Scope, send: Send) -> None:
        self._scope, self._send = scope, send
        self._method, self._path = scope["method"], scope["path"]
        self._began_s = time.monotonic()
        sent = [value for key, value in scope["headers"] if key == _HEADER]
        sane = len(sent) == 1 and _REQUEST_ID.fullmatch(sent[0])
        self.request_id = sent[0] if sane else secrets.token_hex(8).encode()
        self.status, self._bytes = 0, 0

    async def send(self, message: Message) -> None:
        """Send a part of the answer, and count it."""
        if message["type"] == "http.response.start":
            self.status = message["status"]
            message = {**message, "headers": [*message["headers"], (_HEADER, self.request_id)]}
        elif message["type"] == "http.response.body":
            self._bytes += len(message.get("body", b""))
        await self._send(message)

    def log(self, trace_id: str | None) -> None:
        """Write the line of the access log."""
        level = self._level()
        if not logs.takes(level):
            return
        duration_ms = round(1_000 * (time.monotonic() - self._began_s), 1)
        request_id, address = self.request_id.decode(), address_of(self._scope)
        client = client_of(self._scope, name_of(address))
        method, path = clip(self._method, 20), clip(self._path, _LONGEST_PATH)
        fields: dict[str, Any] = {
            "method": method,
            "path": path,
            "status": self.status,
            "duration_ms": duration_ms,
            "bytes": self._bytes,
            "verdict": self._scope.get(VERDICT),
            "client": client,
            "address": address,
            "request_id": request_id,
            "trace_id": trace_id,
        }
        verdict = f", {fields['verdict']}" if fields["verdict"] else ""
        message = (
            f"{method} {path} {self.status or 'no answer'} {duration_ms:g} ms "
            f"{self._bytes} B{verdict}, {client}, request {request_id}"
        )
        logs.event(level, logs.REQUEST, message, **fields)

    def _level(self) -> logs.Level:
        if self.status >= 500:
            return "error" if self.status == 500 else "warning"
        quiet = getattr(self._scope.get(ENDPOINT), "name", "") in _QUIET
        return "debug" if quiet and self.status < 400 else "info"
