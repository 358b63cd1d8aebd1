"""``/v1/plans``: the plan queue, with the services of the original server.

Set a plan, cancel it, ask how it stands, wait for its completion.
"""

from __future__ import annotations

import asyncio
import secrets
from typing import TYPE_CHECKING, Any

from pydantic import Field

from gpsfsm.service.bodies import parsed, whole_body
from gpsfsm.service.problems import Problem
from gpsfsm.service.queued import Key, PlanAnswer, answer_of, plan_number, set_plan, stood
from gpsfsm.service.registry import Endpoint
from gpsfsm.service.shapes import Answer, Name, PlanText, Request
from gpsfsm.service.status import ENDED

if TYPE_CHECKING:
    from pydantic import BaseModel
    from starlette.requests import Request as HttpRequest
    from starlette.responses import Response

    from gpsfsm.service.core import Core

__all__ = ["ENDPOINTS"]

_LONGEST_WAIT_S = 60.0
_MOST = 100


class SetPlanRequest(Request):
    """A plan to run."""

    plan: PlanText
    name: Name = "plan.xml"
    request_id: Key | None = None


class CancelRequest(Request):
    """Why a plan is cancelled."""

    reason: Name = "cancelled by a client"


class CancelAnswer(PlanAnswer):
    """``success``: it had not ended, and is being cancelled."""

    success: bool


class CompletionRequest(Request):
    """How long to wait until the plan has ended."""

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


async def _body(core: Core, request: HttpRequest, model: type[BaseModel]) -> Any:
    """What the body of a request means; an empty one means the defaults."""
    from gpsfsm.service.bodies import is_plan  # noqa: PLC0415

    settings = core.settings
    if core.closing.is_set():
        raise Problem(503, "the service is about to stop", retry_s=5)
    async with whole_body(
        request, most=settings.max_body, within_s=settings.body_s, budget=core.budget
    ) as body:
        if not body and not any(field.is_required() for field in model.model_fields.values()):
            return model()
        is_plan(request, allowed=False)
        return parsed(model, body)


def _answer(answer: BaseModel) -> Response:
    from starlette.responses import Response  # noqa: PLC0415

    return Response(answer.model_dump_json(), media_type="application/json")


async def _set(core: Core, request: HttpRequest) -> Response:
    queue = core.queue
    wanted: SetPlanRequest = await _body(core, request, SetPlanRequest)
    key = wanted.request_id or secrets.token_hex(16)
    found = await set_plan(core, queue, wanted.plan, name=wanted.name, key=key)
    return _answer(answer_of(found))


async def _list(core: Core, request: HttpRequest) -> Response:
    queue = core.queue
    after = request.query_params.get("after", "0")
    if not (after.isascii() and after.isdigit()) or len(after) > 9:
        raise Problem(422, "after is the number of a plan")
    found = await queue.ask("list", after=int(after), most=_MOST)
    plans = [answer_of(each) for each in found["plans"]]
    last = int(after) + len(plans)
    more = last if plans and last < found["total"] else None
    return _answer(PlansAnswer(plans=plans, total=found["total"], next=more))


async def _status(core: Core, request: HttpRequest) -> Response:
    return _answer(answer_of(await stood(core.queue, plan_number(request))))


async def _cancel(core: Core, request: HttpRequest) -> Response:
    queue, plan = core.queue, plan_number(request)
    wanted: CancelRequest = await _body(core, request, CancelRequest)
    await stood(queue, plan)
    found = await queue.ask("cancel", plan=plan, reason=wanted.reason)
    return _answer(CancelAnswer(**answer_of(found).model_dump(), success=found["done"]))


async def _completion(core: Core, request: HttpRequest) -> Response:
    queue, plan = core.queue, plan_number(request)
    wanted: CompletionRequest = await _body(core, request, CompletionRequest)
    loop = asyncio.get_running_loop()
    until = loop.time() + wanted.wait_s
    found = await stood(queue, plan)
    if found["status"] not in ENDED and wanted.wait_s:
        with core.stream():
            while found["status"] not in ENDED and not core.closing.is_set():
                since, left_s = queue.moves, until - loop.time()
                found = await stood(queue, plan)
                if left_s <= 0 or found["status"] in ENDED:
                    break
                await core.wait_for_news(since, left_s)
    ended, completed = found["status"] in ENDED, found["status"] == "COMPLETED"
    answer = answer_of(found).model_dump()
    return _answer(CompletionAnswer(**answer, ended=ended, completed=completed))


_NONE = (404, "There is no such plan.")
_OFF = (501, "There is no plan queue.")

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
            (409, "The request_id was that of another plan."),
            (507, "The journal takes no more plans."),
        ),
    ),
    Endpoint(
        method="GET",
        path="/v1/plans",
        name="list_plans",
        summary="List the plans of the queue, behind the plan with the number 'after'",
        answer=PlansAnswer,
        handle=_list,
        also=(_OFF,),
    ),
    Endpoint(
        method="GET",
        path="/v1/plans/{plan}",
        name="get_plan_status",
        summary="Tell how a plan stands",
        answer=PlanAnswer,
        handle=_status,
        also=(_NONE, _OFF),
    ),
    Endpoint(
        method="POST",
        path="/v1/plans/{plan}/cancel",
        name="cancel_plan",
        summary="Cancel a plan that waits or runs",
        request=CancelRequest,
        answer=CancelAnswer,
        handle=_cancel,
        also=(_NONE, _OFF),
    ),
    Endpoint(
        method="POST",
        path="/v1/plans/{plan}/completion",
        name="completion",
        summary="Tell whether a plan has completed, and wait for that",
        request=CompletionRequest,
        answer=CompletionAnswer,
        handle=_completion,
        also=(_NONE, _OFF),
    ),
)
