"""``POST /v1/generate``: let a language model write a plan, and queue it if that is wanted."""

from __future__ import annotations

import asyncio
import json
import secrets
import subprocess
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from gpsfsm.service.clients import client_of
from gpsfsm.service.plan_queue import Key, answer_of, set_plan
from gpsfsm.service.registry import Endpoint
from gpsfsm.service.shapes import Answer, Name, Problem, Request, is_plan, parsed

if TYPE_CHECKING:
    from starlette.requests import Request as HttpRequest
    from starlette.responses import Response

    from gpsfsm.service.core import Core

_LOOK_S = 0.5


class GenerateRequest(Request):
    """A task that a plan is to achieve."""

    task: Annotated[str, Field(min_length=1, max_length=100_000)]
    auto_queue: bool = Field(default=False, description="Queue the plan if it is accepted.")
    name: Name = "generated.xml"
    request_id: Key | None = None


class GenerateAnswer(Answer):
    """The plan, "" if none was accepted; ``reasoning`` says why not."""

    accepted: bool
    plan: str
    reasoning: str
    attempts: int
    plan_id: str
    status: str
    code: int | None


async def _generate(core: Core, request: HttpRequest) -> Response:
    from starlette.responses import Response

    settings = core.settings
    if core.closing.is_set():
        raise Problem(503, "the service is about to stop", retry_s=5)
    if not settings.generator:
        raise Problem(501, "no language model is named: start the service with --model")
    is_plan(request, allowed=False)
    async with core.body(request) as body:
        wanted = await core.made_of(body, partial(parsed, GenerateRequest))
    queue = core.queue if wanted.auto_queue else None
    client = client_of(request.scope)
    if not core.generating.take(client):
        raise Problem(429, "the language model is busy; try again", retry_s=10)
    try:
        result = await _generated(core, request, wanted.task)
    finally:
        core.generating.give_back(client)
    plan_id, status = "", "GENERATION_COMPLETE"
    code: int | None = 16
    if result["accepted"] and queue is not None:
        key = wanted.request_id or secrets.token_hex(16)
        state = answer_of(
            await set_plan(core, queue, result["plan"], name=wanted.name, key=key, client=client)
        )
        plan_id, status, code = state.plan_id, state.status, state.code
    answer = GenerateAnswer(
        accepted=result["accepted"],
        plan=result["plan"],
        reasoning=result["reason"],
        attempts=len(result["attempts"]),
        plan_id=plan_id,
        status=status,
        code=code,
    )
    return Response(answer.model_dump_json(), media_type="application/json")


async def _left(request: HttpRequest) -> None:
    """Wait until the client has gone: nobody needs the plan any more."""
    while not await request.is_disconnected():
        await asyncio.sleep(_LOOK_S)


async def _generated(core: Core, request: HttpRequest, task: str) -> dict[str, Any]:
    """The result of the command that asks a model. Raises Problem 502 or 504."""
    settings = core.settings
    process = await asyncio.create_subprocess_exec(
        *settings.generator,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    asking = asyncio.ensure_future(process.communicate(task.encode("utf-8", "replace")))
    closing = asyncio.ensure_future(core.closing.wait())
    left = asyncio.ensure_future(_left(request))
    try:
        await asyncio.wait(
            {asking, closing, left},
            timeout=settings.generate_s,
            return_when=asyncio.FIRST_COMPLETED,
        )
        if not asking.done():
            if closing.done():
                raise Problem(503, "the service is about to stop", retry_s=5)
            if left.done():
                raise Problem(400, "the connection was closed")
            raise Problem(504, f"there was no plan within {settings.generate_s:g} s")
        text, errors = asking.result()
    finally:
        closing.cancel()
        left.cancel()
        with suppress(ProcessLookupError):
            process.kill()
        await process.wait()
    try:
        result: dict[str, Any] = json.loads(text)
    except ValueError:
        lines = errors.decode("utf-8", "replace").strip().splitlines() or ["it said nothing"]
        raise Problem(502, f"the language model could not be asked: {lines[-1][:500]}") from None
    return result


ENDPOINTS = (
    Endpoint(
        method="POST",
        path="/v1/generate",
        name="generate",
        summary="Ask a language model for a plan",
        request=GenerateRequest,
        answer=GenerateAnswer,
        handle=_generate,
        also=((501, "No language model is named."), (502, "It could not be asked.")),
    ),
)
