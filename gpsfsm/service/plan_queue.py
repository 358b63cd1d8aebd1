"""The plan queue as the service sees it: a process of its own, which holds the journal.

Should it end, it is started again and goes on where its journal ends. Requests that it had not
answered are asked again; a plan that is submitted twice that way has the same key both times, and
is queued once. What must not be done twice is not asked again: whoever asked is told. While it
cannot go on, for its disk is full, say, nobody waits for it, and standard error tells why.
"""

from __future__ import annotations

import asyncio
import hashlib
import json
from contextlib import suppress
from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from gpsfsm import logs
from gpsfsm.errors import GpsfsmError
from gpsfsm.service.shapes import Answer, Problem, is_plan, parsed
from gpsfsm.service.traces import Traces
from gpsfsm.strict_json import strict_loads
from gpsfsm.workers.child_process import AsyncChildProcess
from gpsfsm.workers.frames import GoneError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from pydantic import BaseModel
    from starlette.requests import Request
    from starlette.responses import Response

    from gpsfsm.service.core import Core
    from gpsfsm.service.settings import Settings

_START_S = 300.0
"""What a restart may take: runs in a world are simulated once more."""
_ANSWER_S = 30.0
_NAME = "the plan queue "
_KILLED = "it was killed with everything that ran in it, and is held once it is back"
_PAUSES_S = (0.1, 0.5, 1.0, 2.0, 5.0, 10.0)
_STEADY_S = 5.0
"""Who has gone on for so long after a failure has overcome it."""


