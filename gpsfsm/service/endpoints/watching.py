"""``GET /health``, ``/metrics`` and ``/openapi.json``: for those who run the service."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from gpsfsm.service.core import MEDIA
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


async def _openapi(_core: Core, _request: Request) -> Response:
    from starlette.responses import Response

    from gpsfsm.service.registry import document

    return Response(document(), media_type="application/json")


ENDPOINTS = (
    Endpoint(
        method="GET",
        path="/health",
        name="health",
        summary="Tell whether the service can do its work",
        answer=HealthAnswer,
        handle=_health,
        public=True,
        also=((503, "It cannot, or not for long."),),
    ),
    Endpoint(
        method="GET",
        path="/metrics",
        name="metrics",
        summary="Tell what was counted, for Prometheus",
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
