"""Real time: runners act in lanes of their own, and answers count in the order of their arrival.

The engine is one thread of control, an event loop of asyncio. It waits for no runner: whatever a
runner does, timeouts, cancelling and the end of the run come when they are due. Only what is cut
off while it blocks its thread goes on, until it gives its thread back; it gets no further turn.
"""

from __future__ import annotations

import asyncio
import time
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import GpsfsmError
from gpsfsm.execution.lane import Action, Lane, Residents, on_loop
from gpsfsm.execution.records import AWAITED, DOUBTED, Input, Kind, Start
from gpsfsm.execution.replay import Adopting, is_wanted, settle, take_up
from gpsfsm.execution.runner import (
    InDoubtError,
    RunContext,
    Runner,
    StopRequested,
    checked,
    clean,
    failure,
    said,
    seeded,
    visited,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from gpsfsm.execution.host import Key, Sink
    from gpsfsm.execution.kernel import Kernel
    from gpsfsm.execution.records import Left, RunValue
    from gpsfsm.execution.runner import Logger

_SECOND = 1_000_000
_LONGEST = 1e9  # seconds: some thirty years
_MAX_LINES = 1_000  # that one instance may log, besides what becomes of its goal
_LOOK_S = 0.05
_NOT_CLEARED = "what it may still do outside could not be stopped: "
_LATE = "what was cut off has answered, which changes nothing"


class _Acting:
    """An instance that acts."""

    __slots__ = ("action", "context", "lines", "number", "runner", "stopping", "until")

    def __init__(self, number: int, runner: int, context: RunContext) -> None:
        self.number = number
        self.runner = runner
        self.context = context
        self.action: Action | None = None
        self.stopping = False
        self.lines = 0
        self.until = 0.0  # it is waited for, since it may still act outside


class RealtimeDriver(Adopting):
    """Runs a plan in real time.

    ``make`` gives the runner for an interface and provider, ``depends_on`` what must be loaded
    before it. ``timeout_s`` bounds each action (None: not at all), ``grace_s`` is how long a
    stopping instance and an unloading runner may take, ``load_s`` how long a loading one may. An
    instance that may still act outside is waited for until ``doubt_s`` are over: then the run ends
    in doubt, ``doubts`` saying of what.
    ``run_id`` tells this run from others, for ``RunContext.key``. ``speed`` is how many seconds of
    the run pass in a second, for simulated runners. ``isolate``: each runner has a thread of its
    own, so that one that blocks holds up no other; without it they all share one, as runners need
    that change the same world.
    """

    def __init__(
        self,
        kernel: Kernel,
        sink: Sink,
        make: Callable[[str, str], Runner],
        *,
        seed: int = 0,
        run_id: str = "",
        services: Mapping[str, Any] | None = None,
        depends_on: Callable[[str, str], Sequence[Key]] = lambda _interface, _provider: (),
        timeout_s: float | None = None,
        grace_s: float = 5.0,
        load_s: float = 30.0,
        doubt_s: float = 30.0,
        speed: float = 1.0,
        isolate: bool = True,
    ) -> None:
        super().__init__(kernel, sink)
        if not 0 < speed < float("inf"):
            raise ValueError(f"the speed must be above 0, not {speed}")
        self._make = make
        self._seed = seed
        self._run_id = run_id or str(seed)
        self._services = dict(services or {})
        self._depends_on = depends_on
        self._timeout_s = timeout_s
        self._grace_s = grace_s / min(speed, 1.0)
        self._load_s = load_s
        self._doubt_s = doubt_s
        self._speed = speed
        self._isolate = isolate
        self._acting: dict[int, _Acting] = {}
        self._unwanted: dict[int, None] = {}  # runners to unload once nothing acts with them
        self._early: list[Callable[[], None]] = []  # what was asked for before the run began
        self._left: Left | None = None
        self._cleared: set[int] = set()  # what they did outside has been stopped
        self._unreached: list[str] = []  # why nobody knows what others still do there
        self._loop: asyncio.AbstractEventLoop | None = None
        self._began = 0.0
        self._offset_us = 0
        self._closing = False
        self._ready = False
        self._interrupted = False
        self._not_again = ""  # why a runner was not loaded again
        self.logs: list[tuple[int, str, str]] = []  # time, element, text
        self.cut_off: set[int] = set()  # instances that did not stop in time
        self.doubts: list[str] = []  # what may still act outside, though the run has ended
        self.unload_failures: list[str] = []

    # -- time -------------------------------------------------------------------------------

    def now_us(self) -> int:
        """The time of the run; it stands still before the run begins."""
        if not self._began:
            return self._offset_us
        return self._offset_us + round((time.monotonic() - self._began) * self._speed * _SECOND)

    def at(self, at_us: int, action: Callable[[], None]) -> None:
        """Do something at a time of the run, in the thread of the engine."""
        if not self._ready:
            self._early.append(lambda: self.at(at_us, action))
            return
        self._later(max(0, at_us - self.now_us()) / _SECOND / self._speed, action)

    def _later(self, seconds: float, action: Callable[[], None]) -> None:
        assert self._loop is not None
        self._loop.call_later(min(seconds, _LONGEST), self._do, action)

    # -- the run ----------------------------------------------------------------------------

    async def run(self) -> None:
        """Run until the plan has ended, on the event loop of the caller. Once for each driver.

        Cancelling the task that waits here cancels the run in good order; doing so again gives it
        up. Raises what keeps the journal from being written; runners are stopped all the same.
        """
        self._loop = asyncio.get_running_loop()
        self._over: asyncio.Future[None] = self._loop.create_future()
        self._changed = asyncio.Event()
        self._shared = None if self._isolate else Lane("runners")
        self._residents = Residents(
            self._make,
            {name: on_loop(service, self._loop) for name, service in self._services.items()},
            depends_on=self._depends_on,
            shared=self._shared,
            load_s=self._load_s,
            grace_s=self._grace_s,
            post=self._post,
            later=self._later,
            note=self._not_unloaded,
        )
        self._began = time.monotonic()
        try:
            await self._begin()
            await self._until_over()
        finally:
            await self._all_let_go()

    async def _begin(self) -> None:
        if self._left is None:
            self.deliver(Input(Kind.BEGIN))
        else:
            await self._take_over(self._left)
        self._ready = True
        early, self._early = self._early, []
        for action in early:
            action()

    async def _until_over(self) -> None:
        try:
            await asyncio.shield(self._over)
        except asyncio.CancelledError:
            self._interrupted = True
            if not self._over.done():
                self.cancel("the process was interrupted")
                await self._over
            raise

    async def _all_let_go(self) -> None:
        """Let go, in good order also if the run is interrupted only now, for the first time."""
        letting_go = asyncio.ensure_future(self._let_go())
        try:
            await asyncio.shield(letting_go)
        except asyncio.CancelledError:
            if self._interrupted:
                letting_go.cancel()
            await asyncio.wait({letting_go})
            raise

    def deliver(self, happened: Input) -> None:
        """Take in an input; to be called in the thread of the engine."""
        if self._closing:
            return
        super().deliver(happened)
        if self.kernel.status.ended and not self._over.done():
            self._over.set_result(None)

    def post(self, happened: Input) -> None:
        """Take in an input after what has arrived already; may be called from any thread."""
        if self._ready:
            self._post(lambda: self.deliver(happened))
        else:
            self._early.append(lambda: self.deliver(happened))

    def cancel(self, reason: str) -> None:
        """Stop the run. May be called from any thread, like ``pause`` and ``resume``."""
        self.post(Input(Kind.CANCEL, message=reason))

    def pause(self) -> None:
        """Trigger nothing more until ``resume``; what acts goes on."""
        self.post(Input(Kind.PAUSE))

    def resume(self) -> None:
        """Go on after a pause."""
        self.post(Input(Kind.RESUME))

    def abandon(self) -> None:
        """Nothing can be written any more: ``run`` stops everything, then raises."""
        self._closing = True

    def _post(self, action: Callable[[], None]) -> None:
        assert self._loop is not None
        with suppress(RuntimeError):  # the loop is closed: the run is long over
            self._loop.call_soon_threadsafe(self._do, action)

    def _do(self, action: Callable[[], None]) -> None:
        try:
            action()
        except BaseException as error:
            self._closing = True
            if not self._over.done():
                self._over.set_exception(error)
        self._changed.set()

    async def _wait_until(self, condition: Callable[[], bool], seconds: float) -> None:
        end = time.monotonic() + seconds
        while not condition() and (left := end - time.monotonic()) > 0:
            self._changed.clear()
            with suppress(TimeoutError):
                async with asyncio.timeout(left):
                    await self._changed.wait()

    async def _let_go(self) -> None:
        """Stop what still acts, the last started first, and unload everything. Bounded."""
        self._closing = True
        for acting in reversed(list(self._acting.values())):
            self.stop(acting.number)
        await self._wait_until(lambda: not self._acting, self._grace_s)
        for acting in self._acting.values():
            assert acting.action is not None
            self.doubts += [each for each in (self._doubt_of(acting),) if each]
            acting.action.cut_off()
        self._acting.clear()
        self._residents.release_all()
        while not self._residents.at_rest:  # each unloading is bounded
            await self._wait_until(lambda: self._residents.at_rest, 2 * self._grace_s)
        if self._shared is not None:
            self._shared.close()
        if self._over.done() and not self._over.cancelled():
            self._over.exception()  # it has been raised elsewhere

    # -- going on with a run ----------------------------------------------------------------

    def adopt(self, left: Left) -> None:
        """Go on with the run of another process, as soon as ``run`` is called."""
        self._left = left
        self._offset_us = left.at_us

    async def _take_over(self, left: Left) -> None:
        take_up(self, left)
        if self.kernel.status.ended:
            return
        pending = dict.fromkeys(left.loaded)
        for runner in left.loaded:
            self._residents.acquire(
                self.kernel.runners[runner],
                partial(self._again, runner, pending),
            )
        await self._wait_until(lambda: not pending, 2 * self._load_s * (len(left.loaded) + 1))
        repeatable = await self._repeatable(left)
        stale = {each.number: each for each in left.active if each.number not in repeatable}
        self._cleared = {*stale}
        for start in [*stale.values()]:  # all at once: a robot is not to move meanwhile
            self._clear_up(start, partial(stale.pop, start.number))
        await self._wait_until(lambda: not stale, 4 * self._grace_s)
        if self._unreached and not left.cancel:
            reasons = "\n  ".join(dict.fromkeys(self._unreached))
            raise GpsfsmError(f"the run does not go on, and can be resumed: {reasons}")
        settle(self, left, repeatable)

    async def _repeatable(self, left: Left) -> set[int]:
        """The instances that may be asked again, as their runners say: they may ask outside."""
        pending = {each.number for each in left.active if is_wanted(self.kernel, each)}
        repeatable: set[int] = set()

        def answered(start: Start, value: Any, error: BaseException | None) -> None:
            if start.number in pending:
                pending.remove(start.number)
                if value is True:
                    repeatable.add(start.number)
                elif isinstance(error, InDoubtError):
                    element = self._context(start, lambda *_: None).element
                    self._log(start.number, element, said(error), {"left": "unknown"})
                    self._unreached.append(str(error))
                    repeatable.add(start.number)  # nothing is stopped of it either

        for start in [each for each in left.active if each.number in pending]:
            self._ask_repeat(start, partial(answered, start))
        await self._wait_until(lambda: not pending, 4 * self._grace_s)
        return repeatable

    def _ask_repeat(
        self, start: Start, answered: Callable[[Any, BaseException | None], None]
    ) -> None:
        resident = self._residents[self.kernel.runners[start.runner]]
        runner = None if resident is None else resident.runner
        if resident is None or runner is None:
            answered(False, None)  # what is left of it is seen to
            return
        key = self._context(start, lambda *_: None).key
        action = Action(
            resident.lane,
            lambda: runner.may_repeat(key),
            lambda *answer: self._post(lambda: answered(*answer)),
        )

        def too_slow() -> None:
            action.cut_off()
            answered(None, InDoubtError(f"it took more than {2 * self._grace_s:g} s to ask"))

        self._later(2 * self._grace_s, too_slow)

    def drop(self, start: Start) -> None:
        """The same, after the runner has seen to what the instance may still do outside."""
        if start.number in self._cleared:
            super().drop(start)
        else:
            self._clear_up(start, lambda: super(RealtimeDriver, self).drop(start))

    def _clear_up(self, start: Start, done: Callable[[], object]) -> None:
        """Let a runner stop what an action of another process left; bounded, like ``done``."""
        resident = self._residents[self.kernel.runners[start.runner]]
        context = self._context(start, lambda *_: None)

        def finish(line: str, *, failed: bool = False) -> None:
            if not over:
                over.append(line)
                if line:
                    data: dict[str, RunValue] = {"left": "unknown" if failed else "seen to"}
                    self._log(start.number, context.element, clean(line, 10_000), data)
                done()

        over: list[str] = []
        if resident is None or resident.runner is None:
            name = self.kernel.runners[start.runner][1] or self.kernel.runners[start.runner][0]
            line = f"what it still does outside is unknown: {name} is not loaded"
            self._unreached.append(f"{line}: {why}" if (why := self._not_again) else line)
            finish(line, failed=True)
            return
        runner = resident.runner

        def answered(value: Any, error: BaseException | None) -> None:
            line = str(value or "") if error is None else _NOT_CLEARED + said(error)
            if isinstance(error, InDoubtError):
                self._unreached.append(line)
            self._post(lambda: finish(line, failed=error is not None))

        def too_slow() -> None:
            action.cut_off()
            finish(f"{_NOT_CLEARED}it took more than {2 * self._grace_s:g} s", failed=True)

        action = Action(resident.lane, lambda: runner.left(context.key), answered)
        self._later(2 * self._grace_s, lambda: None if over else too_slow())

    def _again(self, runner: int, pending: dict[int, None], problem: str) -> None:
        pending.pop(runner, None)
        if problem:
            self._not_again = problem
            self._log(-1, "", f"{self.kernel.runners[runner][1]} is not loaded again: {problem}")

    # -- commands of the kernel -------------------------------------------------------------

    def load(self, runner: int) -> None:
        """Load a runner, after what it depends on."""

        def done(problem: str) -> None:
            kind = Kind.NOT_LOADED if problem else Kind.LOADED
            self._post(lambda: self.deliver(Input(kind, runner=runner, message=clean(problem))))

        self._residents.acquire(self.kernel.runners[runner], done)

    def unload(self, runner: int) -> None:
        """Unload a runner once the last instance that is to stop has stopped."""
        if any(acting.runner == runner for acting in self._acting.values()):
            self._unwanted[runner] = None
        else:
            self._residents.release(self.kernel.runners[runner])

    def start(self, command: Start) -> None:
        """Let an instance act in the lane of its runner."""
        number = command.number
        resident = self._residents[self.kernel.runners[command.runner]]
        if resident is None or resident.runner is None:
            failed = Input(Kind.FAILED, number, message="its runner is not loaded")
            self._post(lambda: self.deliver(failed))
            return
        acting = self._acting[number] = _Acting(
            number, command.runner, self._context(command, lambda *line: self._line(acting, *line))
        )
        run, parameters = resident.runner.run, dict(command.parameters)
        acting.action = Action(
            resident.lane,
            lambda: run(parameters, acting.context),
            lambda value, error: self._post(lambda: self._answered(acting, value, error)),
            check=checked,
        )
        if self._timeout_s is not None:
            self._later(self._timeout_s / self._speed, lambda: self._time_out(acting))

    def _context(self, command: Start, logger: Logger) -> RunContext:
        automaton = self.kernel.automaton
        element = automaton.name(automaton.runner_node(command.number))
        action = visited(element, command.visit)
        fate = f"{self._seed}:{action}:{automaton.fingerprint}"
        return RunContext(
            number=command.number,
            element=element,
            key=f"{self._run_id}:{action}",
            random=seeded(fate),
            sleeper=self._sleep,
            clock=lambda: self.now_us() / _SECOND,
            logger=logger,
        )

    async def _sleep(self, seconds: float) -> None:
        if not seconds >= 0:
            raise ValueError("a duration is not negative")
        await asyncio.sleep(min(seconds, _LONGEST) / self._speed)

    def _answered(self, acting: _Acting, value: Any, error: BaseException | None) -> None:
        """An instance has ended by itself, or has stopped if that is what it was to do."""
        cut_off = self._acting.get(acting.number) is not acting
        if isinstance(error, InDoubtError):
            if not cut_off:
                self._end_in_doubt(acting, clean(str(error)))
            return
        if not cut_off and (doubt := self._doubt_of(acting)):  # it has left something outside
            if self._is_waited_for(acting, doubt):
                self._later(_LOOK_S, lambda: self._answered(acting, value, error))
            else:
                self._end_in_doubt(acting, doubt)
            return
        if isinstance(error, StopRequested) and (acting.stopping or cut_off):
            happened = Input(Kind.STOPPED, acting.number, message="stopped")
        elif error is None:
            happened = Input(Kind.SUCCEEDED, acting.number, outputs=value)
        else:
            happened = failure(acting.number, error)
        if not cut_off:
            self._leave(acting, happened)
        elif acting.number in self._acting:  # it acts once more, which this says nothing of
            self._log(acting.number, acting.context.element, _LATE)
        elif happened.kind is not Kind.STOPPED:
            self.deliver(happened)  # the kernel says that it is late

    def _leave(self, acting: _Acting, happened: Input) -> None:
        del self._acting[acting.number]
        self.deliver(happened)
        runner = acting.runner
        if runner in self._unwanted:
            del self._unwanted[runner]
            self.unload(runner)

    def _time_out(self, acting: _Acting) -> None:
        if self._acting.get(acting.number) is acting and not acting.stopping:
            self.deliver(Input(Kind.TIMEOUT, acting.number, message="its time is over"))

    def stop(self, number: int) -> None:
        """Ask it to stop; after the grace time it is cut off, whatever it does."""
        acting = self._acting.get(number)
        if acting is None or acting.stopping:
            return
        acting.stopping = acting.context.stop_requested = True
        assert acting.action is not None
        acting.action.interrupt()
        self._later(self._grace_s, lambda: self._cut_off(acting))

    def _cut_off(self, acting: _Acting) -> None:
        if self._acting.get(acting.number) is not acting:
            return
        doubt = self._doubt_of(acting)
        if doubt and self._is_waited_for(acting, doubt):
            self._later(_LOOK_S, lambda: self._cut_off(acting))
            return
        assert acting.action is not None
        acting.action.cut_off()
        self.cut_off.add(acting.number)
        if doubt:
            self._end_in_doubt(acting, doubt)
            return
        message = "did not stop and was cut off"
        self._leave(acting, Input(Kind.STOPPED, acting.number, message=message))

    @staticmethod
    def _doubt_of(acting: _Acting) -> str:
        """Words for what an instance may still do outside; "" for nothing."""
        try:
            return clean(acting.context.doubt())
        except Exception as error:  # of a runner's own making
            return said(error)

    def _is_waited_for(self, acting: _Acting, doubt: str) -> bool:
        """True if an instance that may still act outside has some time left; it is said once."""
        now = time.monotonic()
        if not acting.until:
            acting.until = now + self._doubt_s
            line = f"{AWAITED}, for at most {self._doubt_s:g} s: {doubt}"
            self._log(acting.number, acting.context.element, line)
        return now < acting.until

    def _end_in_doubt(self, acting: _Acting, doubt: str) -> None:
        """End the run: nobody can say what an instance still does outside."""
        self.doubts.append(doubt)
        data: dict[str, RunValue] = {"left": "unknown"}
        self._log(acting.number, acting.context.element, f"{DOUBTED}: {doubt}", data)
        self.deliver(Input(Kind.CANCEL, message=f"{DOUBTED}: {doubt}"))
        self._leave(acting, Input(Kind.STOPPED, acting.number, message=DOUBTED))

    # -- lines of runners -------------------------------------------------------------------

    def _line(self, acting: _Acting, text: str, data: Mapping[str, RunValue]) -> None:
        """Take a line of a runner, in its thread; of one instance at most a thousand."""
        outputs = checked(dict(data)) if data else {}
        acting.lines += 1
        if acting.lines > _MAX_LINES + 1 and "ledger" not in outputs:  # which is short, and needed
            return
        many = acting.lines > _MAX_LINES and "ledger" not in outputs
        line = "it logs too much: no more of it" if many else clean(str(text), 10_000)
        kept = {} if many else outputs
        self._post(lambda: self._log(acting.number, acting.context.element, line, kept))

    def _not_unloaded(self, failure: str) -> None:
        self.unload_failures.append(failure)
        self._log(-1, "", failure)

    def _log(
        self, number: int, element: str, line: str, data: Mapping[str, RunValue] | None = None
    ) -> None:
        self.logs.append((self.now_us(), element, line))
        if not (self._closing or self.kernel.status.ended):
            self.mark(Input(Kind.LOG, number, outputs=data or {}, message=line))
