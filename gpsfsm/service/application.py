"""The ASGI application: from endpoints to routes, and from exceptions to problem details.

``Guard`` stands before all routes: it knows who may ask.
"""

from __future__ import annotations

import asyncio
import hmac
import re
import time
from contextlib import asynccontextmanager
from functools import partial
from typing import TYPE_CHECKING

from gpsfsm import logs
from gpsfsm.errors import GpsfsmError
from gpsfsm.generation.providers.address import is_loopback
from gpsfsm.model.printable import clip
from gpsfsm.service.clients import Proxies
from gpsfsm.service.entrance import ENDPOINT, VERDICT, Entrance
from gpsfsm.service.registry import all_endpoints
from gpsfsm.service.settings import host_of
from gpsfsm.service.shapes import CONTENT_TYPE, Problem
from gpsfsm.strict_json import strict_loads

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Mapping

    from starlette.applications import Starlette
    from starlette.requests import Request
    from starlette.responses import Response
    from starlette.types import ASGIApp, Receive, Scope, Send

    from gpsfsm.service.core import Core
    from gpsfsm.service.registry import Endpoint
    from gpsfsm.service.settings import Settings
    from gpsfsm.service.traces import Traces

_COME_AGAIN_S = 0.5
"""Who is told to come again is told so late: not everybody waits as long as Retry-After says."""

_NO_STORE = {"cache-control": "no-store", "x-content-type-options": "nosniff"}


def make_app(settings: Settings, traces: Traces | None = None) -> Starlette:
    """The application; it starts its processes when the server says that it begins.

    Without ``traces`` it has those that its settings and the environment name.
    """
    from starlette.applications import Starlette
    from starlette.routing import Route

    from gpsfsm.service.core import Core
    from gpsfsm.service.traces import start_traces

    core = Core(settings, start_traces(settings.otel) if traces is None else traces)

    @asynccontextmanager
    async def lifespan(_app: Starlette) -> AsyncIterator[None]:
        try:
            await core.start()
        except GpsfsmError as error:
            app.state.failure = error  # Starlette and uvicorn do not pass it on
            raise
        except Exception as error:
            logs.failure("not_started", "the service could not start", error)
            raise
        try:
            yield
        finally:
            await core.close()
            await asyncio.to_thread(core.traces.close)

    routes = [
        Route(each.path, partial(_answer, core, each), methods=[each.method], name=each.name)
        for each in all_endpoints()
    ]
    app = Starlette(
        routes=routes,
        lifespan=lifespan,
        exception_handlers={404: _not_there, 405: _not_so, Exception: _broken},
    )
    app.router.redirect_slashes = False
    app.add_middleware(Guard, settings=settings)
    app.add_middleware(Entrance, settings=settings, traces=core.traces)
    app.state.core, app.state.failure = core, None
    return app


async def _answer(core: Core, wanted: Endpoint, request: Request) -> Response:
    """Answer a request, whatever happens."""
    began_s = time.monotonic()
    request.scope[ENDPOINT] = wanted
    response = await _settled(core, wanted, request)
    response.headers.update(_NO_STORE)
    if wanted.refuses:
        answer = strict_loads(bytes(response.body))
        core.metrics.decided(answer["verdict"], answer["reason"])
        request.scope[VERDICT] = answer["verdict"]
    core.metrics.answered(wanted.name, response.status_code, time.monotonic() - began_s)
    return response


async def _settled(core: Core, wanted: Endpoint, request: Request) -> Response:
    from starlette.requests import ClientDisconnect

    try:
        if wanted.work is not None:
            return await _worked(core, wanted, request)
        assert wanted.handle is not None
        return await wanted.handle(core, request)
    except Problem as problem:
        if problem.status == 429:
            await asyncio.sleep(_COME_AGAIN_S)
        return _response(problem, refuses=wanted.refuses)
    except ClientDisconnect:  # nobody will see this
        return _response(Problem(400, "the connection was closed"), refuses=wanted.refuses)
    except Exception as error:
        message = f"the request failed ({type(error).__name__}); this is a defect of gpsfsm"
        logs.failure("request_failed", message, error, endpoint=wanted.name)
        return _response(Problem(500, message), refuses=wanted.refuses)


async def _worked(core: Core, wanted: Endpoint, request: Request) -> Response:
    from starlette.responses import Response

    from gpsfsm.service.clients import client_of
    from gpsfsm.service.shapes import is_plan

    raw = is_plan(request, allowed=wanted.takes_plan)
    async with core.body(request) as body:
        client = client_of(request.scope)
        answered = await core.pool.do(wanted.name, body, raw=raw, client=client)
    if answered.status != 200 and wanted.refuses:
        return _response(_again(answered.status, answered.body), refuses=True)
    return Response(answered.body, status_code=answered.status, media_type=answered.media)


