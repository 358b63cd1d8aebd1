"""Shapes that requests and answers share (pydantic models, from which OpenAPI is made)."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from gpsfsm.analysis.options import DEFAULT_MAX_SCENARIOS, DEFAULT_RLIMIT, DEFAULT_TOTAL_RLIMIT
from gpsfsm.model.engine import PAPER_ENGINE

__all__ = ["Answer", "Name", "Place", "PlanText", "ProblemDetails", "Request", "ShownFinding"]
__all__ += ["Speed", "TaskText", "Texts", "Wishes"]

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


class Wishes(Request):
    """How a plan is checked; the options of ``gpsfsm check``."""

    select: Texts = Field(default=[], description="Show only these rules.")
    ignore: Texts = Field(default=[], description="Do not show these rules.")
    assume: Texts = Field(default=[], description="Consider only runs where this holds.")
    consistent: bool = Field(default=False, description="Equal actions have equal outcomes.")
    faults: list[Literal["failed", "no-start", "hang"]] = Field(default=[], max_length=3)
    from_response: bool = Field(default=False, description="The text is a raw answer of a model.")
    engine: Name = Field(default=PAPER_ENGINE, description="The engine that is to run the plan.")
    solver: Literal["auto", "z3", "structural"] = "auto"
    rlimit: int = Field(default=DEFAULT_RLIMIT, ge=1, le=DEFAULT_RLIMIT)
    total_rlimit: int | None = Field(
        default=None,
        ge=1,
        le=DEFAULT_TOTAL_RLIMIT,
        description="Steps of z3 for the whole plan; null: as many as the command takes.",
    )
    max_scenarios: int = Field(default=DEFAULT_MAX_SCENARIOS, ge=0, le=DEFAULT_MAX_SCENARIOS)
    deadline_s: float | None = Field(default=None, gt=0, allow_inf_nan=False)
    energy_limit_j: float | None = Field(default=None, gt=0, allow_inf_nan=False)


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
