"""Answers about plans of the queue: how a plan stands, in gpsfsm's words and the original server's.

All endpoints that queue, follow or change plans share them.
"""

from __future__ import annotations

import hashlib
import json
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from gpsfsm.service.request_parts import is_plan, parsed
from gpsfsm.service.shapes import Answer, Problem
from gpsfsm.strict_json import strict_loads

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pydantic import BaseModel
    from starlette.requests import Request
    from starlette.responses import Response

    from gpsfsm.service.core import Core
    from gpsfsm.service.plan_queue import PlanQueueClient

Key = Annotated[
    str,
    Field(
        pattern=r"^[A-Za-z0-9._:-]{1,100}$",
        description="Of the client: a plan that is set again with the same one is set once.",
    ),
]
_MOST_FINDINGS = 50


class PlanAnswer(Answer):
    """How a plan stands.

    ``status`` and ``code`` are those of the original server; there is no code for how a plan ends
    that the original leaves running. ``rejected_list`` says why it was refused, ``reason`` why it
    was cancelled, ``continues`` in place of which plan it runs, ``submitted_by`` which plan has
    submitted it; ``run`` is the number of its run in the journal. ``speed``: so many seconds of its
    run pass in a second, null for as fast as possible; ``clock_us`` is how late it is in its run.
    """

    plan_id: str
    status: str
    code: int | None
    name: str
    sha256: str
    rejected_list: list[str]
    reason: str
    continues: str | None
    submitted_by: str | None
    run: int | None
    world: str
    speed: float | None
    paused: bool
    clock_us: int


def answer_of(state: dict[str, Any]) -> PlanAnswer:
    """The answer on a plan, from what the queue says of it."""
    word, code = status_of(state["status"], state["findings"])
    return PlanAnswer(
        plan_id=str(state["plan"]),
        status=word,
        code=code,
        name=state["name"],
        sha256=state["sha256"],
        rejected_list=state["findings"],
        reason=state["reason"],
        continues=str(state["continues"]) if state["continues"] else None,
        submitted_by=str(state["by"]) if state["by"] else None,
        run=state["run"],
        world=state["world"],
        speed=state["speed"] or None,
        paused=state["paused"],
        clock_us=state["clock_us"],
    )


async def read_request(core: Core, request: Request, model: type[BaseModel]) -> Any:
    """The request in a body; an empty one means the defaults. Raises Problem."""
    async with core.body(request) as body:
        if not body and not any(field.is_required() for field in model.model_fields.values()):
            return model()
        is_plan(request, allowed=False)
        return await core.made_of(body, partial(parsed, model))


def json_response(answer: BaseModel) -> Response:
    """An answer as it goes over the wire."""
    from starlette.responses import Response

    return Response(answer.model_dump_json(), media_type="application/json")


def plan_number(request: Request) -> int:
    """The plan that an address names. Raises Problem 404."""
    text: str = request.path_params["plan"]
    if not (text.isascii() and text.isdigit()) or len(text) > 9:
        raise _unknown()
    return int(text)


async def stood(queue: PlanQueueClient, plan: int) -> dict[str, Any]:
    """The state of a plan. Raises Problem 404 for one that there is not."""
    try:
        return await queue.ask("state", plan=plan)
    except Problem as problem:
        raise _unknown() if problem.status == 404 else problem from None


def _unknown() -> Problem:
    word, code = UNKNOWN
    return Problem(404, "there is no such plan", plan_status=word, code=code)


async def set_plan(
    core: Core,
    queue: PlanQueueClient,
    text: str,
    *,
    name: str,
    key: str,
    client: str,
    start: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Let a plan pass the gate, and queue it; when this returns it is in the journal.

    ``start`` says how it is to begin, ``client`` for whom. Raises Problem 422 if the gate refuses
    it, also where nothing could be decided.
    """
    body = json.dumps({"plan": text, "name": name}).encode()
    answered = await core.pool.do("gate", body, client=client)
    answer = strict_loads(answered.body)
    if answered.status != 200:
        raise Problem(answered.status, answer["detail"])
    if answer["verdict"] != "accept":
        findings = [_line(each) for each in answer["findings"][:_MOST_FINDINGS]]
        word, code = status_of("REFUSED", findings)
        raise Problem(
            422,
            f"the plan is refused: {answer['message']}",
            plan_id="",
            plan_status=word,
            code=code,
            rejected_list=findings or [answer["message"]],
        )
    content = text.encode("utf-8", "surrogatepass")
    state = await queue.ask("submit", text=content, name=name, key=key, start=dict(start or {}))
    if state["sha256"] != hashlib.sha256(content).hexdigest():
        raise Problem(409, f"request_id {key} was that of another plan, {state['plan']}")
    if state["status"] == "REFUSED":  # by the process that would have run it
        raise Problem(422, "the plan is refused: " + "; ".join(state["findings"]))
    return state


def _line(finding: dict[str, Any]) -> str:
    return f"{finding['rule']} at line {finding['location']['line']}: {finding['message']}"


UNKNOWN = ("UNKNOWN", 0)
ENDED = frozenset(("COMPLETED", "CANCELLED", "REFUSED", "GAVE_UP", "STUCK", "HANG", "ABORT"))
"""Statuses of plans, in the words of gpsfsm, behind which nothing comes."""

_WORDS = {
    "QUEUED": ("QUEUED", 1),
    "RUNNING": ("RUNNING", 12),
    "STOPPING": ("RUNNING", 12),
    "COMPLETED": ("COMPLETED", 13),
    "CANCELLED": ("CANCELLED", 14),
}
_NO_PLAN = "GP1"


def status_of(status: str, findings: Sequence[str] = ()) -> tuple[str, int | None]:
    """The word and the number of the original server for a status of gpsfsm.

    There is no number for how a plan can end that the original leaves running for ever.

    >>> status_of("STUCK")
    ('STUCK', None)
    """
    if status == "REFUSED":
        syntax = any(each.startswith(_NO_PLAN) for each in findings)
        return ("PARSE_FAILED", 3) if syntax else ("VALIDATION_FAILED", 5)
    return _WORDS.get(status, (status, None))
