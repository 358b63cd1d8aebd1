"""``GET /``, ``/v1/service`` and ``/v1/worlds``: the live page, and what it has to know to begin.

The files of the page hold no data, so no token is asked for. What a browser may do with them is
said by the policy that comes along: nothing but talk to this service.
"""

from __future__ import annotations

import asyncio
import re
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from gpsfsm.model.story import ENGINES
from gpsfsm.service.plan_queue import json_response
from gpsfsm.service.registry import Endpoint
from gpsfsm.service.shapes import Answer, Problem
from gpsfsm.version import VERSION

if TYPE_CHECKING:
    from importlib.resources.abc import Traversable

    from starlette.requests import Request
    from starlette.responses import Response

    from gpsfsm.service.core import Core

_PAGE = "live.html"
_NAME = re.compile(r"[a-z][a-z0-9_.-]*")
_TYPES = {
    "js": "text/javascript; charset=utf-8",
    "css": "text/css; charset=utf-8",
    "svg": "image/svg+xml",
    "png": "image/png",
}
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src 'self' data: blob:; font-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)
_HEADERS = {
    "content-security-policy": _POLICY,
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "referrer-policy": "no-referrer",
    "x-frame-options": "DENY",
}


def _files() -> dict[str, Traversable]:
    """The files that may be requested, by name: a name that is not among them leads nowhere."""
    return {
        file.name: file
        for file in files("gpsfsm.viewing").joinpath("web").iterdir()
        if _NAME.fullmatch(file.name) and file.is_file()
    }


async def _to_response(name: str, media: str) -> Response:
    from starlette.responses import Response

    file = await asyncio.to_thread(lambda: _files().get(name))
    if file is None:
        raise Problem(404, "there is no such file")
    content = await asyncio.to_thread(file.read_bytes)
    return Response(content, media_type=media, headers=_HEADERS)


async def _page(_core: Core, _request: Request) -> Response:
    return await _to_response(_PAGE, "text/html; charset=utf-8")


async def _file(_core: Core, request: Request) -> Response:
    name: str = request.path_params["file"]
    media = _TYPES.get(name.rpartition(".")[2])
    if media is None:
        raise Problem(404, "there is no such file")
    return await _to_response(name, media)


_NONE = (404, "There is no such file.")


# ---- The service as a page sees it ---------------------------------------------------------------


_SPEED = 1.0


class WorldChoice(Answer):
    """A world in which a plan can begin; without ``simulated`` its outcomes are drawn."""

    world: str
    title: str
    simulated: bool
    default: bool


class ServiceAnswer(Answer):
    """The abilities of the service. ``speed`` is how fast a page should let plans run.

    ``real``: they are run by real runners.
    """

    version: str
    queue: bool
    real: bool
    model: str
    generates: bool
    regenerates: bool
    worlds: list[WorldChoice]
    speed: float
    engines: list[str]


class WorldOutline(Answer):
    """The outline of a world on a map: lengths in metres, angles in radians, times in seconds.

    ``until_s`` is null for what never ends.
    """

    world: str
    title: str
    area: list[float]
    resolution: float
    robot: dict[str, float]
    obstacles: list[dict[str, Any]]
    zones: list[dict[str, Any]]
    changes: list[dict[str, Any]]
    places: list[dict[str, Any]]
    people: list[dict[str, Any]]
    things: list[dict[str, Any]]
    sounds: list[dict[str, Any]]


async def _service(core: Core, _request: Request) -> Response:
    options = core.settings.runs.get("options", {})
    worlds = (await core.queue.ask("worlds"))["worlds"] if core.has_queue else []
    answer = ServiceAnswer(
        version=VERSION,
        queue=core.has_queue,
        real=core.settings.real,
        model=str(options.get("model", "")),
        generates=bool(core.settings.generator),
        regenerates="regenerations" in options,
        worlds=[WorldChoice(**each) for each in worlds],
        speed=core.settings.runs.get("speed") or _SPEED,
        engines=list(ENGINES),
    )
    return json_response(answer)


async def _world(core: Core, request: Request) -> Response:
    queue, name = core.queue, request.path_params["world"]
    if len(name) > 100:
        raise Problem(404, "there is no such world")
    answer = await queue.ask("world", world=name)
    return json_response(WorldOutline(**answer["outline"]))


_OFF = (501, "There is no plan queue.")


ENDPOINTS = (
    Endpoint(
        method="GET",
        path="/",
        name="page",
        summary="The live page",
        media="text/html",
        handle=_page,
        public=True,
        also=(_NONE,),
    ),
    Endpoint(
        method="GET",
        path="/ui/{file}",
        name="page_file",
        summary="A file of the live page",
        media="text/javascript",
        handle=_file,
        public=True,
        also=(_NONE,),
    ),
    Endpoint(
        method="GET",
        path="/v1/service",
        name="service",
        summary="List the features of the service",
        answer=ServiceAnswer,
        handle=_service,
        also=((503, "The plan queue does not answer."),),
    ),
    Endpoint(
        method="GET",
        path="/v1/worlds/{world}",
        name="world",
        summary="Return the map of a world",
        answer=WorldOutline,
        handle=_world,
        also=((404, "There is no such world."), _OFF),
    ),
)
