"""Lanes: threads in which runners act in real time, so that one that hangs holds up nobody else.

A lane is a thread with an event loop of asyncio. The engine never waits for a lane: it asks, and is
told the end of each action through a function that may be called from any thread.
"""

from __future__ import annotations

import asyncio
import inspect
import threading
import types
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from gpsfsm.execution.closing import close
from gpsfsm.execution.runner import RunnerError, StopRequested

if TYPE_CHECKING:
    from collections.abc import Callable, Coroutine, Generator

__all__ = ["Action", "Lane", "in_thread"]


class _StopRequested(StopRequested, asyncio.CancelledError):
    """Is what asyncio expects of a cancellation too, so that its own helpers clean up."""


class Lane:
    """A thread with an event loop. It never keeps the process alive."""

    def __init__(self, name: str) -> None:
        self._loop = asyncio.new_event_loop()
        # what is left over when a lane is closed is no news
        self._loop.set_exception_handler(lambda _loop, _context: None)
        self._closing = False
        threading.Thread(target=self._live, name=name, daemon=True).start()

    def do(self, action: Callable[[], None]) -> None:
        """Call a function in the thread of the lane; nothing if the lane is closed."""
        with suppress(RuntimeError):
            self._loop.call_soon_threadsafe(action)

    def task(self, work: Coroutine[Any, Any, Any]) -> asyncio.Task[Any]:
        """Begin a coroutine; to be called in the lane."""
        return self._loop.create_task(work)

    def close(self) -> None:
        """Let the thread end as soon as nothing blocks it. Does not wait."""
        self.do(self._close)

    def _close(self) -> None:
        self._closing = True
        self._loop.stop()

    def _live(self) -> None:
        asyncio.set_event_loop(self._loop)
        while not self._closing:
            with suppress(BaseException):  # SystemExit in a task of a runner ends no lane
                self._loop.run_forever()
        with suppress(BaseException):
            for task in asyncio.all_tasks(self._loop):
                task.cancel()
            self._loop.run_until_complete(asyncio.sleep(0))
            self._loop.run_until_complete(self._loop.shutdown_asyncgens())
        with suppress(BaseException):
            self._loop.close()


class Action:
    """Something that is done in a lane. Its end is told exactly once, unless the lane is blocked.

    ``begin`` gives the coroutine, ``check`` looks over what it returns; both are called in the lane
    and may raise. ``tell`` gets the value and the exception, one of which is None.
    """

    def __init__(
        self,
        lane: Lane,
        begin: Callable[[], Any],
        tell: Callable[[Any, BaseException | None], None],
        *,
        check: Callable[[Any], Any] = lambda value: value,
    ) -> None:
        self._lane = lane
        self._begin = begin
        self._check = check
        self._tell = tell
        self._task: asyncio.Task[Any] | None = None
        self.interrupted = False
        self.gone = False
        lane.do(self._start)

    def interrupt(self) -> None:
        """Raise StopRequested where the action waits."""
        self.interrupted = True
        self._lane.do(self._cancel)

    def cut_off(self) -> None:
        """Give it no further turn."""
        self.interrupted = self.gone = True
        self._lane.do(self._cancel)

    def _start(self) -> None:
        if self.gone:
            return
        self._task = self._lane.task(self._work())
        self._task.add_done_callback(self._done)
        if self.interrupted:
            self._task.cancel()

    def _cancel(self) -> None:
        if self._task is not None:
            self._task.cancel()

    def _done(self, task: asyncio.Task[Any]) -> None:
        value, error = (None, StopRequested()) if task.cancelled() else task.result()
        self._tell(value, error)

    async def _work(self) -> tuple[Any, BaseException | None]:
        try:
            awaited = self._begin()
            if not inspect.iscoroutine(awaited):
                raise RunnerError("its methods have to be 'async def'")
            return self._check(await _driven(awaited, self)), None
        except BaseException as error:  # whatever a runner raises
            return None, error


@types.coroutine
def _driven(awaited: Coroutine[Any, Any, Any], action: Action) -> Generator[Any, Any, Any]:
    """Pass a coroutine's waiting on; cancelling turns into StopRequested, or into the end.

    Only once: what is cancelled later, while it cleans up, is cancelled by helpers of asyncio.
    """
    error: BaseException | None = None
    told = False
    while True:
        try:
            asked = awaited.send(None) if error is None else awaited.throw(error)
        except StopIteration as ended:
            return ended.value
        error = None
        try:
            yield asked
        except GeneratorExit:
            close(awaited)
            raise
        except asyncio.CancelledError as cancelled:
            if action.gone:
                close(awaited)
                raise
            stop = action.interrupted and not told
            told = told or stop
            error = _StopRequested() if stop else cancelled
        except BaseException as other:  # asyncio complains about what was awaited
            error = other


async def in_thread(function: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
    """Call a function that blocks in a thread of its own, and wait for what it returns.

    If the caller is stopped meanwhile, the thread is left alone: a function cannot be stopped. It
    never keeps the process alive.
    """
    loop = asyncio.get_running_loop()
    waiting: asyncio.Future[Any] = loop.create_future()

    def settle(value: Any, error: BaseException | None) -> None:
        if waiting.done():
            return
        if error is None:
            waiting.set_result(value)
        else:
            waiting.set_exception(error)

    def work() -> None:
        value, problem = None, None
        try:
            value = function(*arguments, **named)
        except StopIteration as error:  # cannot travel through a future
            problem = RuntimeError(f"StopIteration: {error}")
        except BaseException as error:
            problem = error  # type: ignore[assignment]
        with suppress(RuntimeError):  # nobody waits any more
            loop.call_soon_threadsafe(settle, value, problem)

    threading.Thread(target=work, name=getattr(function, "__name__", "work"), daemon=True).start()
    return await waiting
