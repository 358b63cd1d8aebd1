"""``GET /v1/queue/events``: what the plan queue decides, as server-sent events.

So a client sees the plan that a model writes arrive behind the one that gave up. Each decision has
its number in the journal as id: who comes back with ``Last-Event-ID`` misses nothing.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from gpsfsm.service import past
from gpsfsm.service.asked_for import NO_NUMBER
from gpsfsm.service.problems import Problem
from gpsfsm.service.registry import Endpoint

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from starlette.requests import Request
    from starlette.responses import Response

    from gpsfsm.service.core import Core

__all__ = ["ENDPOINTS"]

_PAGE = 100
_BEAT_S = 10.0
_NEXT_MS = 1_000
_NOW = "now"


async def _decisions(core: Core, request: Request) -> Response:
    _ = core.queue  # raises Problem
    said = request.query_params.get("after")
    after = (request.headers.get("last-event-id", "0") if said is None else said).strip() or "0"
    if after != _NOW and (not (after.isascii() and after.isdigit()) or len(after) > 15):
        raise Problem(422, "Last-Event-ID is the number of a decision, or 'now'")
    if core.streams >= core.settings.streams:
        raise Problem(429, "too many clients follow runs; try again", retry_s=10)
    journal = core.settings.journal
    first = int(after) if after != _NOW else await past.in_journal(journal, past.last_decision)
    from starlette.responses import StreamingResponse  # noqa: PLC0415

    return StreamingResponse(_stream(core, first or 0), media_type="text/event-stream")


async def _stream(core: Core, after: int) -> AsyncIterator[bytes]:
    with core.stream():
        yield f"retry: {_NEXT_MS}\n\n".encode()
        while not core.closing.is_set():
            since = core.queue.moves
            of = partial(past.decisions, after=after, most=_PAGE)
            try:
                found = await past.in_journal(core.settings.journal, of) or []
            except Problem:  # the client comes back
                return
            for number, text in found:
                yield f"id: {number}\nevent: decision\ndata: {text}\n\n".encode()
                after = number
            if len(found) < _PAGE:
                yield b": still there\n\n"
                await core.wait_for_news(since, _BEAT_S)


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
