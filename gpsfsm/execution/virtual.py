"""Virtual time: runners run as coroutines on a clock that jumps from event to event.

Ready events are ordered by (time, sequence number). The coroutines are driven here and not by
asyncio, so nothing but the plan, the runners and the seed decides what comes first.
"""

from __future__ import annotations

import heapq
import random
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import GpsfsmError, InternalError
from gpsfsm.execution.host import DependencyError, Host, Loaded, Sink
from gpsfsm.execution.records import UNFINISHED, Input, Kind, Start, Status
from gpsfsm.execution.runner import (
    LoadContext,
    RunContext,
    Runner,
    RunnerError,
    StopRequested,
    checked,
    clean,
    close,
    said,
    seeded,
    taken,
    visited,
)
from gpsfsm.late import collecting_rarely

if TYPE_CHECKING:
    from collections.abc import Callable, Coroutine, Generator, Mapping, Sequence

    from gpsfsm.execution.host import Key
    from gpsfsm.execution.kernel import Kernel
    from gpsfsm.execution.records import RunValue

_SECOND = 1_000_000
_LONGEST_S = 1e12  # MAX_AMOUNT: what sleeps longer sleeps for ever
_LAST_US = 9 * 10**18  # as far as a journal counts
_NEVER = 2 * _LAST_US + 10**18  # due so late is what sleeps for ever, and nothing else
_MAX_LINES = 1_000  # that one instance may log
_CUT_OFF = "did not stop and was cut off"
_GOES_ON = "it goes on after its end (it catches GeneratorExit) and gets no further turn"


class _Sleep:
    """The request that ``await context.sleep(…)`` hands to the driver."""

    __slots__ = ("_awaited", "duration_us")

    def __init__(self, duration_us: int) -> None:
        self.duration_us = duration_us
        self._awaited = False

    def __await__(self) -> Generator[_Sleep, None, None]:
        return self  # type: ignore[return-value]  # light, since very many sleep at once

    def __next__(self) -> _Sleep:
        if self._awaited:
            raise StopIteration
        self._awaited = True
        return self


def _sleep(seconds: float) -> _Sleep:
    """A sleep takes a microsecond at least, so that time goes on for those who never end."""
    if not seconds >= 0:
        raise ValueError("a duration is not negative")
    return _Sleep(max(round(seconds * _SECOND), 1) if seconds < _LONGEST_S else _NEVER)


class _Action:
    """An instance that acts, or that is to stop and may take its grace time.

    It has begun at ``began_us`` and goes on, or ends, at ``due_us``.
    """

    __slots__ = ("began_us", "context", "coroutine", "due_us", "runner", "sleeps", "stopping")

    def __init__(
        self, coroutine: Coroutine[Any, Any, Any], context: RunContext, runner: int, began_us: int
    ) -> None:
        self.coroutine = coroutine
        self.context = context
        self.runner = runner
        self.sleeps = 0
        self.stopping = False
        self.began_us = self.due_us = began_us


class _Context(RunContext):
    """A context that makes rarely used parts on demand: a random source is 2.5 kB large."""

    __slots__ = ("_driver", "_random", "_visit")

    def __init__(self, driver: VirtualDriver, number: int, visit: int) -> None:
        self._driver = driver
        self._visit = visit
        self._random: random.Random | None = None
        self.number = number
        self.sleeper = _sleep
        self.clock = driver.now_s
        self.logger = self._log
        self.stop_requested = False

    def sleep(self, seconds: float) -> _Sleep:  # type: ignore[override]
        return _sleep(seconds)

    @property
    def element(self) -> str:  # type: ignore[override]
        automaton = self._driver.kernel.automaton
        return automaton.name(automaton.runner_node(self.number))

    @property
    def key(self) -> str:  # type: ignore[override]
        return f"{self._driver.seed}:{visited(self.element, self._visit)}"

    @property
    def random(self) -> random.Random:  # type: ignore[override]
        if self._random is None:
            plan = self._driver.kernel.automaton.fingerprint  # other plans meet another fate
            self._random = seeded(f"{self.key}:{plan}")
        return self._random

    def _log(self, text: str, data: Mapping[str, RunValue]) -> None:
        self._driver.log(self.number, self.element, text, data)


