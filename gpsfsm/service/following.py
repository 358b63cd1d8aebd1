"""What the streams of server-sent events share: where they begin, how they are answered.

https://html.spec.whatwg.org/multipage/server-sent-events.html
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.service.problems import Problem

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from starlette.requests import Request
    from starlette.responses import Response

    from gpsfsm.service.core import Core

__all__ = ["BEAT_S", "RETRY", "begun", "last_seen", "number_of"]

BEAT_S = 10.0
"""After so long a client hears that the stream is still there."""

RETRY = b"retry: 1000\n\n"
"""After so many milliseconds a client comes back."""

_DIGITS = 15


def last_seen(request: Request) -> str:
    """``Last-Event-ID``, or 0."""
    return request.headers.get("last-event-id", "0").strip() or "0"


def begun(core: Core, client: str, events: AsyncIterator[bytes]) -> Response:
    """The answer that streams events. Raises Problem 429 if too many clients follow."""
    core.room_for_stream(client)
    from starlette.responses import StreamingResponse  # noqa: PLC0415

    return StreamingResponse(events, media_type="text/event-stream")


def number_of(text: str, what: str) -> int:
    """The number of an event. Raises Problem 422."""
    if text.isascii() and text.isdigit() and len(text) <= _DIGITS:
        return int(text)
    raise Problem(422, f"Last-Event-ID is the number of {what}")
