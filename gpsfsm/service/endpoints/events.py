"""``GET /v1/plans/{plan}/events``: what happens to a plan, as server-sent events.

Each event of its run has its number in the journal as id, so a client that comes back with
``Last-Event-ID`` misses nothing and sees nothing twice, whatever has ended meanwhile.
"""

from __future__ import annotations

import json
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING, Any

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
from gpsfsm.service.plan_answers import ENDED, answer_of, plan_number, stood
from gpsfsm.service.registry import Endpoint
from gpsfsm.service.shapes import Problem

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from starlette.requests import Request
    from starlette.responses import Response

    from gpsfsm.execution.journal_read import JournalReader
    from gpsfsm.service.core import Core

_PAGE = 500


def _lines(reader: JournalReader, run: int, after: int) -> list[tuple[int, str]]:
    """The next events of a run, with their numbers."""
    from gpsfsm.execution.journal_rows import line

    rows = islice(reader.events(run, after=after), _PAGE)
    return [(row.seq, line(row, wall_clock=True)) for row in rows]


async def _events(core: Core, request: Request) -> Response:
    queue, plan = core.queue, plan_number(request)
    after = number_of(last_seen(request), "an event")
    await stood(queue, plan)
    client = client_of(request.scope)
    return begun(core, client, _stream(core, client, plan, after))


async def _stream(core: Core, client: str, plan: int, after: int) -> AsyncIterator[bytes]:
    with core.stream(client):
        yield RETRY
        shown: dict[str, Any] = {}
        while not core.closing.is_set():
            since = core.queue.moves
            lines: list[tuple[int, str]] = []
            try:
                state = await stood(core.queue, plan)
                if state["run"] is not None:
                    of = partial(_lines, run=state["run"], after=after)
                    lines = await run_history.in_journal(core.settings.journal, of) or []
            except Problem:  # the queue is started again, or the journal cannot be read now
                return
            for number, text in lines:
                yield event("record", text, number)
                after = number
            if len(lines) == _PAGE:
                continue
            answer = answer_of(state).model_dump()
            ended = state["status"] in ENDED
            if answer != shown or ended:
                shown = answer
                yield event("end" if ended else "status", json.dumps(answer))
            if ended:
                return
            if not lines:
                yield STILL_THERE
            await core.wait_for_news(since, BEAT_S)


ENDPOINTS = (
    Endpoint(
        method="GET",
        path="/v1/plans/{plan}/events",
        name="plan_events",
        summary="Follow a plan: server-sent events, from Last-Event-ID on",
        media="text/event-stream",
        handle=_events,
        also=(
            (404, "There is no such plan."),
            (429, "Too many clients follow runs."),
            (501, "There is no plan queue."),
        ),
    ),
)
