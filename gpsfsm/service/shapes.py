"""Shapes that requests and answers share: pydantic models, from which OpenAPI is made.

An error is told as problem details (RFC 9457), always JSON (``Problem``).
"""

from __future__ import annotations

import json
from http import HTTPStatus
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from gpsfsm.checking.option_table import BY_KEYWORD, Kind

if TYPE_CHECKING:
    from collections.abc import Mapping

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
        description="So many seconds of a run pass in a second; null or 0: no waiting.",
    ),
]
Texts = Annotated[list[Annotated[str, Field(max_length=_LONGEST)]], Field(max_length=_MOST_TEXTS)]


class Request(BaseModel):
    """What a client asks for; a field that nobody knows is an error, not ignored."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class Answer(BaseModel):
    """What the service answers."""

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
    """How a plan is checked; the options of ``gpsfsm check``."""

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
    deadline_s: float | None = _wish("deadline_s")
    energy_limit_j: float | None = _wish("energy_limit_j")


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