def _again(status: int, body: bytes) -> Problem:
    """The problem that a worker has told of."""
    import json

    details = json.loads(body)
    standard = ("type", "title", "status", "detail")
    more = {name: value for name, value in details.items() if name not in standard}
    return Problem(status, details["detail"], **more)


def _response(problem: Problem, *, refuses: bool = False) -> Response:
    from starlette.responses import Response

    if refuses:  # fail closed: no error can be taken for a verdict
        problem.more |= {"verdict": "undecided", "reason": "inconclusive"}
    return Response(
        problem.body(),
        status_code=problem.status,
        headers=problem.headers,
        media_type=CONTENT_TYPE,
    )


async def _not_there(_request: Request, _error: Exception) -> Response:
    return _response(Problem(404, "there is nothing here; /openapi.json lists the endpoints"))


async def _not_so(_request: Request, error: Exception) -> Response:
    headers = getattr(error, "headers", None) or {}
    allowed = headers.get("Allow", "another method")
    return _response(
        Problem(405, f"this method is not allowed here; use {allowed}", headers=headers)
    )


async def _broken(_request: Request, error: Exception) -> Response:
    return _response(
        Problem(500, f"the request failed ({type(error).__name__}); this is a defect of gpsfsm")
    )


_CLOSE = {"connection": "close"}  # a body that nobody reads may follow
_NONE_SHOWN = (
    "a token is needed: send the header 'Authorization: Bearer TOKEN'. The tokens are those in the "
    "file that --token-file names, or in GPSFSM_TOKEN"
)
_OTHER_SHOWN = (
    "the Authorization header has no token of this service: it must be 'Bearer TOKEN', with "
    "one from the file that --token-file names, or from GPSFSM_TOKEN"
)
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
            problem.more |= {"verdict": "undecided", "reason": "inconclusive"}
        headers = {"content-type": CONTENT_TYPE, **problem.headers}
        pairs = [(name.encode(), value.encode()) for name, value in headers.items()]
        await send({"type": "http.response.start", "status": problem.status, "headers": pairs})
        await send({"type": "http.response.body", "body": problem.body()})

    def _problem(self, scope: Scope) -> Problem | None:
        if not scope["path"].startswith("/"):  # http://… or *: which host is meant, nobody knows
            return Problem(400, "the target of a request must be a path", headers=_CLOSE)
        headers: dict[bytes, bytes] = {}
        for name, value in scope["headers"]:
            if name in _ONCE and name in headers:
                message = f"the header {name.decode()} is repeated"
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
        shown = b"authorization" in headers
        return Problem(401, _OTHER_SHOWN if shown else _NONE_SHOWN, headers=needed)

    def _number(self, header: bytes) -> int | None:
        """The number of the token shown; all are compared, so that the time says nothing."""
        kind, _, shown = header.partition(b" ")
        same = [hmac.compare_digest(shown.strip(), each.reveal().encode()) for each in self._tokens]
        return same.index(True) if kind.lower() == b"bearer" and True in same else None


def _stranger(
    headers: Mapping[bytes, bytes], method: str, names: frozenset[str], *, public: bool
) -> Problem | None:
    """The problem with a request that shows no token: who has sent it may not ask."""
    shown = headers.get(b"host", b"").decode("latin-1")
    host, origin = host_of(shown), headers.get(b"origin")
    if host is None or not (is_loopback(host) or host in names):
        return Problem(421, _unnamed(host), headers=_CLOSE)
    reads = method in _READING
    if origin is not None:
        scheme, _, place = origin.decode("latin-1").partition("://")
        other = host_of(place) if scheme in _SCHEMES else None
        same = place.lower() == shown.lower() or other in names
        if other is None or not (same or (reads and is_loopback(other))):
            return Problem(403, _foreign(other), headers=_CLOSE)
    if headers.get(b"sec-fetch-site", b"none") not in _SAME and not (public and reads):
        return Problem(403, _foreign(None), headers=_CLOSE)
    return None


def _unnamed(host: str | None) -> str:
    """The detail of a 421: which option lets the service answer to this name."""
    if host is None:
        return "the Host header is missing or is not a host name"
    name = _option_of(host)
    return (
        f"the Host header names '{name}', which is not a name of this service. If it should be, "
        f"start the service with --allow-name {name}"
    )


def _option_of(host: str) -> str:
    """A host as ``--allow-name`` takes it."""
    return f"[{host}]" if ":" in host else clip(host, 253)


def _foreign(origin: str | None) -> str:
    """The detail of a 403: pages of other sites may not ask, unless they are named."""
    if origin is None:
        return "pages of other sites must not send requests to this service"
    name = _option_of(origin)
    return (
        f"a page of '{name}' must not send requests to this service. If that is a name of the "
        f"service itself, start it with --allow-name {name}; a reverse proxy has to pass on the "
        "Host header"
    )


def _pattern(path: str) -> str:
    """The paths that an endpoint stands for."""
    return "".join(
        "[^/]+" if part.startswith("{") else re.escape(part)
        for part in re.split(r"(\{\w+\})", path)
    )
