"""The ASGI application: from endpoints to routes, and from exceptions to problem details."""

from __future__ import annotations

import asyncio
import time
from contextlib import asynccontextmanager
from functools import partial
from typing import TYPE_CHECKING

from gpsfsm.errors import GpsfsmError, UsageError
from gpsfsm.service.problems import CONTENT_TYPE, Problem
from gpsfsm.service.registry import all_endpoints

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from starlette.applications import Starlette
    from starlette.requests import Request
    from starlette.responses import Response

    from gpsfsm.service.core import Core
    from gpsfsm.service.registry import Endpoint
    from gpsfsm.service.settings import Settings

__all__ = ["INSTALL", "make_app"]

INSTALL = "the service needs Starlette and uvicorn: pip install 'gpsfsm[serve]'"

_COME_AGAIN_S = 0.5
"""Who is told to come again is told so late: not everybody waits as long as Retry-After says."""

_NO_STORE = {"cache-control": "no-store", "x-content-type-options": "nosniff"}


def make_app(settings: Settings) -> Starlette:
    """The application; it starts its processes when the server says that it begins."""
    try:
        from starlette.applications import Starlette  # noqa: PLC0415  (an extra)
        from starlette.routing import Route  # noqa: PLC0415
    except ImportError as error:
        raise UsageError(f"{INSTALL} ({error})") from error
    from gpsfsm.service.core import Core  # noqa: PLC0415
    from gpsfsm.service.guard import Guard  # noqa: PLC0415

    core = Core(settings)

    @asynccontextmanager
    async def lifespan(_app: Starlette) -> AsyncIterator[None]:
        try:
            await core.start()
        except GpsfsmError as error:
            app.state.failure = error  # Starlette and uvicorn do not pass it on
            raise
        try:
            yield
        finally:
            await core.close()

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
    app.state.core, app.state.failure = core, None
    return app


async def _answer(core: Core, wanted: Endpoint, request: Request) -> Response:
    """Answer a request, whatever happens."""
    began_s = time.monotonic()
    response = await _settled(core, wanted, request)
    response.headers.update(_NO_STORE)
    core.metrics.answered(wanted.name, response.status_code, time.monotonic() - began_s)
    return response


async def _settled(core: Core, wanted: Endpoint, request: Request) -> Response:
    from starlette.requests import ClientDisconnect  # noqa: PLC0415

    try:
        if wanted.work is not None:
            return await _worked(core, wanted, request)
        assert wanted.handle is not None
        return await wanted.handle(core, request)
    except Problem as problem:
        if problem.status == 429:
            await asyncio.sleep(_COME_AGAIN_S)
        return _told(problem, refuses=wanted.refuses)
    except ClientDisconnect:  # nobody will see this
        return _told(Problem(400, "the connection was closed"), refuses=wanted.refuses)
    except Exception as error:
        message = f"the request failed ({type(error).__name__}); this is a defect of gpsfsm"
        return _told(Problem(500, message), refuses=wanted.refuses)


async def _worked(core: Core, wanted: Endpoint, request: Request) -> Response:
    from starlette.responses import Response  # noqa: PLC0415

    from gpsfsm.service.bodies import is_plan  # noqa: PLC0415
    from gpsfsm.service.clients import client_of  # noqa: PLC0415

    raw = is_plan(request, allowed=wanted.takes_plan)
    async with core.body(request) as body:
        client = client_of(request.scope)
        found = await core.pool.do(wanted.name, body, raw=raw, client=client)
    if found.status != 200 and wanted.refuses:
        return _told(_again(found.status, found.body), refuses=True)
    return Response(found.body, status_code=found.status, media_type=found.media)


def _again(status: int, body: bytes) -> Problem:
    """The problem that a worker has told of."""
    import json  # noqa: PLC0415

    found = json.loads(body)
    known = ("type", "title", "status", "detail")
    more = {name: value for name, value in found.items() if name not in known}
    return Problem(status, found["detail"], **more)


def _told(problem: Problem, *, refuses: bool = False) -> Response:
    from starlette.responses import Response  # noqa: PLC0415

    if refuses:  # fail closed: no error can be taken for a verdict
        problem.more |= {"verdict": "refuse", "reason": "inconclusive"}
    return Response(
        problem.body(),
        status_code=problem.status,
        headers=problem.headers,
        media_type=CONTENT_TYPE,
    )


async def _not_there(_request: Request, _error: Exception) -> Response:
    return _told(Problem(404, "there is nothing here; /openapi.json tells what there is"))


async def _not_so(_request: Request, error: Exception) -> Response:
    headers = getattr(error, "headers", None) or {}
    return _told(Problem(405, "not with this method", headers=headers))


async def _broken(_request: Request, error: Exception) -> Response:
    return _told(Problem(500, f"the request failed ({type(error).__name__})"))
