"""``GET /v1/service`` and ``/v1/worlds``: what a page has to know before it begins."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.model.engine_names import ENGINES
from gpsfsm.service.plan_answers import json_response
from gpsfsm.service.registry import Endpoint
from gpsfsm.service.shapes import Answer, Problem
from gpsfsm.version import VERSION

if TYPE_CHECKING:
    from starlette.requests import Request
    from starlette.responses import Response

    from gpsfsm.service.core import Core

_SPEED = 1.0


class WorldChoice(Answer):
    """A world in which a plan can begin; without ``simulated`` its outcomes are drawn."""

    world: str
    title: str
    simulated: bool
    default: bool


class ServiceAnswer(Answer):
    """What the service can do. ``speed`` is how fast a page should let plans run."""

    version: str
    queue: bool
    model: str
    generates: bool
    regenerates: bool
    worlds: list[WorldChoice]
    speed: float
    engines: list[str]


class WorldOutline(Answer):
    """What a map of a world shows: lengths in metres, angles in radians, times in seconds.

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
        path="/v1/service",
        name="service",
        summary="Tell what the service can do",
        answer=ServiceAnswer,
        handle=_service,
        also=((503, "The plan queue does not answer."),),
    ),
    Endpoint(
        method="GET",
        path="/v1/worlds/{world}",
        name="world",
        summary="Tell what a map of a world shows",
        answer=WorldOutline,
        handle=_world,
        also=((404, "There is no such world."), _OFF),
    ),
)
