"""Who may ask: a token, or on loopback a client that means this very service."""

from __future__ import annotations

import hmac
import re
from typing import TYPE_CHECKING

from gpsfsm.service.clients import Proxies
from gpsfsm.service.problems import CONTENT_TYPE, Problem
from gpsfsm.service.registry import all_endpoints
from gpsfsm.service.settings import host_of, is_loopback

if TYPE_CHECKING:
    from collections.abc import Mapping

    from starlette.types import ASGIApp, Receive, Scope, Send

    from gpsfsm.service.settings import Settings

__all__ = ["Guard"]

_CLOSE = {"connection": "close"}  # a body that nobody reads may follow
_OTHERS = "pages of other sites may not ask"
_READING = ("GET", "HEAD")
_SCHEMES = ("http", "https")
_ONCE = frozenset(
    (
        *(b"host", b"authorization", b"origin", b"sec-fetch-site"),
        *(b"content-type", b"content-length", b"transfer-encoding"),
    )
)
"""What must not say two things: a program on the way may take the other one of them."""
_SAME = (b"same-origin", b"none")
"""How a browser says that its user, or a page of this very service, has asked."""


class Guard:
    """Lets requests through that may be asked, and writes down whose they are.

    With tokens, ``Authorization: Bearer …`` has to show one. Without one the service is bound to
    loopback, and then the Host header must name this machine: else a page in a browser could have
    its own name lead here. ``Origin`` must not name another site for the same reason, and pages of
    other servers on this machine may not let anything be done.
    """

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self._app = app
        self._tokens = settings.tokens
        self._hosts = frozenset(host_of(f"{host}:1") or "" for host in settings.hosts)
        self._proxies = Proxies(settings.proxies)
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
        if not scope["path"].startswith("/"):  # http://… or *: which host is meant, nobody knows
            return Problem(400, "the target of a request has to be a path", headers=_CLOSE)
        headers: dict[bytes, bytes] = {}
        for name, value in scope["headers"]:
            if name in _ONCE and name in headers:
                message = f"the header {name.decode()} is there twice"
                return Problem(400, message, headers=_CLOSE)
            headers[name] = value
        public = self._public.fullmatch(scope["path"]) is not None
        token = self._number(headers.get(b"authorization", b""))
        self._proxies.mark(scope, token)
        if not self._tokens:
            return _stranger(headers, scope["method"], self._hosts, public=public)
        if public or token is not None:
            return None
        needed = {"www-authenticate": 'Bearer realm="gpsfsm"', **_CLOSE}
        return Problem(401, "a token is needed: Authorization: Bearer …", headers=needed)

    def _number(self, header: bytes) -> int | None:
        """Which token is shown; all are compared, so that the time says nothing."""
        kind, _, shown = header.partition(b" ")
        same = [hmac.compare_digest(shown.strip(), each.reveal().encode()) for each in self._tokens]
        return same.index(True) if kind.lower() == b"bearer" and True in same else None


def _stranger(
    headers: Mapping[bytes, bytes], method: str, names: frozenset[str], *, public: bool
) -> Problem | None:
    """What is wrong with a request that shows no token: who has sent it may not ask."""
    shown = headers.get(b"host", b"").decode("latin-1")
    host, origin = host_of(shown), headers.get(b"origin")
    if host is None or not (is_loopback(host) or host in names):
        return Problem(421, "the Host header does not name this service", headers=_CLOSE)
    reads = method in _READING
    if origin is not None:
        scheme, _, place = origin.decode("latin-1").partition("://")
        other = host_of(place) if scheme in _SCHEMES else None
        same = place.lower() == shown.lower() or other in names
        if other is None or not (same or (reads and is_loopback(other))):
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
