"""``GET /v1/runs``: past runs, and the one that goes on, from the journal."""

from __future__ import annotations

import asyncio
import json
from functools import partial
from typing import TYPE_CHECKING, Any

from pydantic import Field

from gpsfsm.errors import GpsfsmError
from gpsfsm.service import run_history
from gpsfsm.service.clients import client_of
from gpsfsm.service.endpoints.page import WorldOutline  # noqa: TC001  (pydantic wants it)
from gpsfsm.service.plan_queue import json_response
from gpsfsm.service.registry import Endpoint, Query, endpoint
from gpsfsm.service.shapes import MOST, NO_NUMBER, Answer, Problem, whole_number

if TYPE_CHECKING:
    from starlette.requests import Request
    from starlette.responses import Response

    from gpsfsm.execution.journal_read import StoredRun
    from gpsfsm.service.core import Core

_RUNS, _MOST_RUNS = 50, 200
_RECORDS, _MOST_RECORDS = 5_000, 20_000


class RunAnswer(Answer):
    """A run. ``continues`` and ``continued_by`` are the plans before and behind one that gave up.

    ``length_us`` is the time of its last event. ``begun_s``, ``pose`` (x, y, yaw) and
    ``closed_zones`` (their places in the world) say when it began in its world, where the robot was
    and what was closed, null for as the world has it.
    """

    run: int
    plan_id: str | None
    name: str
    status: str
    began: str
    length_us: int
    events: int
    mode: str
    world: str
    seed: int
    begun_s: float
    pose: list[float] | None
    closed_zones: list[int] | None
    continues: str | None
    continues_run: int | None
    continued_by: str | None
    continued_by_run: int | None


class RunsAnswer(Answer):
    """Runs, the last one first; ``next`` is the ``before`` of the next page."""

    runs: list[RunAnswer]
    next: int | None


class RecordsAnswer(Answer):
    """Events of a run as the journal has them; ``next`` is the ``after`` of the next page."""

    records: list[dict[str, Any]]
    next: int | None


class Regeneration(Answer):
    """A request to a model behind a plan that gave up; ``accepted`` is null until it ends."""

    why: str
    model: str
    accepted: bool | None
    message: str
    attempts: list[dict[str, Any]]


class RunDetail(RunAnswer):
    """A run with all that it takes to show it: ``view`` is what ``/v1/view`` says of its plan."""

    plan: str
    view: dict[str, Any] | None = Field(description="null if it could not be made")
    world_at: WorldOutline | None
    regeneration: Regeneration | None
    records: list[dict[str, Any]]
    next: int | None


async def _list(core: Core, request: Request) -> Response:
    journal = _journal(core)
    before = whole_number(request, "before", MOST, least=1)
    most = whole_number(request, "most", _RUNS, least=1, most=_MOST_RUNS)
    of = partial(run_history.latest, before=before, most=most)
    stored = await run_history.in_journal(journal, of) or []
    runs = await _linked(core, stored)
    last = runs[-1].run if runs else 1
    return json_response(RunsAnswer(runs=runs, next=last if last > 1 else None))


async def _detail(core: Core, request: Request) -> Response:
    from starlette.responses import Response

    journal, number = _journal(core), _number(request)
    most = whole_number(request, "records", _RECORDS, most=_MOST_RECORDS)
    stored = await run_history.in_journal(journal, partial(run_history.details, number=number))
    if stored is None:
        raise _no_run()
    run, plan, world = stored
    (head,) = await _linked(core, [run])
    of = partial(run_history.records, run=number, after=0, most=most)
    lines = await run_history.in_journal(journal, of) or []
    regenerated = None
    if head.plan_id is not None and run.status.value == "GAVE_UP":
        of_plan = partial(run_history.regeneration, plan=int(head.plan_id))
        regenerated = await run_history.in_journal(journal, of_plan)
    shown = {
        **head.model_dump(),
        "plan": plan.decode("utf-8", "replace"),
        "world_at": await _world(world, head.world) if world else None,
        "regeneration": regenerated,
    }
    view = await _view(core, client_of(request.scope), run, plan)
    body = json.dumps(shown).encode()[:-1] + b',"view":' + view + b"," + _tail(lines, 0, run.events)
    return Response(body, media_type="application/json")