class PlanQueueClient:
    """The plan queue. Lives on one event loop.

    ``lost`` is called when a process has ended, or turns out to have left real runs unfinished.
    """

    def __init__(
        self,
        settings: Settings,
        lost: Callable[[], object] = lambda: None,
        traces: Traces | None = None,
    ) -> None:
        self._settings = settings
        self._traces = traces or Traces()
        self._lost = lost
        self._process: AsyncChildProcess | None = None
        self._pending: dict[int, asyncio.Future[dict[str, Any]]] = {}
        self._number = 0
        self._listener: asyncio.Task[None] | None = None
        self._settled = asyncio.Event()  # it answers, or there is no use in waiting for it
        self._steady: asyncio.TimerHandle | None = None
        self._tries = 0
        self.failure = ""  # what has ended it lately, in its own words
        self._news: asyncio.Future[None] | None = None
        self.moves = 0  # how often something has happened
        self._closing = False
        self._halted = ""  # why the next process holds the queue, if no other one got it
        self.restarts = 0

    @property
    def up(self) -> bool:
        """True while it answers, as far as is known."""
        return self._settled.is_set() and self._process is not None

    async def start(self) -> None:
        """Start the process. Raises GpsfsmError if it cannot begin."""
        await self._begin()
        self._listener = asyncio.create_task(self._live())

    async def _begin(self) -> None:
        settings, why = self._settings, self._halted
        line = partial(logs.from_child, "plan queue") if logs.is_json() else None
        process = await AsyncChildProcess.start(settings.executor, line=line)
        head = {
            "journal": settings.journal,
            "memory_mb": settings.memory_mb,
            "capabilities": list(settings.capabilities),
            "builtin": settings.builtin_capabilities,
            "robot": settings.robot,
            "limits": asdict(settings.limits),
            "most_waiting": settings.most_waiting,
            "most_plans": settings.most_plans,
            "check_s": settings.request_s,
            "why": why,
            **settings.runs,
        }
        try:
            async with asyncio.timeout(_START_S):
                await process.send(head)
                answer, _ = await process.receive()
                while "left" in answer:
                    self._lost()
                    answer, _ = await process.receive()
                if self._halted != why and "failed" not in answer:  # a stop has come meanwhile
                    how = {"reason": self._halted, "renew": True}
                    await process.send({"op": "stop_all", **how, "id": 0})
        except (GoneError, TimeoutError) as error:
            await process.end()
            why = str(error) or "did not start in time"
            raise GpsfsmError(f"{_NAME}{why}") from None
        except BaseException:
            await process.end()
            raise
        if "failed" in answer:
            await process.end()
            raise GpsfsmError(answer["failed"])
        self._process, self._halted = process, ""
        self._steady = asyncio.get_running_loop().call_later(_STEADY_S, self._recovered)
        self._settled.set()

    async def _live(self) -> None:
        """Listen to it, and start it again whenever it has ended."""
        while not self._closing:
            assert self._process is not None
            assert self._steady is not None
            process, failed_before = self._process, bool(self.failure)
            with suppress(GoneError):
                await self._listen(process)
            self._steady.cancel()
            self._process = None
            if not self._closing:
                self._lost()
            if not (self.failure and failed_before):
                self._settled.clear()
            await process.end()
            self._break_off()
            await self._restart()

    async def _listen(self, process: AsyncChildProcess) -> None:
        while True:
            head, _ = await process.receive()
            future = self._pending.pop(head.get("id", -1), None)
            if future is not None and not future.done():
                future.set_result(head)
            if "note" in head:
                self._tell()
            if "failed" in head:
                self._failed(head["failed"])
            if "spans" in head:
                self._traces.add(head["spans"], head["traceparent"])

    def _break_off(self) -> None:
        for future in self._pending.values():
            if not future.done():
                future.set_exception(GoneError("has ended"))
        self._pending.clear()
        self._tell()

    async def _restart(self) -> None:
        if not self.failure:
            self._tries = 0
        while not self._closing:
            await asyncio.sleep(_PAUSES_S[min(self._tries, len(_PAUSES_S) - 1)])
            self._tries += 1
            self.restarts += 1
            try:
                await self._begin()
            except (GpsfsmError, OSError) as error:
                self._failed(str(error))
                self._settled.set()
            else:
                return

    def _failed(self, why: str) -> None:
        """It has ended for a reason that may be there the next time as well."""
        why = why.removeprefix(_NAME)
        if why != self.failure:
            logs.event("error", "queue_failed", f"{_NAME}cannot go on: {why}", reason=why)
        self.failure = why

    def _recovered(self) -> None:
        self.failure = ""

    def _tell(self) -> None:
        self.moves += 1
        if self._news is not None and not self._news.done():
            self._news.set_result(None)
        self._news = None

    async def news(self, since: int, within_s: float) -> None:
        """Wait until there are more ``moves`` than so many, but not longer than that."""
        if self.moves != since:
            return
        if self._news is None:
            self._news = asyncio.get_running_loop().create_future()
        await asyncio.wait({self._news}, timeout=within_s)

    async def ask(self, op: str, *, once: bool = False, **more: Any) -> dict[str, Any]:
        """Ask the queue, once more if it ends meanwhile. Raises Problem if it does not answer.

        ``once``: it may have done it when it ended, and must not do it twice.
        """
        text = more.pop("text", b"")
        for _ in range(1 if once else 2):
            try:
                return await self._ask({"op": op, **more}, text)
            except GoneError:
                continue
        raise Problem(503, "the plan queue has ended and is being restarted; try again", retry_s=5)

    async def _ask(self, head: dict[str, Any], body: bytes) -> dict[str, Any]:
        try:
            async with asyncio.timeout(_ANSWER_S):
                await self._settled.wait()
        except TimeoutError:
            raise Problem(503, "the plan queue does not answer", retry_s=10) from None
        process = self._process
        if process is None:
            message = "the plan queue cannot continue; the log of the service says why"
            raise Problem(503, message, retry_s=10)
        self._number += 1
        number = self._number
        future: asyncio.Future[dict[str, Any]] = asyncio.get_running_loop().create_future()
        self._pending[number] = future
        try:
            async with asyncio.timeout(_ANSWER_S):
                try:
                    await process.send({**head, "id": number}, body)
                except GoneError:
                    # Whoever listens may notice it later, and breaks the future off then.
                    await process.end()
                answer = await future
        except TimeoutError:
            await process.end()  # it hangs; whoever listens starts another one
            raise Problem(503, "the plan queue does not answer", retry_s=10) from None
        finally:
            self._pending.pop(number, None)
        if "problem" in answer:
            raise Problem(answer["problem"], answer["detail"], retry_s=answer.get("retry_s"))
        return answer

    async def halt(self, reason: str, within_s: float, *, renew: bool = True) -> dict[str, Any]:
        """Cancel what runs and hold the queue, past all that waits for an answer.

        ``renew``: a queue that is held already is held for this reason from now on.
        A process that does not answer in time is killed: when it is started again, what it ran is
        cancelled and the queue is held. ``problem`` is what went wrong, "" for nothing.
        """
        process, self._halted = self._process, reason
        if process is None:
            return {"problem": "the plan queue is being restarted, and is held once it is back"}
        self._number += 1
        number = self._number
        future: asyncio.Future[dict[str, Any]] = asyncio.get_running_loop().create_future()
        self._pending[number] = future
        try:
            async with asyncio.timeout(within_s):
                how = {"reason": reason, "renew": renew}
                await process.send({"op": "stop_all", **how, "id": number})
                answer = await future
            self._halted = ""
            return {"problem": "", **answer}
        except TimeoutError:
            await process.end()  # whoever listens starts another one
            return {"problem": f"the plan queue has not answered within {within_s:g} s; {_KILLED}"}
        except GoneError:
            return {"problem": "the plan queue has ended; it is held once it is back"}
        finally:
            self._pending.pop(number, None)

    async def close(self) -> None:
        """Let it stop between two events; the journal says what is left to do."""
        self._closing = True
        process = self._process
        code = None if process is None else process.code
        if process is not None and code is None:  # as far as the listener has seen
            with suppress(GoneError):
                await process.send({"op": "stop"})
            await process.end(within_s=self._settings.grace_s)
            if process.code:
                self._lost()
        if self._steady is not None:
            self._steady.cancel()
        if self._listener is not None:
            self._listener.cancel()
            with suppress(asyncio.CancelledError):
                await self._listener
        self._settled.clear()
        self._break_off()


