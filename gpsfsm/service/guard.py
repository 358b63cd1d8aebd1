"""Who may ask: a token, or on loopback a client that means this very service."""

from __future__ import annotations

import hmac
from typing import TYPE_CHECKING

from gpsfsm.service.problems import CONTENT_TYPE, Problem
from gpsfsm.service.registry import all_endpoints
from gpsfsm.service.settings import is_loopback

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Receive, Scope, Send

    from gpsfsm.service.settings import Settings

__all__ = ["Guard"]


class Guard:
    """Lets requests through that may be asked.

    With a token, ``Authorization: Bearer …`` has to show it. Without one the service is bound to
    loopback, and then the Host header must name this machine: else a page in a browser could have
    its own name lead here. ``Origin`` must not name another site for the same reason.
    """

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self._app = app
        self._token = settings.token
        self._hosts = frozenset(host.lower() for host in settings.hosts)
        self._public = frozenset(each.path for each in all_endpoints() if each.public)
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
        close = {"connection": "close"}  # a body that nobody reads may follow
        if not self._token:
            host = _host_of(headers.get(b"host", b""))
            if not (is_loopback(host) or host in self._hosts):
                return Problem(421, "the Host header does not name this service", headers=close)
            origin = headers.get(b"origin", b"").decode("latin-1")
            if origin and not is_loopback(_host_of(origin.partition("://")[2].encode("latin-1"))):
                return Problem(403, "pages of other sites may not ask", headers=close)
            return None
        if scope["path"] in self._public or self._knows(headers.get(b"authorization", b"")):
            return None
        asked = {"www-authenticate": 'Bearer realm="gpsfsm"', **close}
        return Problem(401, "a token is needed: Authorization: Bearer …", headers=asked)

    def _knows(self, header: bytes) -> bool:
        kind, _, shown = header.partition(b" ")
        return kind.lower() == b"bearer" and hmac.compare_digest(
            shown.strip(), self._token.reveal().encode()
        )


def _host_of(value: bytes) -> str:
    """The host of a Host header, without its port."""
    host = value.decode("latin-1").strip().lower()
    if host.startswith("["):
        return host[1:].partition("]")[0]
    return host.partition(":")[0]
