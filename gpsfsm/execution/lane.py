"""Lanes: threads in which runners act in real time, so that one that hangs holds up nobody else.

A lane is a thread with an event loop of asyncio. The engine never waits for a lane: it asks, and is
told the end of each action through a function that may be called from any thread. What runners ask
of the engine goes the other way: ``on_loop`` lets services that live on its event loop be called
from any thread. A resident is a runner that is loaded in its lane, with what it depends on.
"""

from __future__ import annotations

import asyncio
import inspect
import threading
import types
from collections import deque
from concurrent.futures import Future
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from gpsfsm.execution.host import Key, loading_order
from gpsfsm.execution.queue import PlanService
from gpsfsm.execution.runner import LoadContext, Runner, RunnerError, StopRequested, close, said

if TYPE_CHECKING:
    from collections.abc import Callable, Coroutine, Generator, Mapping, Sequence


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
    notified = False
    while True:
        try:
            request = awaited.send(None) if error is None else awaited.throw(error)
        except StopIteration as ended:
            return ended.value
        error = None
        try:
            yield request
        except GeneratorExit:
            close(awaited)
            raise
        except asyncio.CancelledError as cancelled:
            if action.gone:
                close(awaited)
                raise
            stop = action.interrupted and not notified
            notified = notified or stop
            error = _StopRequested() if stop else cancelled
        except BaseException as other:  # asyncio complains about what was awaited
            error = other


