"""``GET /livez``, ``/readyz``, ``/health``, ``/metrics``, ``/openapi.json``: for operators.

``/livez`` and ``/readyz`` need no token, so they say nothing but words of a fixed list.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from gpsfsm.service.core import MEDIA, Unready
from gpsfsm.service.entrance import PREFIX
from gpsfsm.service.registry import Endpoint
from gpsfsm.service.shapes import Answer
from gpsfsm.version import VERSION

if TYPE_CHECKING:
    from starlette.requests import Request
    from starlette.responses import Response

    from gpsfsm.service.core import Core


class HealthAnswer(Answer):
    """The health of the service: can it do its work? What there is not is off."""

    status: Literal["ok", "degraded", "stopping"]
    version: str
    workers: int
    gate_workers: int
    queue: Literal["up", "down", "off"]
    stopper: Literal["up", "down", "off"]


class LiveAnswer(Answer):
    """The service answers; nothing is said of what it can do."""

    status: Literal["alive"] = "alive"


class ReadyAnswer(Answer):
    """The readiness of the service for requests; ``reasons`` is why it is not ready."""

    status: Literal["ready", "not ready"]
    reasons: list[Unready]


async def _live(_core: Core, _request: Request) -> Response:
    from starlette.responses import Response

    return Response(LiveAnswer().model_dump_json(), media_type="application/json")


async def _ready(core: Core, _request: Request) -> Response:
    from starlette.responses import Response

    reasons = await core.unready()
    answer = ReadyAnswer(status="not ready" if reasons else "ready", reasons=reasons)
    code = 503 if reasons else 200
    return Response(answer.model_dump_json(), status_code=code, media_type="application/json")


async def _health(core: Core, _request: Request) -> Response:
    from starlette.responses import Response

    queue: Literal["up", "down", "off"] = "off"
    if core.has_queue:
        queue = "up" if core.queue.up else "down"
    stopper: Literal["up", "down", "off"] = "off"
    if core.stopper is not None:
        stopper = "up" if core.stopper.up else "down"
    status: Literal["ok", "degraded", "stopping"] = "ok"
    if not core.pool.well or "down" in (queue, stopper):
        status = "degraded"
    if core.closing.is_set():
        status = "stopping"
    answer = HealthAnswer(
        status=status,
        version=VERSION,
        workers=core.pool.alive,
        gate_workers=core.pool.gates.alive,
        queue=queue,
        stopper=stopper,
    )
    code = 200 if status == "ok" else 503
    return Response(answer.model_dump_json(), status_code=code, media_type="application/json")


async def _metrics(core: Core, _request: Request) -> Response:
    from starlette.responses import Response

    return Response(core.metrics.text(core.gauges()), media_type=MEDIA)


async def _openapi(_core: Core, request: Request) -> Response:
    from starlette.responses import Response

    from gpsfsm.service.registry import document

    return Response(document(request.scope.get(PREFIX, "")), media_type="application/json")


ENDPOINTS = (
    Endpoint(
        method="GET",
        path="/livez",
        name="livez",
        summary="Report that the service answers",
        answer=LiveAnswer,
        handle=_live,
        public=True,
    ),
    Endpoint(
        method="GET",
        path="/readyz",
        name="readyz",
        summary="Report whether requests should be sent here",
        answer=ReadyAnswer,
        handle=_ready,
        public=True,
        also=((503, "Not now; the answer says why."),),
    ),
    Endpoint(
        method="GET",
        path="/health",
        name="health",
        summary="Report the health of the service",
        answer=HealthAnswer,
        handle=_health,
        public=True,
        also=((503, "It cannot, or not for long."),),
    ),
    Endpoint(
        method="GET",
        path="/metrics",
        name="metrics",
        summary="Return metrics for Prometheus",
        media="text/plain",
        handle=_metrics,
    ),
    Endpoint(
        method="GET",
        path="/openapi.json",
        name="openapi",
        summary="This document",
        handle=_openapi,
    ),
)