class Pacing:
    """The pace of a run in virtual time: this one is as fast as possible."""

    def before_event(self, _driver: VirtualDriver) -> bool:
        """Wait until the next event may happen; True if something else was done instead."""
        return False

    def after_event(self, driver: VirtualDriver) -> None:
        """An event has happened."""

    def noted(self, driver: VirtualDriver, note: Input) -> None:
        """A NOTE has been written; what it says is done now."""


class VirtualDriver(Host):
    """Runs a plan in virtual time.

    ``make`` gives the runner for an interface and provider, ``depends_on`` what must be loaded
    before it; ``timeout_s`` bounds each action (None: not at all), and so does ``max_sleeps``;
    ``grace_s`` is how long a stopping instance may take. ``pace`` decides when the next event
    happens. Runners in ``no_start`` are never loaded, which is said at that time (microseconds):
    the kernel must have a runner for each instance then.
    A runner that computes for ever cannot be interrupted.
    """

    def __init__(
        self,
        kernel: Kernel,
        sink: Sink,
        make: Callable[[str, str], Runner],
        *,
        seed: int = 0,
        services: Mapping[str, Any] | None = None,
        depends_on: Callable[[str, str], Sequence[Key]] = lambda _interface, _provider: (),
        timeout_s: float | None = None,
        grace_s: float = 5.0,
        max_sleeps: int = 1_000_000,
        pace: Pacing | None = None,
        no_start: Mapping[int, int] | None = None,
    ) -> None:
        super().__init__(kernel, sink)
        self.pace = pace or Pacing()
        self.inputs = 0  # how many the kernel has taken in
        self._no_start = no_start or {}
        self._turn = -1  # the instance that acts now, or did last
        self._abandoned = False
        self._make = make
        self.seed = seed
        self._services = services or {}
        self._timeout_us = None if timeout_s is None else round(timeout_s * _SECOND)
        self._grace_us = round(grace_s * _SECOND)
        self._max_sleeps = max_sleeps
        self._now_us = 0
        self._sequence = 0
        self._ready: list[tuple[int, int, Callable[..., None], tuple[Any, ...]]] = []
        self._runners: dict[int, Runner] = {}
        self._loaded = Loaded(self._load, self._let_go, depends_on)
        self._acting: dict[int, _Action] = {}
        self._busy: dict[int, int] = {}  # runner: how many instances act
        self._unwanted: dict[int, None] = {}  # runners to unload once they are not busy any more
        self._lines: dict[int, int] = {}  # instance: how many lines it has logged
        self.logs: list[tuple[int, str, str]] = []  # time, element, text
        self.cut_off: set[int] = set()  # instances that did not stop in time
        self.unload_failures: list[str] = []

    def now_us(self) -> int:
        """The virtual time."""
        return self._now_us

    def now_s(self) -> float:
        """The virtual time in seconds."""
        return self._now_us / _SECOND

    def next_us(self) -> int | None:
        """When the next event happens; None if nothing happens by itself."""
        return self._ready[0][0] if self._ready and self._ready[0][0] < _NEVER else None

    def pass_to(self, at_us: int) -> None:
        """Let time pass, if nothing happens until then."""
        following = self.next_us()
        if at_us > self._now_us and (following is None or at_us < following):
            self._now_us = at_us

    def at(self, at_us: int, action: Callable[..., None], *arguments: Any) -> None:
        """Do something at a time, after everything that was planned for it before."""
        self._sequence += 1
        heapq.heappush(self._ready, (at_us, self._sequence, action, arguments))

    def run(self) -> None:
        """Run until the plan has ended. A plan in which only silence is left is stuck."""
        with collecting_rarely():
            try:
                self._run()
            finally:
                self.abandon()

    def _run(self) -> None:
        kernel = self.kernel
        self.deliver(Input(Kind.BEGIN))
        while kernel.status in UNFINISHED:
            if not self.advance():
                if kernel.status is not Status.RUNNING:
                    raise InternalError("a run that is to stop does not end")
                self.deliver(Input(Kind.SILENCE))

    def advance(self) -> bool:
        """Let the next event happen, when its pace allows it; False if there is none.

        Raises GpsfsmError if it would come later than any time that can be written down.
        """
        if self.pace.before_event(self):
            return True
        moved = self._happen()
        self.pace.after_event(self)
        return moved

    def _happen(self) -> bool:
        at_us = self.next_us()
        if at_us is None:
            return False
        if at_us > _LAST_US:
            raise GpsfsmError(
                f"the run takes more than {_LAST_US / _SECOND:.3g} s, the longest time that "
                "gpsfsm counts; shorten the durations"
            )
        assert at_us >= self._now_us, "virtual time never goes back"
        self._now_us, _, action, arguments = heapq.heappop(self._ready)
        action(*arguments)
        return True

    def _deliver(self, happened: Input) -> None:
        self.inputs += 1
        super()._deliver(happened)

    def mark(self, happened: Input) -> None:
        """Write down what changes nothing in the run; what a NOTE says is then done."""
        if self._abandoned:  # whatever runners do then is no part of the run
            return
        super().mark(happened)
        if happened.kind is Kind.NOTE:
            self.pace.noted(self, happened)

    def tell(self, what: str, data: Mapping[str, RunValue], words: str, /) -> None:
        """Write down what has happened in the world, for those who draw a map of the run."""
        number = self._turn
        count = self._lines[number] = self._lines.get(number, 0) + 1
        if count <= _MAX_LINES and not self.kernel.status.ended:
            self.mark(Input(Kind.LOG, number, outputs={"world": what, **data}, message=words))

    def may_fail(self, number: int) -> bool:
        """True if ``fail`` would do anything that nothing else has done already."""
        return number in self._acting and number not in self.kernel.overdue

    def fail(self, number: int, message: str) -> None:
        """Let an instance fail that acts; nothing happens to one that does not."""
        action = self._acting.get(number)
        if action is not None and not action.stopping:
            self._give_up(number, message)

    def abandon(self) -> None:
        """Stop all that still acts, the last one first, and let go of the runners."""
        self._abandoned = True
        acting = list(self._acting.values())
        self._acting.clear()
        for action in reversed(acting):
            if not _close(action):  # nothing may be writable any more
                self.logs.append((self._now_us, action.context.element, _GOES_ON))
        self._busy.clear()
        for runner in reversed([*self._runners]):
            self._unload(runner)

    # -- runners ----------------------------------------------------------------------------

    def load(self, runner: int) -> None:
        """Load at once; a runner cannot wait for anything here."""
        if runner in self._no_start:
            failed = Input(Kind.NOT_LOADED, runner=runner, message="the scenario says so")
            self.at(max(self._now_us + 1, self._no_start[runner]), self.deliver, failed)
            return
        try:
            made = self._loaded.acquire(*self._place(runner))
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # whatever a runner raises
            message = str(error) if isinstance(error, DependencyError) else said(error)
            self.refuse(runner, message, 1)
        else:
            self._runners[runner] = made
            self.at(self._now_us, self.deliver, Input(Kind.LOADED, runner=runner))

    def refuse(self, runner: int, message: str, after_us: int) -> None:
        """Say after a time that a runner cannot be loaded: no instance fails as it is triggered."""
        waiting = self.kernel.waiting_for(runner)
        self.at(self._now_us + after_us, self._refused, runner, message, waiting)

    def _refused(self, runner: int, message: str, waiting: int) -> None:
        if self.kernel.waiting_for(runner) > waiting:  # some since this very instant, it may be
            self.refuse(runner, message, 1)
        else:
            self.deliver(Input(Kind.NOT_LOADED, runner=runner, message=message))

    def _place(self, runner: int) -> tuple[Key, int]:
        """Its key, and with it its number where each instance has a runner to itself."""
        return self.kernel.runners[runner], runner if self.kernel.apart else -1

    def _load(self, key: Key) -> Runner:
        made = self._make(*key)
        _finish(made.start(LoadContext(*key, self._services)))
        return made

    def unload(self, runner: int) -> None:
        """Unload, once the last instance that is to stop has stopped."""
        if self._busy.get(runner):
            self._unwanted[runner] = None
        else:
            self._unload(runner)

    def _unload(self, runner: int) -> None:
        """Unload a runner; errors are only logged."""
        if self._runners.pop(runner, None) is not None:
            self._loaded.release(*self._place(runner))

    def _let_go(self, made: Runner) -> None:
        try:
            _finish(made.stop())
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            failure = f"unloading: {said(error)}"
            self.unload_failures.append(failure)
            self.logs.append((self._now_us, "", failure))

    def log(self, number: int, element: str, text: str, data: Mapping[str, RunValue]) -> None:
        """Keep a line; of one instance at most a thousand."""
        outputs = checked(dict(data)) if data else {}
        count = self._lines[number] = self._lines.get(number, 0) + 1
        if count > _MAX_LINES + 1:
            return
        line = clean(str(text), 10_000)
        if count > _MAX_LINES:
            line, outputs = "it logs too much: no more of it", {}
        self.logs.append((self._now_us, element, line))
        if not self.kernel.status.ended:
            self.mark(Input(Kind.LOG, number, outputs=outputs, message=line))

    def start(self, command: Start) -> None:
        """Begin the coroutine of an instance, once all that was planned for now is done."""
        number = command.number
        context = _Context(self, number, command.visit)
        runner = self._runners[command.runner]
        coroutine = _acting(runner, command.parameters, context)
        action = _Action(coroutine, context, command.runner, self._now_us)
        self._acting[number] = action
        self._busy[command.runner] = self._busy.get(command.runner, 0) + 1
        self.at(self._now_us, self._go_on, number, action)
        if self._timeout_us is not None:
            self.at(self._now_us + self._timeout_us, self._time_out, number, action)

    def _go_on(self, number: int, action: _Action, throw: BaseException | None = None) -> None:
        """Let an instance act until it sleeps or ends."""
        if self._acting.get(number) is not action:
            return
        coroutine = action.coroutine
        self._turn = number
        try:
            request = coroutine.send(None) if throw is None else coroutine.throw(throw)
        except StopIteration as ended:
            self._ended(number, action, ended.value)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # whatever a runner raises
            self._failed(number, action, error)
        else:
            action.sleeps += 1
            if not isinstance(request, _Sleep):
                self._give_up(number, "it awaits something that is not of its context")
            elif action.sleeps > self._max_sleeps:
                self._give_up(number, f"it has slept {self._max_sleeps:,} times without an end")
            else:
                action.due_us = self._now_us + request.duration_us
                self.at(action.due_us, self._go_on, number, action)

    def _ended(self, number: int, action: _Action, outputs: object) -> None:
        try:
            happened = Input(Kind.SUCCEEDED, number, outputs=taken(outputs))
        except ValueError as error:
            happened = Input(Kind.FAILED, number, message=str(error))
        self._over(number, action, happened)

    def _failed(self, number: int, action: _Action, error: BaseException) -> None:
        if not isinstance(error, RunnerError):
            self._over(number, action, Input(Kind.FAILED, number, message=said(error)))
            return
        try:
            outputs = taken(getattr(error, "outputs", None))
        except ValueError:
            outputs = {}
        message = said(error).removeprefix(f"{type(error).__name__}: ")
        happened = Input(Kind.FAILED, number, outputs=outputs, message=message)
        self._over(number, action, happened)

    def _over(self, number: int, action: _Action, happened: Input) -> None:
        """A duration is positive: the outcome never comes at the instant of the start."""
        if self._now_us == action.began_us and not action.stopping:
            action.due_us = self._now_us + 1
            self.at(action.due_us, self._delayed, number, action, happened)
        else:
            self._leave(number, happened)

    def _delayed(self, number: int, action: _Action, happened: Input) -> None:
        if self._acting.get(number) is action:
            self._leave(number, happened)

    def _give_up(self, number: int, message: str) -> None:
        """An instance that cannot go on fails."""
        if number in self._acting:
            self._end(self._acting[number])
        self._leave(number, Input(Kind.FAILED, number, message=message), _CUT_OFF)

    def _leave(self, number: int, happened: Input, how: str = "stopped") -> None:
        """An instance has ended, or has stopped if that is what it was to do."""
        action = self._acting.pop(number, None)
        if action is None:  # abandoned while it acted
            return
        self._busy[action.runner] -= 1
        if action.runner in self._unwanted and not self._busy[action.runner]:
            del self._unwanted[action.runner]
            self._unload(action.runner)
        if action.stopping:  # not at once: the host may be about to stop others
            if how is _CUT_OFF:
                self.cut_off.add(number)
            answer = Input(Kind.STOPPED, number, message=how)
            self.at(self._now_us, self.deliver, answer)
        else:
            self.deliver(happened)

    def _time_out(self, number: int, action: _Action) -> None:
        if self._acting.get(number) is action and not action.stopping:
            self.deliver(Input(Kind.TIMEOUT, number, message="its time is over"))

    def stop(self, number: int) -> None:
        """Ask it to stop; whatever it does then, after the grace time it is gone.

        What ends by itself at the very instant at which the run ends is not stopped: its outcome
        comes then, and it is not active any more (semantics, 4.4).
        """
        action = self._acting.get(number)
        if action is not None and action.due_us == self._now_us and self._ends:
            self.at(self._now_us, self._stop, number)
        else:
            self._stop(number)

    @property
    def _ends(self) -> bool:
        return self.kernel.ending in (Status.COMPLETED, Status.GAVE_UP)

    def _stop(self, number: int) -> None:
        action = self._acting.get(number)
        if action is None or action.stopping:
            return
        if action.coroutine.cr_running:  # type: ignore[attr-defined]  # it has asked for that itself
            self.at(self._now_us, self._stop, number)
            return
        action.stopping = action.context.stop_requested = True
        # what it still waits for is forgotten: another _Action that goes on in its place
        going_on = _Action(action.coroutine, action.context, action.runner, action.began_us)
        going_on.stopping, going_on.sleeps = True, action.sleeps
        self._acting[number] = going_on
        self.at(min(self._now_us + self._grace_us, _LAST_US), self._cut_off, number, going_on)
        self._go_on(number, going_on, StopRequested())

    def _cut_off(self, number: int, action: _Action) -> None:
        if self._acting.get(number) is action:
            self._end(action)
            self._leave(number, Input(Kind.STOPPED, number), _CUT_OFF)

    def _end(self, action: _Action) -> None:
        self._turn = action.context.number
        if not _close(action):
            action.context.log(_GOES_ON)


async def _acting(runner: Runner, parameters: Mapping[str, Any], context: RunContext) -> object:
    """Act; what goes wrong before a coroutine is there goes wrong inside of this one."""
    return await runner.run(parameters, context)


def _close(action: _Action) -> bool:
    """Let an action end here and now; whether it agrees."""
    action.context.stop_requested = True
    with suppress(BaseException):
        if not action.stopping:
            action.coroutine.throw(StopRequested())
    return close(action.coroutine)


def _finish(awaited: Coroutine[Any, Any, None] | None) -> None:
    """Run a coroutine that does not wait for anything."""
    if awaited is None:  # it was no coroutine, and has done all it has to do
        return
    try:
        awaited.send(None)
    except StopIteration:
        return
    close(awaited)
    raise RunnerError("in virtual time a runner must not wait while it is loaded or unloaded")