async def in_thread(function: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
    """Call a blocking function in a thread of its own, and wait for its result.

    If the caller is cancelled in the meantime, the function runs on, because a thread cannot be
    stopped. It does not keep the process alive. Raises whatever the function raises.
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
        value: Any = None
        problem: BaseException | None = None
        try:
            value = function(*arguments, **named)
        except StopIteration as error:  # cannot travel through a future
            problem = RuntimeError(f"StopIteration: {error}")
        except BaseException as error:
            problem = error
        with suppress(RuntimeError):  # nobody waits any more
            loop.call_soon_threadsafe(settle, value, problem)

    threading.Thread(target=work, name=getattr(function, "__name__", "work"), daemon=True).start()
    return await waiting


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
        member = getattr(self._service, name)
        if inspect.iscoroutinefunction(member):
            return self._awaiting(member)
        return self._calling(member) if callable(member) else member

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


class Resident:
    """A runner that is loaded or being loaded. ``users`` counts who needs it."""

    __slots__ = ("key", "lane", "problem", "ready", "runner", "users", "waiting")

    def __init__(self, key: Key, lane: Lane) -> None:
        self.key = key
        self.lane = lane
        self.runner: Runner | None = None
        self.ready = False
        self.problem = ""
        self.users = 0
        self.waiting: list[Callable[[], None]] = []


class Residents:
    """Loads and unloads. All methods are called in the thread of the engine.

    ``post`` calls a function there from any thread, ``later`` after some seconds; ``note`` gets
    what goes wrong while unloading.
    """

    def __init__(
        self,
        make: Callable[[str, str], Runner],
        services: Mapping[str, Any],
        *,
        depends_on: Callable[[str, str], Sequence[Key]],
        shared: Lane | None,
        load_s: float,
        grace_s: float,
        post: Callable[[Callable[[], None]], None],
        later: Callable[[float, Callable[[], None]], None],
        note: Callable[[str], None],
    ) -> None:
        self._make = make
        self._services = services
        self._depends_on = depends_on
        self._shared = shared
        self._load_s = load_s
        self._grace_s = grace_s
        self._post = post
        self._later = later
        self._note = note
        self._present: dict[Key, Resident] = {}  # in the order of their loading
        self._held: dict[Key, list[Resident]] = {}
        self._unloads: deque[Resident] = deque()
        self._unloading: Resident | None = None

    def __getitem__(self, key: Key) -> Resident | None:
        """The runner, if it is loaded."""
        entry = self._present.get(key)
        return entry if entry is not None and entry.ready else None

    @property
    def at_rest(self) -> bool:
        """True if nothing is being unloaded."""
        return self._unloading is None

    # -- loading ----------------------------------------------------------------------------

    def acquire(self, key: Key, done: Callable[[str], None]) -> None:
        """Load a runner and what it depends on; ``done`` gets what went wrong, "" for nothing.

        ``done`` may be called at once.
        """
        held = self._held[key] = []
        try:
            order = loading_order(key, self._depends_on)
        except Exception as error:
            self._refuse(key, said(error), done)
            return
        self._acquire_next(key, deque(order), held, done)

    def _acquire_next(
        self, key: Key, order: deque[Key], held: list[Resident], done: Callable[[str], None]
    ) -> None:
        while order and self._held.get(key) is held:
            wanted = order.popleft()
            resident = self._present.get(wanted)
            if resident is None:
                resident = self._load(wanted)
            resident.users += 1
            held.append(resident)
            if not resident.ready:
                resident.waiting.append(
                    lambda: self._go_on(key, order, held, done)  # once it is loaded, or cannot be
                )
                return
        if self._held.get(key) is held:
            done("")

    def _go_on(
        self, key: Key, order: deque[Key], held: list[Resident], done: Callable[[str], None]
    ) -> None:
        if self._held.get(key) is not held:
            return  # it is not wanted any more
        resident = held[-1]
        if resident.ready:
            self._acquire_next(key, order, held, done)
            return
        problem = resident.problem
        if resident.key != key:
            problem = f"{resident.key[1] or resident.key[0]}, which it depends on: {problem}"
        self._refuse(key, problem, done)

    def _refuse(self, key: Key, problem: str, done: Callable[[str], None]) -> None:
        self.release(key)
        done(problem)

    def _load(self, key: Key) -> Resident:
        lane = self._shared or Lane(f"runner {key[1] or key[0]}")
        resident = self._present[key] = Resident(key, lane)

        async def load() -> None:
            made = self._make(*key)
            if not isinstance(made, Runner):
                raise RunnerError(f"{type(made).__name__} is not a runner")
            resident.runner = made
            await made.start(LoadContext(*key, self._services))

        action = Action(
            lane, load, lambda _, error: self._post(lambda: self._loaded(resident, error))
        )
        self._later(self._load_s, lambda: self._too_slow(resident, action))
        return resident

    def _too_slow(self, resident: Resident, action: Action) -> None:
        if resident.waiting:
            action.cut_off()
            self._loaded(resident, RunnerError(f"not loaded within {self._load_s:g} s"))

    def _loaded(self, resident: Resident, error: BaseException | None) -> None:
        if self._present.get(resident.key) is not resident or resident.ready or resident.problem:
            return  # nobody waits for it any more
        resident.ready = error is None
        if error is not None:
            resident.problem = str(error) if isinstance(error, RunnerError) else said(error)
            resident.problem = resident.problem or "it cannot be loaded"
        waiting, resident.waiting = resident.waiting, []
        for go_on in waiting:
            go_on()

    # -- unloading --------------------------------------------------------------------------

    def release(self, key: Key) -> None:
        """A runner is needed no more; unload it and what it depends on, as far as nobody does."""
        for resident in reversed(self._held.pop(key, [])):
            resident.users -= 1
            if resident.users == 0:
                del self._present[resident.key]
                resident.waiting.clear()
                self._unloads.append(resident)
        self._unload_next()

    def release_all(self) -> None:
        """Unload everything, what was loaded last first."""
        for key in reversed(list(self._held)):
            self.release(key)

    def _unload_next(self) -> None:
        """One after the other, so that what depends on a runner has let go of it before."""
        while self._unloading is None and self._unloads:
            resident = self._unloads.popleft()
            if not resident.ready or resident.runner is None:
                self._leave(resident)
                continue
            self._unloading = resident
            self._unload(resident, resident.runner)

    def _unload(self, resident: Resident, runner: Runner) -> None:
        action = Action(
            resident.lane,
            runner.stop,
            lambda _, error: self._post(lambda: self._unloaded(resident, error)),
        )

        def too_slow() -> None:
            if self._unloading is resident:
                action.cut_off()
                self._unloaded(resident, RunnerError(f"not unloaded within {self._grace_s:g} s"))

        self._later(self._grace_s, too_slow)

    def _unloaded(self, resident: Resident, error: BaseException | None) -> None:
        if self._unloading is not resident:
            return
        if error is not None:
            self._note(f"unloading {resident.key[1] or resident.key[0]}: {said(error)}")
        self._leave(resident)
        self._unloading = None
        self._unload_next()

    def _leave(self, resident: Resident) -> None:
        if resident.lane is not self._shared:
            resident.lane.close()
