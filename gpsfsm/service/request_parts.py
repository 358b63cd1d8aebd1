"""Parts of requests: bodies, read within limits and made into what they mean; numbers."""

from __future__ import annotations

import asyncio
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING, TypeVar

from pydantic import BaseModel, ValidationError

from gpsfsm.model.printable import clip
from gpsfsm.service.shapes import Problem
from gpsfsm.strict_json import DuplicateKeyError, strict_loads

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from starlette.requests import Request

    from gpsfsm.service.shares import Share

_Model = TypeVar("_Model", bound=BaseModel)
_MOST_ERRORS = 10
_JSON, _XML = ("application/json",), ("application/xml", "text/xml")


def announced(request: Request, most: int) -> int:
    """The announced length of the body, 0 for one of which nobody has said anything.

    Raises Problem, before anything of it is read.
    """
    text = request.headers.get("content-length")
    if text is None:
        return 0
    if not (text.isascii() and text.isdigit()) or len(text) > 15:
        raise Problem(400, "Content-Length is not a number")
    if int(text) > most:
        raise _too_long(most)
    return int(text)


@asynccontextmanager
async def whole_body(
    request: Request, *, most: int, within_s: float, budget: Share, client: str
) -> AsyncIterator[bytes]:
    """The body of a request. Raises Problem if it is too long or comes too slowly.

    It is counted in the budget, in which each client has its share.
    """
    announced(request, most)
    parts: list[bytes] = []
    try:
        try:
            async with asyncio.timeout(within_s):
                await _read(request, most, budget, client, parts)
        except TimeoutError:
            close = {"connection": "close"}
            message = f"the body did not arrive within {within_s:g} s"
            raise Problem(408, message, headers=close) from None
        yield b"".join(parts)
    finally:
        budget.give_back(client, sum(map(len, parts)))


async def _read(
    request: Request, most: int, budget: Share, client: str, parts: list[bytes]
) -> None:
    """Read it; what is in ``parts`` is counted in the budget."""
    length = 0
    async for part in request.stream():
        length += len(part)
        if length > most:
            raise _too_long(most)
        if not budget.take(client, len(part)):
            close = {"connection": "close"}
            message = "too much is being sent at once; try again"
            raise Problem(429, message, retry_s=1, headers=close)
        parts.append(part)


def _too_long(most: int) -> Problem:
    close = {"connection": "close"}  # or the rest of it would have to be read
    return Problem(413, f"the body has more than {most:,} bytes", headers=close)


def is_plan(request: Request, *, allowed: bool) -> bool:
    """True if the body is a plan alone, not JSON. Raises Problem 415 for any other media type.

    Never text/plain or a form: those a page in a browser may send without asking.
    """
    media = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if media in _JSON:
        return False
    if allowed and media in _XML:
        return True
    possible = " or ".join((*_JSON, *_XML[: 1 if allowed else 0]))
    raise Problem(415, f"the Content-Type must be {possible}, not '{clip(media, 60)}'")


def parsed(model: type[_Model], body: bytes) -> _Model:
    """A request of this shape. Raises Problem 422 that says what is wrong where."""
    try:
        strict_loads(body)
    except DuplicateKeyError as error:
        raise Problem(422, str(error), errors=[{"where": "", "what": str(error)}]) from None
    except (ValueError, RecursionError):
        pass  # the model says what is wrong with it
    try:
        return model.model_validate_json(body)
    except ValidationError as error:
        errors = [
            {
                "where": "/".join(clip(str(part), 60) for part in each["loc"]),
                "what": clip(each["msg"], 200),
            }
            for each in error.errors(include_url=False, include_input=False, include_context=False)
        ]
        first = errors[0]
        message = f"{first['where']}: {first['what']}" if first["where"] else first["what"]
        more = len(errors) - 1
        message += f" (and {more} more)" if more else ""
        raise Problem(422, message, errors=errors[:_MOST_ERRORS]) from None


MOST = (1 << 53) - 1
"""Where JSON numbers cease to be exact."""

NO_NUMBER = (422, "There is something else where a number was expected.")


def whole_number(
    request: Request, name: str, default: int, *, least: int = 0, most: int = MOST
) -> int:
    """The number that a name stands for. Raises Problem 422."""
    text = request.query_params.get(name)
    if text is None:
        return default
    if text.isascii() and text.isdigit() and len(text) <= len(str(MOST)):
        number = int(text)
        if least <= number <= most:
            return number
    raise Problem(422, f"{name} is a number from {least} to {most}")
