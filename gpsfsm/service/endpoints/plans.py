"""``/v1/plans``: the plan queue, with the services of the original server.

Set a plan, cancel it, ask how it stands, wait for its completion; pause it, go on, take steps and
let runners fail while it runs (``/v1/plans/{plan}/pause`` and the like).
"""

from __future__ import annotations

import asyncio
import secrets
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field, model_validator

from gpsfsm.service.clients import client_of
from gpsfsm.service.plan_queue import (
    ENDED,
    Key,
    PlanAnswer,
    answer_of,
    json_response,
    plan_number,
    read_request,
    set_plan,
    stood,
)
from gpsfsm.service.registry import Endpoint, Query
from gpsfsm.service.shapes import NO_NUMBER, Answer, Name, PlanText, Request, Speed, whole_number

if TYPE_CHECKING:
    from typing import Self

    from starlette.requests import Request as HttpRequest
    from starlette.responses import Response

    from gpsfsm.service.core import Core

_LONGEST_WAIT_S = 60.0
_MOST = 100


class StartRequest(Request):
    """The beginning of a plan. A field that is left out is as for all plans of the service."""

    speed: Speed = None
    paused: bool = Field(default=False, description="It is paused as soon as it has begun.")
    world: Annotated[
        str,
        Field(
            pattern=r"^[^\x00-\x1f\x7f]{1,100}$",
            description="It begins in a fresh world of this name; /v1/service lists them.",
        ),
    ] = Field(default="")
    seed: int = Field(default=0, ge=0, lt=1 << 53)

    def sent(self) -> dict[str, Any]:
        """The fields that the client has sent, and no others."""
        fields: dict[str, Any] = self.model_dump(include=self.model_fields_set)
        return {**fields, "speed": fields["speed"] or 0.0} if "speed" in fields else fields


class SetPlanRequest(Request):
    """A plan to run."""

    plan: PlanText
    name: Name = "plan.xml"
    request_id: Key | None = None
    start: StartRequest | None = None


class CancelRequest(Request):
    """The reason why a plan is cancelled."""

    reason: Name = "cancelled by a client"


class CancelAnswer(PlanAnswer):
    """``success``: it had not ended, and is being cancelled."""

    success: bool


class CompletionRequest(Request):
    """The time to wait until the plan has ended."""

    wait_s: float = Field(default=0.0, ge=0, le=_LONGEST_WAIT_S)


class CompletionAnswer(PlanAnswer):
    """``ended``: nothing more happens; ``completed``: and all was done."""

    ended: bool
    completed: bool


class PlansAnswer(Answer):
    """Plans in the order in which they were set; ``next`` is the ``after`` of the next page."""

    plans: list[PlanAnswer]
    total: int
    next: int | None


async def _set(core: Core, request: HttpRequest) -> Response:
    queue = core.queue
    wanted: SetPlanRequest = await read_request(core, request, SetPlanRequest)
    key = wanted.request_id or secrets.token_hex(16)
    start = {} if wanted.start is None else wanted.start.sent()
    client = client_of(request.scope)
    state = await set_plan(
        core, queue, wanted.plan, name=wanted.name, key=key, client=client, start=start
    )
    return json_response(answer_of(state))


async def _list(core: Core, request: HttpRequest) -> Response:
    queue, after = core.queue, whole_number(request, "after", 0)
    page = await queue.ask("list", after=after, most=_MOST)
    plans = [answer_of(each) for each in page["plans"]]
    last = after + len(plans)
    more = last if plans and last < page["total"] else None
    return json_response(PlansAnswer(plans=plans, total=page["total"], next=more))


async def _status(core: Core, request: HttpRequest) -> Response:
    return json_response(answer_of(await stood(core.queue, plan_number(request))))


async def _cancel(core: Core, request: HttpRequest) -> Response:
    queue, plan = core.queue, plan_number(request)
    wanted: CancelRequest = await read_request(core, request, CancelRequest)
    await stood(queue, plan)
    state = await queue.ask("cancel", plan=plan, reason=wanted.reason)
    return json_response(CancelAnswer(**answer_of(state).model_dump(), success=state["done"]))


async def _completion(core: Core, request: HttpRequest) -> Response:
    queue, plan = core.queue, plan_number(request)
    wanted: CompletionRequest = await read_request(core, request, CompletionRequest)
    loop = asyncio.get_running_loop()
    until = loop.time() + wanted.wait_s
    state = await stood(queue, plan)
    if state["status"] not in ENDED and wanted.wait_s:
        with core.stream(client_of(request.scope)):
            while state["status"] not in ENDED and not core.closing.is_set():
                since, left_s = queue.moves, until - loop.time()
                state = await stood(queue, plan)
                if left_s <= 0 or state["status"] in ENDED:
                    break
                await core.wait_for_news(since, left_s)
    ended, completed = state["status"] in ENDED, state["status"] == "COMPLETED"
    answer = answer_of(state).model_dump()
    return json_response(CompletionAnswer(**answer, ended=ended, completed=completed))


_NONE = (404, "There is no such plan.")
_OFF = (501, "There is no plan queue.")


# ---- Changes to a plan while it runs -------------------------------------------------------------


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
    """The speed from now on."""

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
    Endpoint(
        method="POST",
        path="/v1/plans",
        name="set_plan",
        summary="Queue a plan that passes the gate",
        request=SetPlanRequest,
        answer=PlanAnswer,
        handle=_set,
        also=(
            _OFF,
            (409, "This request_id belongs to another plan."),
            (507, "The journal cannot take more plans."),
        ),
    ),
    Endpoint(
        method="GET",
        path="/v1/plans",
        name="list_plans",
        summary="List the plans of the queue after the plan 'after'",
        answer=PlansAnswer,
        handle=_list,
        query=(Query("after", "The number of a plan; those after it are listed."),),
        also=(_OFF, NO_NUMBER),
    ),
    Endpoint(
        method="GET",
        path="/v1/plans/{plan}",
        name="get_plan_status",
        summary="Return the status of a plan",
        answer=PlanAnswer,
        handle=_status,
        also=(_NONE, _OFF),
    ),
    Endpoint(
        method="POST",
        path="/v1/plans/{plan}/cancel",
        name="cancel_plan",
        summary="Cancel a waiting or running plan",
        request=CancelRequest,
        answer=CancelAnswer,
        handle=_cancel,
        also=(_NONE, _OFF),
    ),
    Endpoint(
        method="POST",
        path="/v1/plans/{plan}/completion",
        name="completion",
        summary="Report whether a plan has completed, and wait for it",
        request=CompletionRequest,
        answer=CompletionAnswer,
        handle=_completion,
        also=(_NONE, _OFF),
    ),
    _endpoint("pause", "Pause a running plan", PauseRequest),
    _endpoint("resume", "Resume a paused plan", ResumeRequest),
    _endpoint("step", "Step a paused plan by single events", StepRequest),
    _endpoint("speed", "Change the speed of a plan", SpeedRequest),
    _endpoint("fail", "Make an active runner of a plan fail", FailRequest),
)
