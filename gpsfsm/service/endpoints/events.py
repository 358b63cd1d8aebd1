"""``GET /v1/plans/{plan}/events`` and ``/v1/queue/events``: server-sent events.

They tell what happens to a plan, and what the plan queue decides, so that a client sees the plan
that a model writes arrive behind the one that gave up. Each event has its number in the journal as
id: a client that comes back with ``Last-Event-ID`` misses nothing and sees nothing twice, whatever
has ended meanwhile.
"""

from __future__ import annotations

import json
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING, Any

from gpsfsm.service import run_history
from gpsfsm.service.clients import client_of
from gpsfsm.service.plan_queue import ENDED, answer_of, plan_number, stood
from gpsfsm.service.registry import Endpoint
from gpsfsm.service.shapes import NO_NUMBER, Problem

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from starlette.requests import Request
    from starlette.responses import Response

    from gpsfsm.execution.journal_read import JournalReader
    from gpsfsm.service.core import Core

BEAT_S = 10.0
"""After so long a client hears that the stream is still there."""

RETRY = b"retry: 1000\n\n"
"""After so many milliseconds a client comes back."""

STILL_THERE = b": still there\n\n"

_DIGITS = 15


def last_seen(request: Request, parameter: str = "") -> str:
    """The event behind which a stream goes on, as the client names it; "0": from the beginning.

    It is named by a parameter of the address, where there is one, or by ``Last-Event-ID``.
    """
    named = request.query_params.get(parameter) if parameter else None
    if named is None:
        named = request.headers.get("last-event-id", "0")
    return named.strip() or "0"


def number_of(text: str, what: str) -> int:
    """The number of an event. Raises Problem 422."""
    if text.isascii() and text.isdigit() and len(text) <= _DIGITS:
        return int(text)
    raise Problem(422, f"Last-Event-ID is the number of {what}")


def event(kind: str, data: str, number: int | None = None) -> bytes:
    """An event; with a number a client can come back behind it."""
    identity = "" if number is None else f"id: {number}\n"
    return f"{identity}event: {kind}\ndata: {data}\n\n".encode()


def begun(core: Core, client: str, events: AsyncIterator[bytes]) -> Response:
    """The answer that streams events. Raises Problem 429 if too many clients follow."""
    core.room_for_stream(client)
    from starlette.responses import StreamingResponse

    return StreamingResponse(events, media_type="text/event-stream")


# ---- The events of a plan ------------------------------------------------------------------------


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


# ---- The decisions of the plan queue -------------------------------------------------------------


_DECISIONS_PAGE = 100
_NOW = "now"


async def _decisions(core: Core, request: Request) -> Response:
    _ = core.queue  # raises Problem
    after = last_seen(request, "after")
    if after == _NOW:
        first = await run_history.in_journal(core.settings.journal, run_history.last_decision)
    else:
        first = number_of(after, f"a decision, or '{_NOW}'")
    client = client_of(request.scope)
    return begun(core, client, _decision_stream(core, client, first or 0))


async def _decision_stream(core: Core, client: str, after: int) -> AsyncIterator[bytes]:
    with core.stream(client):
        yield RETRY
        while not core.closing.is_set():
            since = core.queue.moves
            of = partial(run_history.decisions, after=after, most=_DECISIONS_PAGE)
            try:
                decisions = await run_history.in_journal(core.settings.journal, of) or []
            except Problem:  # the client comes back
                return
            for number, text in decisions:
                yield event("decision", text, number)
                after = number
            if len(decisions) < _DECISIONS_PAGE:
                yield STILL_THERE
                await core.wait_for_news(since, BEAT_S)


ENDPOINTS = (
    Endpoint(
        method="GET",
        path="/v1/plans/{plan}/events",
        name="plan_events",
        summary="Stream the events of a plan, from Last-Event-ID on",
        media="text/event-stream",
        handle=_events,
        also=(
            (404, "There is no such plan."),
            (429, "Too many clients follow runs."),
            (501, "There is no plan queue."),
        ),
    ),
    Endpoint(
        method="GET",
        path="/v1/queue/events",
        name="queue_events",
        summary="Stream the decisions of the plan queue, from Last-Event-ID on",
        media="text/event-stream",
        handle=_decisions,
        also=(
            NO_NUMBER,
            (429, "Too many clients follow runs."),
            (501, "There is no plan queue."),
        ),
    ),
)
