"""``GET /v1/queue/events``: what the plan queue decides, as server-sent events.

So a client sees the plan that a model writes arrive behind the one that gave up. Each decision has
its number in the journal as id: who comes back with ``Last-Event-ID`` misses nothing.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from gpsfsm.service import run_history
from gpsfsm.service.clients import client_of
from gpsfsm.service.event_streams import (
    BEAT_S,
    RETRY,
    STILL_THERE,
    begun,
    event,
    last_seen,
    number_of,
)
from gpsfsm.service.registry import Endpoint
from gpsfsm.service.request_parts import NO_NUMBER
from gpsfsm.service.shapes import Problem

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from starlette.requests import Request
    from starlette.responses import Response

    from gpsfsm.service.core import Core

_PAGE = 100
_NOW = "now"


async def _decisions(core: Core, request: Request) -> Response:
    _ = core.queue  # raises Problem
    after = last_seen(request, "after")
    if after == _NOW:
        first = await run_history.in_journal(core.settings.journal, run_history.last_decision)
    else:
        first = number_of(after, f"a decision, or '{_NOW}'")
    client = client_of(request.scope)
    return begun(core, client, _stream(core, client, first or 0))


async def _stream(core: Core, client: str, after: int) -> AsyncIterator[bytes]:
    with core.stream(client):
        yield RETRY
        while not core.closing.is_set():
            since = core.queue.moves
            of = partial(run_history.decisions, after=after, most=_PAGE)
            try:
                decisions = await run_history.in_journal(core.settings.journal, of) or []
            except Problem:  # the client comes back
                return
            for number, text in decisions:
                yield event("decision", text, number)
                after = number
            if len(decisions) < _PAGE:
                yield STILL_THERE
                await core.wait_for_news(since, BEAT_S)


ENDPOINTS = (
    Endpoint(
        method="GET",
        path="/v1/queue/events",
        name="queue_events",
        summary="Follow what the plan queue decides: server-sent events, from Last-Event-ID on",
        media="text/event-stream",
        handle=_decisions,
        also=(
            NO_NUMBER,
            (429, "Too many clients follow runs."),
            (501, "There is no plan queue."),
        ),
    ),
)
