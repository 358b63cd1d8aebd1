"""The stopper: a process of its own that cancels all goals of a robot on request.

No plan runs in it, so no plan, queue or worker can hold it up. Requests are lines on its standard
input, and answers are lines of JSON::

    (when it can stop)      {"ready": true}
    stop 7                  {"stop": 7, "cancelled": 2, "problems": []}
    ping                    {"alive": true}
    (when others call it)   {"called": 1}
    answer 1 {"success": true, "message": "…"}

An answer that is late says nothing of a later stop. It ends when its standard input does. It has to
give signs of life now and then, and is started again if it does not: who notices that only when
something has to be stopped notices it too late.
"""

from __future__ import annotations

import asyncio
import json
import os
import subprocess
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from gpsfsm import logs
from gpsfsm.errors import GpsfsmError
from gpsfsm.strict_json import strict_loads
from gpsfsm.workers.child_process import relay

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Sequence

_READY_S = 30.0
_BEAT_S = 2.0
_ALIVE_S = 5.0
_PAUSES_S = (0.1, 0.5, 1.0, 2.0, 5.0)
_END_S = 5.0
_MOST_LINE = 1 << 16
_MOST_PROBLEMS, _LONGEST = 20, 500
_MOST_REPLIES = 20
"""Stops that others have asked for and that are under way."""


@dataclass(frozen=True, slots=True)
class Stopped:
    """The answer of the stopper. ``cancelled`` is None if it has not answered."""

    cancelled: int | None
    problems: tuple[str, ...]


