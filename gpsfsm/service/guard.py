"""Who may ask: a token, or on loopback a client that means this very service."""

from __future__ import annotations

import hmac
import re
from typing import TYPE_CHECKING

from gpsfsm.service.problems import CONTENT_TYPE, Problem
from gpsfsm.service.registry import all_endpoints
from gpsfsm.service.settings import is_loopback

if TYPE_CHECKING:
    from collections.abc import Mapping

    from starlette.types import ASGIApp, Receive, Scope, Send

    from gpsfsm.service.settings import Settings

__all__ = ["Guard"]

_CLOSE = {"connection": "close"}  # a body that nobody reads may follow
_OTHERS = "pages of other sites may not ask"
_READING = ("GET", "HEAD")
_SAME = (b"same-origin", b"none")
"""How a browser says that its user, or a page of this very service, has asked."""


class Guard:
    """Lets requests through that may be asked.

    With a token, ``Authorization: Bearer …`` has to show it. Without one the service is bound to
    loopback, and then the Host header must name this machine: else a page in a browser could have
    its own name lead here. ``Origin`` must not name another site for the same reason, and pages of
    other servers on this machine may not let anything be done.
    """

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self._app = app
        self._token = settings.token
        self._hosts = frozenset(host.lower() for host in settings.hosts)
        public = {_pattern(each.path) for each in all_endpoints() if each.public}
        self._public = re.compile("|".join(sorted(public)))
        self._gates = frozenset(each.path for each in all_endpoints() if each.refuses)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer with a problem, or pass on."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        problem = self._problem(scope)
        if problem is None:
            await self._app(scope, receive, send)
            return
        if scope["path"] in self._gates:
            problem.more |= {"verdict": "refuse", "reason": "inconclusive"}
        headers = {"content-type": CONTENT_TYPE, **problem.headers}
        pairs = [(name.encode(), value.encode()) for name, value in headers.items()]
        await send({"type": "http.response.start", "status": problem.status, "headers": pairs})
        await send({"type": "http.response.body", "body": problem.body()})

    def _problem(self, scope: Scope) -> Problem | None:
        headers = dict(scope["headers"])
        public = self._public.fullmatch(scope["path"]) is not None
        if not self._token:
            return _stranger(headers, scope["method"], self._hosts, public=public)
        if public or self._knows(headers.get(b"authorization", b"")):
            return None
        asked = {"www-authenticate": 'Bearer realm="gpsfsm"', **_CLOSE}
        return Problem(401, "a token is needed: Authorization: Bearer …", headers=asked)

    def _knows(self, header: bytes) -> bool:
        kind, _, shown = header.partition(b" ")
        return kind.lower() == b"bearer" and hmac.compare_digest(
            shown.strip(), self._token.reveal().encode()
        )


def _stranger(
    headers: Mapping[bytes, bytes], method: str, names: frozenset[str], *, public: bool
) -> Problem | None:
    """What is wrong with a request that shows no token: who has sent it may not ask."""
    shown = headers.get(b"host", b"")
    host, origin = _host_of(shown), headers.get(b"origin")
    if not (is_loopback(host) or host in names):
        return Problem(421, "the Host header does not name this service", headers=_CLOSE)
    reads = method in _READING
    if origin is not None:
        place = origin.partition(b"://")[2]
        other = _host_of(place)
        same = place.lower() == shown.strip().lower() or other in names
        if not (same or (reads and is_loopback(other))):
            return Problem(403, _OTHERS, headers=_CLOSE)
    if headers.get(b"sec-fetch-site", b"none") not in _SAME and not (public and reads):
        return Problem(403, _OTHERS, headers=_CLOSE)
    return None


def _pattern(path: str) -> str:
    """Which paths an endpoint stands for."""
    return "".join(
        "[^/]+" if part.startswith("{") else re.escape(part)
        for part in re.split(r"(\{\w+\})", path)
    )


def _host_of(value: bytes) -> str:
    """The host of a Host header, without its port."""
    host = value.decode("latin-1").strip().lower()
    if host.startswith("["):
        return host[1:].partition("]")[0]
    return host.partition(":")[0]
