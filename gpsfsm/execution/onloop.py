"""Services that live on the event loop of the engine, for runners in other threads."""

from __future__ import annotations

import asyncio
import inspect
from concurrent.futures import Future
from typing import TYPE_CHECKING, Any

from gpsfsm.execution.queue import PlanService

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["OnLoop", "Submitting", "on_loop"]

_PATIENCE_S = 30.0


class OnLoop:
    """Calls the methods of an object on an event loop, from any thread, and waits for the answer.

    Raises what the method raises, and TimeoutError if the loop does not answer for 30 seconds. A
    coroutine is awaited there; if who waits for it is stopped, so is the coroutine.
    """

    def __init__(self, service: Any, loop: asyncio.AbstractEventLoop) -> None:
        self._service = service
        self._loop = loop

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._service, name)
        if inspect.iscoroutinefunction(found):
            return self._awaiting(found)
        return self._calling(found) if callable(found) else found

    def _calling(self, method: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **named: Any) -> Any:
            answer: Future[Any] = Future()

            def work() -> None:
                try:
                    answer.set_result(method(*arguments, **named))
                except BaseException as error:
                    answer.set_exception(error)

            self._loop.call_soon_threadsafe(work)
            return answer.result(_PATIENCE_S)

        return call

    def _begun(self, method: Callable[..., Any], *arguments: Any, **named: Any) -> Future[Any]:
        return asyncio.run_coroutine_threadsafe(method(*arguments, **named), self._loop)

    def _awaiting(self, method: Callable[..., Any]) -> Callable[..., Any]:
        async def call(*arguments: Any, **named: Any) -> Any:
            return await asyncio.wrap_future(self._begun(method, *arguments, **named))

        return call


class Submitting(OnLoop):
    """The plan queue: to submit is to wait for the verdict of the gate, however long it takes."""

    def submit(self, text: str, name: str = "") -> int:
        """Queue a plan; its number. This blocks the thread: ``submitted`` does not."""
        number: int = self._begun(self._service.submitted, text, name).result()
        return number


def on_loop(service: Any, loop: asyncio.AbstractEventLoop) -> Any:
    """A service as other threads may use it: the plan queue, and what has a method ``on_loop``."""
    if isinstance(service, PlanService):
        return Submitting(service, loop)
    made = getattr(service, "on_loop", None)
    return service if made is None else made(loop)
