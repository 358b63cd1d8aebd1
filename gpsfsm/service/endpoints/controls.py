"""``/v1/plans/{plan}/pause`` and the like: what a client does to a plan while it runs."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from pydantic import Field, model_validator

from gpsfsm.service.plan_answers import (
    PlanAnswer,
    answer_of,
    json_response,
    plan_number,
    read_request,
    stood,
)
from gpsfsm.service.registry import Endpoint
from gpsfsm.service.shapes import Name, Request, Speed

if TYPE_CHECKING:
    from typing import Self

    from starlette.requests import Request as HttpRequest
    from starlette.responses import Response

    from gpsfsm.service.core import Core

_MOST_STEPS = 1_000
_ONCE = ("step", "fail")
"""What must not be done once more if nobody knows whether it was done."""


class PauseRequest(Request):
    """The run stands still: its clock stops, and nothing in it is changed."""


class ResumeRequest(Request):
    """It goes on."""


class StepRequest(Request):
    """So many events happen while the run stands still; if it does not, it does from now on."""

    events: int = Field(default=1, ge=1, le=_MOST_STEPS)


class SpeedRequest(Request):
    """How fast it goes from now on."""

    speed: Speed


class FailRequest(Request):
    """A runner that runs fails now: that at a node of the automaton, or that of an element."""

    node: int | None = Field(default=None, ge=0, lt=1 << 31)
    element: Name | None = Field(default=None, examples=["/Plan/Control[1]/Runner[2]"])
    message: Name = "a client has let it fail"

    @model_validator(mode="after")
    def _one(self) -> Self:
        if (self.node is None) == (self.element is None):
            raise ValueError("name either a node or an element")
        return self


class ControlAnswer(PlanAnswer):
    """``success``: it is done before anything else happens; ``why`` it is not."""

    success: bool
    why: str


async def _control(
    what: str, model: type[Request], core: Core, request: HttpRequest, /
) -> Response:
    queue, plan = core.queue, plan_number(request)
    wanted = await read_request(core, request, model)
    await stood(queue, plan)
    parameters: dict[str, Any] = wanted.model_dump()
    state = await queue.ask("control", once=what in _ONCE, plan=plan, what=what, **parameters)
    answer = answer_of(state).model_dump()
    return json_response(ControlAnswer(**answer, success=state["done"], why=state["why"]))


def _endpoint(what: str, summary: str, model: type[Request]) -> Endpoint:
    return Endpoint(
        method="POST",
        path=f"/v1/plans/{{plan}}/{what}",
        name=f"{what}_plan",
        summary=summary,
        request=model,
        answer=ControlAnswer,
        handle=partial(_control, what, model),
        also=((404, "There is no such plan."), (501, "There is no plan queue.")),
    )


ENDPOINTS = (
    _endpoint("pause", "Let a plan that runs stand still", PauseRequest),
    _endpoint("resume", "Let it go on", ResumeRequest),
    _endpoint("step", "Let it go on by single events", StepRequest),
    _endpoint("speed", "Let it go faster or slower", SpeedRequest),
    _endpoint("fail", "Let one of its runners fail that runs", FailRequest),
)