class Stopper:
    """The stopper as the service sees it. Lives on one event loop.

    ``stop_all`` stops everything for others who call it, and says what has come of it.
    """

    def __init__(
        self, command: Sequence[str], stop_all: Callable[[], Awaitable[tuple[bool, str]]]
    ) -> None:
        self._command = tuple(command)
        self._stop_all = stop_all
        self._replies: set[asyncio.Task[None]] = set()
        self._process: asyncio.subprocess.Process | None = None
        self._ready = asyncio.Event()
        self._stops: dict[int, asyncio.Future[Stopped]] = {}  # by number, those without an answer
        self._number = 0
        self._alive = asyncio.Event()
        self._keeper: asyncio.Task[None] | None = None
        self._relay: asyncio.Task[None] | None = None
        self.restarts = 0
        self.failure = ""

    @property
    def up(self) -> bool:
        """True if it can stop something, by its last sign of life."""
        return self._ready.is_set()

    async def start(self) -> None:
        """Start it. Raises GpsfsmError if it does not get ready."""
        self._keeper = asyncio.create_task(self._keep())
        try:
            async with asyncio.timeout(_READY_S):
                await self._ready.wait()
        except TimeoutError:
            why = self.failure or "it has not reported that it is ready"
            raise GpsfsmError(f"the stopper did not begin: {why}") from None

    async def stop(self, within_s: float) -> Stopped:
        """Let it cancel everything. What kept it from doing so is among the problems."""
        waiting: asyncio.Future[Stopped] = asyncio.get_running_loop().create_future()
        self._number += 1
        number = self._number
        try:
            async with asyncio.timeout(within_s):
                while (
                    True
                ):  # one that is just being started again gets the request as soon as it is there
                    await self._ready.wait()
                    if self._tell(f"stop {number}"):
                        self._stops[number] = waiting
                        return await waiting
                    await asyncio.sleep(0.01)
        except TimeoutError:
            what = "has not answered" if number in self._stops else "is not running"
            why = f": {self.failure}" if self.failure else ""
            return Stopped(None, (f"the stopper {what} within {within_s:g} s{why}",))
        finally:
            self._stops.pop(number, None)

    def _tell(self, word: str) -> bool:
        process = self._process
        if process is None or process.stdin is None or process.stdin.is_closing():
            return False
        process.stdin.write(f"{word}\n".encode())
        return True

    async def close(self) -> None:
        """End it; nothing is to be stopped any more."""
        if self._keeper is not None:
            self._keeper.cancel()
            await asyncio.wait({self._keeper})
        await self._end()

    # -- keeping it alive -----------------------------------------------------------------------

    async def _keep(self) -> None:
        tries = 0
        while True:
            began_s = asyncio.get_running_loop().time()
            try:
                await self._live()
            except OSError as error:
                self._failed(f"it cannot be started: {error.strerror or error}")
            await self._end()
            steady = asyncio.get_running_loop().time() - began_s > _ALIVE_S
            tries = 0 if steady else tries + 1
            await asyncio.sleep(_PAUSES_S[min(tries, len(_PAUSES_S) - 1)])
            self.restarts += 1

    async def _live(self) -> None:
        """One life of the process."""
        self._process = await asyncio.create_subprocess_exec(
            *self._command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE if logs.is_json() else None,
            start_new_session=True,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
            limit=_MOST_LINE,
        )
        if self._process.stderr is not None:  # it ends with the process
            line = partial(logs.from_child, "stopper")
            self._relay = asyncio.create_task(relay(self._process, line))
        listening = asyncio.create_task(self._listen(self._process))
        beating = asyncio.create_task(self._beat())
        try:
            await asyncio.wait({listening, beating}, return_when=asyncio.FIRST_COMPLETED)
            silent = beating.done()
        finally:
            self._ready.clear()
            for task in (listening, beating):
                task.cancel()
            await asyncio.wait({listening, beating})
        code = self._process.returncode
        self._failed(
            f"it has not answered for {_ALIVE_S:g} s"
            if silent
            else "it has ended"
            if code is None
            else f"it has ended with code {code}"
        )

    async def _listen(self, process: asyncio.subprocess.Process) -> None:
        assert process.stdout is not None
        with suppress(ValueError, OSError):  # a line without an end
            while line := await process.stdout.readline():
                self._take(line)
        with suppress(TimeoutError):
            async with asyncio.timeout(_END_S):
                await process.wait()

    def _take(self, line: bytes) -> None:
        try:
            answer: Any = strict_loads(line)
        except ValueError:
            answer = None
        if not isinstance(answer, dict):
            return  # it may write what it likes, but this says nothing
        if answer.get("alive") is not False:
            self._alive.set()
        if "failed" in answer:
            self._failed(str(answer["failed"])[:_LONGEST])
        if answer.get("ready") is True:
            self.failure = ""
            self._ready.set()
            for number in self._stops:  # the process before has ended without an answer
                self._tell(f"stop {number}")
        if type(called := answer.get("called")) is int and len(self._replies) < _MOST_REPLIES:
            reply = asyncio.create_task(self._reply(called))
            self._replies.add(reply)
            reply.add_done_callback(self._replies.discard)
        if "cancelled" in answer and type(which := answer.get("stop")) is int:
            waiting = self._stops.pop(which, None)
            if waiting is not None and not waiting.done():
                waiting.set_result(_stopped(answer))

    async def _reply(self, number: int) -> None:
        success, message = await self._stop_all()
        row = json.dumps({"success": success, "message": message})
        self._tell(f"answer {number} {row}")

    async def _beat(self) -> None:
        """Return when it is silent for too long."""
        await self._ready.wait()
        while True:
            self._alive.clear()
            self._tell("ping")
            try:
                async with asyncio.timeout(_ALIVE_S):
                    await self._alive.wait()
            except TimeoutError:
                return
            await asyncio.sleep(_BEAT_S)

    def _failed(self, why: str) -> None:
        if why != self.failure:
            text = f"the stopper is not available: {why}; it is being restarted"
            logs.event("error", "stopper_down", text, reason=why)
        self.failure = why

    async def _end(self) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        if process.stdin is not None:
            process.stdin.close()
        with suppress(TimeoutError):
            async with asyncio.timeout(_END_S):
                await process.wait()
        if process.returncode is None:
            with suppress(ProcessLookupError):
                process.kill()
            await process.wait()


def _stopped(answer: dict[str, Any]) -> Stopped:
    """An answer, whatever is in it."""
    cancelled, problems = answer["cancelled"], answer.get("problems")
    texts = problems if isinstance(problems, list) else []
    said = tuple(str(each)[:_LONGEST] for each in texts[:_MOST_PROBLEMS])
    if type(cancelled) is not int or cancelled < 0:
        return Stopped(None, (*said, "the stopper has answered with no number of goals"))
    return Stopped(cancelled, said)