# ---- Answers about plans: how a plan stands, in our words and in those of the original server ----
# All endpoints that queue, follow or change plans share them.


Key = Annotated[
    str,
    Field(
        pattern=r"^[A-Za-z0-9._:-]{1,100}$",
        description="Chosen by the client; a repeated request queues the plan only once.",
    ),
]
_MOST_FINDINGS = 50


class PlanAnswer(Answer):
    """The state of a plan.

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
            return parsed(model, b"{}")
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
    trees = "<root" in text or "<BehaviorTree" in text  # a gate of plans alone is cheaper
    simulated = not core.settings.real
    wanted = {"plan": text, "name": name, "trees": trees, "allow_approximated": simulated}
    answered = await core.pool.do("gate", json.dumps(wanted).encode(), client=client)
    answer = strict_loads(answered.body)
    if answered.status != 200:
        raise Problem(answered.status, answer["detail"])
    if answer["verdict"] != "accepted" and not (simulated and _is_left_open(answer)):
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
    more: dict[str, Any] = {"start": dict(start or {}), "traceparent": core.traces.header()}
    state = await queue.ask("submit", text=content, name=name, key=key, **more)
    if state["sha256"] != hashlib.sha256(content).hexdigest():
        raise Problem(409, f"request_id {key} belongs to another plan, {state['plan']}")
    if state["status"] == "REFUSED":  # by the process that would have run it
        raise Problem(422, "the plan is refused: " + "; ".join(state["findings"]))
    return state


def _is_left_open(answer: dict[str, Any]) -> bool:
    """True if only a robot leaves open what leaves do; the queue decides on the rest once more."""
    errors = [each for each in answer["findings"] if each["severity"] == "error"]
    left = [each for each in answer["findings"] if each["rule"] == "GP214"]
    return bool(left) and answer["reason"] == "inconclusive" and not errors


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