async def _events(core: Core, request: Request) -> Response:
    from starlette.responses import Response

    journal, number = _journal(core), _number(request)
    after = whole_number(request, "after", 0)
    most = whole_number(request, "most", _RECORDS, least=1, most=_MOST_RECORDS)
    stored = await run_history.in_journal(journal, partial(run_history.details, number=number))
    if stored is None:
        raise _no_run()
    of = partial(run_history.records, run=number, after=after, most=most)
    lines = await run_history.in_journal(journal, of) or []
    return Response(b"{" + _tail(lines, after, stored[0].events), media_type="application/json")


def _tail(lines: list[str], after: int, events: int) -> bytes:
    """The end of an answer, with lines of JSON as they are: there may be many of them."""
    last = after + len(lines)
    following = last if last < events else "null"
    return f'"records":[{",".join(lines)}],"next":{following}}}'.encode()


async def _linked(core: Core, runs: list[StoredRun]) -> list[RunAnswer]:
    """Runs with the plans that they belong to."""
    numbers = [run.number for run in runs]
    plans = (await core.queue.ask("plans_of", runs=numbers))["plans"] if numbers else {}
    linked = []
    for run in runs:
        state = plans.get(str(run.number), {})
        links = {
            "plan_id": _text(state.get("plan")),
            "continues": _text(state.get("continues")),
            "continues_run": state.get("continues_run"),
            "continued_by": _text(state.get("continued_by")),
            "continued_by_run": state.get("continued_by_run"),
        }
        linked.append(RunAnswer(**run_history.about(run), **links))
    return linked


def _text(plan: int | None) -> str | None:
    return str(plan) if plan else None


async def _world(content: bytes, name: str) -> dict[str, Any] | None:
    try:
        outline = await asyncio.to_thread(run_history.outline_of, content)
    except GpsfsmError:  # of a gpsfsm that took other worlds
        return None
    return {"world": name, **outline}


async def _view(core: Core, client: str, run: StoredRun, plan: bytes) -> bytes:
    """The view of the plan, as a worker makes it, as JSON."""
    try:
        endpoint("view")
    except KeyError:
        return b"null"
    text = plan.decode("utf-8", "surrogateescape")
    body = json.dumps({"plan": text, "name": run.file}).encode()
    try:
        answered = await core.pool.do("view", body, client=client)
    except Problem:
        return b"null"
    return answered.body if answered.status == 200 else b"null"


def _journal(core: Core) -> str:
    if not core.has_queue:
        _ = core.queue  # raises Problem
    return core.settings.journal


def _number(request: Request) -> int:
    text: str = request.path_params["run"]
    if not (text.isascii() and text.isdigit()) or len(text) > 15:
        raise _no_run()
    return int(text)


def _no_run() -> Problem:
    return Problem(404, "there is no such run")


_NONE = (404, "There is no such run.")
_OFF = (501, "There is no plan queue.")
_DOWN = (503, "The plan queue does not answer.")

ENDPOINTS = (
    Endpoint(
        method="GET",
        path="/v1/runs",
        name="list_runs",
        summary="List the runs of the journal, newest first",
        answer=RunsAnswer,
        handle=_list,
        query=(
            Query("before", "The number of a run; those before it are listed."),
            Query("most", f"The most to return; default: {_RUNS}."),
        ),
        also=(_OFF, _DOWN, NO_NUMBER),
    ),
    Endpoint(
        method="GET",
        path="/v1/runs/{run}",
        name="get_run",
        summary="Return a run with everything needed to show it",
        answer=RunDetail,
        handle=_detail,
        query=(Query("records", f"The most events to return; default: {_RECORDS}."),),
        also=(_NONE, _OFF, _DOWN, NO_NUMBER),
    ),
    Endpoint(
        method="GET",
        path="/v1/runs/{run}/events",
        name="run_events",
        summary="List the events of a run after the event 'after'",
        answer=RecordsAnswer,
        handle=_events,
        query=(
            Query("after", "The number of an event; those after it are listed."),
            Query("most", f"The most to return; default: {_RECORDS}."),
        ),
        also=(_NONE, _OFF, _DOWN, NO_NUMBER),
    ),
)
