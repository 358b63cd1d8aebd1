"""Streams of server-sent events: where they begin, how events are written, how they are answered.

https://html.spec.whatwg.org/multipage/server-sent-events.html
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.service.shapes import Problem

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from starlette.requests import Request
    from starlette.responses import Response

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
