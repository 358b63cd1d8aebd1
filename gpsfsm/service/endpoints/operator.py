"""``/v1/stop``, ``/v1/queue``, ``/v1/queue/release`` and ``/v1/bond``: for who operates a robot.

A stop goes past all that other requests wait for: it reads no body, needs no worker and no place
that its client could have used up, and reaches the stopper and the plan queue independently.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import Field

from gpsfsm.service.clients import client_of
from gpsfsm.service.core import NOT_CONFIRMED
from gpsfsm.service.plan_queue import json_response, read_request
from gpsfsm.service.registry import Endpoint
from gpsfsm.service.shapes import Answer, Problem, Request

if TYPE_CHECKING:
    from starlette.requests import Request as HttpRequest
    from starlette.responses import Response

    from gpsfsm.service.core import Core
    from gpsfsm.service.plan_queue import PlanQueueClient


_LONGEST_REASON = 10_000


class QueueAnswer(Answer):
    """The state of the queue. ``held`` is why nothing begins, "" if it is not held.

    ``plan_id`` is the plan that runs, ``waiting`` how many wait, ``bonds`` how many operators have
    to beat; ``stopper``: whether there is a process that cancels all goals, off if none is needed.
    """

    held: str
    plan_id: str | None
    waiting: int
    bonds: int
    stopper: str


class ReleaseAnswer(QueueAnswer):
    """``success``: it was held, for the reason that was named if one was."""

    success: bool


class ReleaseRequest(Request):
    """Plans may begin again, unless the queue is held for another reason meanwhile."""

    held: str | None = Field(
        default=None, max_length=_LONGEST_REASON, description="The reason to be released; null: any"
    )


class BondRequest(Request):
    """A beat. The first one begins a bond of this client, which ``end`` leaves in good order."""

    lease_s: float = Field(default=10.0, ge=0.5, le=3600, description="Until the next beat.")
    end: bool = False


class StopAnswer(Answer):
    """The effect of a stop: the plan that it has cancelled, and how many goals of the robot.

    ``goals`` is null where no stopper is needed.
    """

    held: str
    plan_id: str | None
    goals: int | None
    problems: list[str]


def _real(core: Core) -> PlanQueueClient:
    """The queue of real runs. Raises Problem 501."""
    queue = core.queue
    if not core.settings.real:
        raise Problem(501, "nothing here moves a robot: start the service with --real")
    return queue


async def _stop(core: Core, request: HttpRequest) -> Response:
    _real(core)
    halted = await core.stop_robot(f"stopped by {client_of(request.scope)}")
    answer = StopAnswer(
        held=halted.held, plan_id=halted.plan, goals=halted.goals, problems=halted.problems
    )
    if halted.problems:
        said = answer.model_dump(exclude={"problems"})
        raise Problem(503, f"{NOT_CONFIRMED}: {'; '.join(halted.problems)}", **said)
    return json_response(answer)


def _stopper(core: Core) -> str:
    if core.stopper is None:
        return "off"
    return "up" if core.stopper.up else "down"


async def _queue(core: Core, _request: HttpRequest) -> Response:
    return json_response(_answer(core, await _real(core).ask("queue")))


def _answer(core: Core, state: dict[str, object]) -> QueueAnswer:
    return QueueAnswer(
        held=str(state["held"]),
        plan_id=str(state["plan"]) if state["plan"] else None,
        waiting=int(str(state["waiting"])),
        bonds=int(str(state["bonds"])),
        stopper=_stopper(core),
    )


async def _release(core: Core, request: HttpRequest) -> Response:
    queue = _real(core)
    wanted: ReleaseRequest = await read_request(core, request, ReleaseRequest)
    if not queue.up:  # nobody knows yet why it will be held when it is back
        why = "the queue stays held: the process that runs the plans is being restarted"
        raise Problem(503, why, retry_s=5)
    if core.stopper is not None and not core.stopper.up:
        why = f": {core.stopper.failure}" if core.stopper.failure else ""
        raise Problem(503, f"the queue stays held: the stopper is not available{why}", retry_s=5)
    state = await queue.ask("release", once=True, held=wanted.held)
    answer = _answer(core, state).model_dump()
    return json_response(ReleaseAnswer(**answer, success=state["done"]))


async def _bond(core: Core, request: HttpRequest) -> Response:
    queue = _real(core)
    wanted: BondRequest = await read_request(core, request, BondRequest)
    client = client_of(request.scope)
    state = await queue.ask("bond", client=client, lease_s=wanted.lease_s, end=wanted.end)
    return json_response(_answer(core, state))


_OFF = (501, "No real runners act.")
_DOWN = (503, "It could not be done, or it is unknown whether it was.")

ENDPOINTS = (
    Endpoint(
        method="POST",
        path="/v1/stop",
        name="stop",
        summary="Cancel every goal and the running plan, and hold the queue",
        answer=StopAnswer,
        handle=_stop,
        also=(_OFF, _DOWN),
    ),
    Endpoint(
        method="GET",
        path="/v1/queue",
        name="get_queue",
        summary="Report whether the queue is held, and what runs",
        answer=QueueAnswer,
        handle=_queue,
        also=(_OFF, _DOWN),
    ),
    Endpoint(
        method="POST",
        path="/v1/queue/release",
        name="release_queue",
        summary="Release the queue: plans may begin again",
        request=ReleaseRequest,
        answer=ReleaseAnswer,
        handle=_release,
        also=(_OFF, _DOWN),
    ),
    Endpoint(
        method="POST",
        path="/v1/bond",
        name="bond",
        summary="Send a heartbeat: if the heartbeats stop, so does the robot",
        request=BondRequest,
        answer=QueueAnswer,
        handle=_bond,
        also=(_OFF, _DOWN),
    ),
)
