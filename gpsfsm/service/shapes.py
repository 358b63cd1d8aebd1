"""Shapes that requests and answers share, and bodies read into them within limits.

The shapes are pydantic models, from which OpenAPI is made.
An error is told as problem details (RFC 9457), always JSON (``Problem``).
"""

from __future__ import annotations

import asyncio
import json
from contextlib import asynccontextmanager
from http import HTTPStatus
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gpsfsm.checking.option_table import BY_KEYWORD, Kind
from gpsfsm.model.printable import clip
from gpsfsm.strict_json import DuplicateKeyError, strict_loads

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Mapping

    from starlette.requests import Request as HttpRequest

    from gpsfsm.service.clients import Share

_MOST_TEXTS = 100
_LONGEST = 10_000

Name = Annotated[str, Field(max_length=500, pattern=r"^[^\x00-\x1f\x7f]*$")]
PlanText = Annotated[str, Field(description="The text of the plan.")]
TaskText = Annotated[
    str,
    Field(max_length=1 << 20, description="The text of a task file that names no other file."),
]
Speed = Annotated[
    float | None,
    Field(
        ge=0,
        le=1e6,
        allow_inf_nan=False,
        description="Seconds of the run per second of real time; null or 0: no waiting.",
    ),
]
Texts = Annotated[list[Annotated[str, Field(max_length=_LONGEST)]], Field(max_length=_MOST_TEXTS)]


class Request(BaseModel):
    """A request of a client; a field that nobody knows is an error, not ignored."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class Answer(BaseModel):
    """An answer of the service."""

    model_config = ConfigDict(frozen=True)


def _wish(keyword: str) -> Any:
    """The default, the bounds and the description of an option, as the table has them."""
    option = BY_KEYWORD[keyword]
    assert option.service is not None
    bounds: dict[str, Any] = {}
    if option.kind is Kind.COUNT:
        bounds = {"ge": option.least, "le": option.service.most}
    elif option.kind is Kind.AMOUNT:
        bounds = {"gt": option.above, "allow_inf_nan": False}
    elif option.service.most is not None:
        bounds = {"max_length": option.service.most}
    if option.service.description:
        bounds["description"] = option.service.description
    default: Any = None if option.service.undefined else option.initial
    return Field(default=list(default) if option.kind.is_list else default, **bounds)


class Wishes(Request):
    """Options of a check; those of ``gpsfsm check``."""

    select: Texts = _wish("select")
    ignore: Texts = _wish("ignore")
    assume: Texts = _wish("assume")
    consistent: bool = _wish("consistent")
    faults: list[Literal["failed", "no-start", "hang"]] = _wish("faults")
    from_response: bool = _wish("from_response")
    engine: Name = _wish("engine")
    solver: Literal["auto", "z3", "structural"] = _wish("solver")
    rlimit: int = _wish("rlimit")
    total_rlimit: int | None = _wish("total_rlimit")
    max_scenarios: int = _wish("max_scenarios")
    require_proof: bool = _wish("require_proof")
    deadline_s: float | None = _wish("deadline_s")
    energy_limit_j: float | None = _wish("energy_limit_j")
    tolerate: int = _wish("tolerate")


class Place(Answer):
    """A place in a plan; ``column`` counts code points, both begin at 1."""

    line: int
    column: int
    element: str


class ShownFinding(Answer):
    """A finding, as far as a program needs it to act; ``/v1/check`` tells all."""

    rule: str
    name: str
    severity: Literal["error", "warning", "info"]
    message: str
    hint: str
    location: Place


class ProblemDetails(Answer):
    """An error (RFC 9457). Of ``/v1/gate`` it also has ``verdict`` and ``reason``."""

    type: str
    title: str
    status: int
    detail: str
    errors: list[dict[str, Any]] | None = Field(default=None, description="What is wrong where.")


CONTENT_TYPE = "application/problem+json"


class Problem(Exception):  # noqa: N818  (that is what RFC 9457 calls it)
    """An answer that is an error. ``more`` are further members of its body."""

    def __init__(
        self,
        status: int,
        detail: str,
        *,
        retry_s: int | None = None,
        headers: Mapping[str, str] | None = None,
        **more: Any,
    ) -> None:
        super().__init__(detail)
        self.status = status
        self.detail = detail
        self.more = more
        self.headers = dict(headers or {})
        if retry_s is not None:
            self.headers["retry-after"] = str(retry_s)

    def body(self) -> bytes:
        """The body of the answer."""
        return problem_body(self.status, self.detail, **self.more)


def problem_body(status: int, detail: str, **more: Any) -> bytes:
    """Problem details as JSON; they are about nothing but the status, so the type is blank."""
    title = HTTPStatus(status).phrase
    body = {"type": "about:blank", "title": title, "status": status, "detail": detail, **more}
    return json.dumps(body).encode()


# ---- Bodies of requests, read within limits, and numbers -----------------------------------------


_Model = TypeVar("_Model", bound=BaseModel)
_MOST_ERRORS = 10
_JSON, _XML = ("application/json",), ("application/xml", "text/xml")


def announced(request: HttpRequest, most: int) -> int:
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
    request: HttpRequest, *, most: int, within_s: float, budget: Share, client: str
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
    request: HttpRequest, most: int, budget: Share, client: str, parts: list[bytes]
) -> None:
    """Read it; what is in ``parts`` is counted in the budget."""
    length = 0
    async for part in request.stream():
        length += len(part)
        if length > most:
            raise _too_long(most)
        if not budget.take(client, len(part)):
            close = {"connection": "close"}
            message = "too many bytes are being sent at the same time; try again"
            raise Problem(429, message, retry_s=1, headers=close)
        parts.append(part)


def _too_long(most: int) -> Problem:
    close = {"connection": "close"}  # or the rest of it would have to be read
    message = f"the body has more than {most:,} bytes; --max-body of the service sets this limit"
    return Problem(413, message, headers=close)


def is_plan(request: HttpRequest, *, allowed: bool) -> bool:
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

NO_NUMBER = (422, "A number was expected.")


def whole_number(
    request: HttpRequest, name: str, default: int, *, least: int = 0, most: int = MOST
) -> int:
    """The number that a name stands for. Raises Problem 422."""
    text = request.query_params.get(name)
    if text is None:
        return default
    if text.isascii() and text.isdigit() and len(text) <= len(str(MOST)):
        number = int(text)
        if least <= number <= most:
            return number
    raise Problem(422, f"{name} must be a number from {least} to {most}")
