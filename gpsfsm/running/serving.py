"""The process that runs the plans of the service: ``python -m gpsfsm.running.serving``.

It holds the journal and the queue, which goes on after a restart. What the service asks for is done
between two events of a run, so a plan is submitted or cancelled while another one runs.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gpsfsm.capabilities.library import choose_capabilities
from gpsfsm.checking.parallel import CheckApart
from gpsfsm.errors import GpsfsmError, UsageError
from gpsfsm.execution.journal import Heading
from gpsfsm.execution.journal_errors import EmptyJournalError
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.queue import QueueFullError, QueueKind
from gpsfsm.execution.queues import VirtualQueue
from gpsfsm.execution.records import MARKS, Input, Record
from gpsfsm.running.admission import Admission, Admitted, as_text
from gpsfsm.running.drivers import MAPPED
from gpsfsm.running.history import OF_ONE_RUN, begun_run, check_versions, queues, unfinished
from gpsfsm.running.one_run import RunObserver, StderrObserver
from gpsfsm.running.pace import FAIL, ClientPace, note
from gpsfsm.running.prepare import REAL, stored
from gpsfsm.running.queue_answers import (
    ABOUT_PLANS,
    KeyedLog,
    TracedPlans,
    length_of,
    open_journal,
    to_json,
)
from gpsfsm.running.session import Session
from gpsfsm.running.worlds import NAME, Start, Starts, Worlds, choices
from gpsfsm.streams import complain
from gpsfsm.syntax import Limits
from gpsfsm.workers import limit_memory
from gpsfsm.workers.parent_link import ParentLink

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from types import TracebackType
    from typing import Self

    from gpsfsm.execution.journal import Journal
    from gpsfsm.execution.queue import PlanState, QueueRow
    from gpsfsm.generation.service import ModelService
    from gpsfsm.running.history import StoredQueue, Unfinished
    from gpsfsm.running.one_run import Run
    from gpsfsm.running.prepare import Prepared


_MOST_ATTEMPTS = 3
_NOTE_S = 0.05
_OF_WORLDS = OF_ONE_RUN | {MAPPED, NAME}


class Stopping(KeyboardInterrupt):
    """The service stops: what runs is left as it is, to go on when there is a service again.

    A kind of KeyboardInterrupt, because no driver takes that for the mistake of a runner.
    """


class ServiceQueue(StderrObserver):
    """The queue. ``keys`` are plans by the keys of requests, ``numbers`` are runs by plans.

    ``tell`` gets what the service should know at once, ``poll`` does what it has asked for.
    ``running`` is the plan that runs, and its pace.
    """

    def __init__(self, head: dict[str, Any], journal: Journal, stack: ExitStack) -> None:
        self.tell: Callable[[dict[str, Any]], None] = lambda _: None
        self.poll: Callable[[], None] = lambda: None
        self.keys: dict[str, int] = {}
        self.numbers: dict[int, int] = {}
        self.running: tuple[int, ClientPace] | None = None
        self.starts = Starts()
        self.traced = TracedPlans()
        self._head, self._stack = head, stack
        self._paces: dict[int, ClientPace] = {}
        capabilities = choose_capabilities(
            head["capabilities"], builtin=head["builtin"], robot=head.get("robot")
        )
        self._capabilities = capabilities
        offered = choices(head.get("worlds", []), capabilities.library)
        self.worlds = Worlds(offered, self.starts, complain)
        self._base = _heading(head, capabilities.library, self.worlds)
        check = stack.enter_context(CheckApart(head["check_s"])).check
        limits = Limits(**head["limits"])
        self._admission = Admission(self._base, capabilities, limits, trees=True, check=check)
        self._log = KeyedLog(journal, self.starts)
        self._session = Session(
            *(self._base, self._admission, self),
            journal=journal,
            log=self._log,
            setting=self.worlds,
            pace=self._pace,
            most_waiting=head["most_waiting"],
            most_plans=head["most_plans"],
        )
        assert isinstance(self._session.queue, VirtualQueue)
        self.queue: VirtualQueue[Admitted] = self._session.queue

    # -- what the service asks for --------------------------------------------------------------

    def full(self) -> str:
        """The reason why no plan can be taken now, though later one may; "" if one can."""
        waiting = self.queue.waiting
        most: int = self._head["most_waiting"]
        return "" if waiting < most else f"the queue is full: {waiting} plans wait"

    def submit(self, text: bytes, name: str, key: str, start: Start | None = None) -> int:
        """Queue a plan that has passed the gate of the service; when this returns it is safe."""
        self._log.key, self._log.start = key, start
        try:
            plan = self.queue.submit(as_text(text), name=name, gate=self._admission.trust)
        finally:
            self._log.key, self._log.start = "", None
        self.keys[key] = plan
        return plan

    def cancel(self, plan: int, reason: str) -> bool:
        """Cancel a plan; False if it has ended already. Raises UsageError if there is none."""
        ended = self.queue.state(plan).status.ended
        if not ended and self.running is not None and self.running[0] == plan:
            self.running[1].release()
        return self.queue.cancel(plan, reason)

    def speed(self, plan: int) -> float:
        """The speed at which a plan begins, 0 for as fast as possible."""
        speed = self.starts.of(plan).speed
        return (self._head.get("speed") or 0.0) if speed is None else speed

    def pace_of(self, state: PlanState) -> dict[str, Any]:
        """In which world a plan runs, and how fast."""
        start = self.starts.of(state.plan)
        how = {
            "world": start.world or self.worlds.own.name,
            "speed": self.speed(state.plan),
            "paused": start.paused and not state.status.ended,
            "clock_us": length_of(state),
        }
        if self.running is not None and self.running[0] == state.plan:
            pace = self.running[1]
            how |= {"speed": pace.clock.speed, "paused": pace.clock.paused}
            how["clock_us"] = pace.clock_us()
        return how

    def _pace(self, plan: int) -> ClientPace:
        pace = ClientPace(speed=self.speed(plan), paused=self.starts.of(plan).paused)
        self._paces = {plan: pace}
        return pace

    # -- for the session ------------------------------------------------------------------------

    def wrote(self, row: QueueRow) -> None:
        """Let the service know."""
        self.tell({"note": row.kind.value})

    def run_begins(self, run: Run) -> RunObserver:
        """Watch a run."""
        assert run.state is not None
        plan = run.state.plan
        self.numbers[plan] = run.number
        return _Watch(self, plan, run, self._paces[plan])

    # -- a restart ------------------------------------------------------------------------------

    def restore(self) -> None:
        """Take up what an earlier service has left. Raises GpsfsmError if that is not possible."""
        left = None
        if Path(self._head["journal"]).exists():
            try:
                with JournalReader(self._head["journal"]) as reader:
                    left = self._read(reader)
            except EmptyJournalError:
                left = None
        if self._head.get("model"):
            self.worlds.model = self._model(None if left is None else left.queue)
        for _, row in () if left is None else left.queue.rows:
            if isinstance(key := (row.data or {}).get("key"), str):
                self.keys[key] = row.plan
        self._session.take_up(left)
        for state in self.queue.states():
            if not state.status.ended and state.attempts >= _MOST_ATTEMPTS:
                ended = f"the process that ran it has ended {state.attempts} times"
                self.queue.cancel(state.plan, f"{ended}; its memory may have run out")

    def _read(self, reader: JournalReader) -> Unfinished | None:
        every = queues(reader)
        if not every:
            return None
        queue, runs, left = every[-1], every[-1].runs(), every[-1].open()
        for _, row in queue.rows:
            self.starts.take(row)
            if row.kind is QueueKind.SUBMITTED and (row.data or {}).get(REAL) is True:
                raise UsageError(
                    f"{reader.path}: the plans of this journal are for real runners; serve them "
                    "with --real, or use another journal"
                )
        self.numbers = dict(runs)
        if not runs:
            return unfinished(reader, queue, self._base, {})
        begun = next((plan for plan in left if plan in runs), 0)
        own = [plan for plan in runs if not self.starts.root(plan)]
        for plan in {begun or [*runs][-1], *own[-1:]}:
            run = reader.run(runs[plan])
            check_versions(reader.path, run, complain)
            self._refuse_others(reader.path, stored(reader, run), plan)
        of_run = {}
        if begun:
            of_run = {begun: begun_run(reader, reader.run(runs[begun]), queue)}
        ids = {each.number: each.id for each in reader.runs() if each.status.ended}
        over = {plan: ids[number] for plan, number in runs.items() if number in ids}
        self.worlds.take_up(reader.path, queue, over)
        return unfinished(reader, queue, self._base, of_run)

    def _refuse_others(self, path: str, past: Prepared, plan: int) -> None:
        """Raises UsageError if runs were made otherwise: then they cannot go on as they began."""
        heading, base = past.heading, self._base
        options = {name: each for name, each in heading.options.items() if name not in _OF_WORLDS}
        own = not self.starts.root(plan)
        differs = [
            name
            for name, before, now in (
                ("world", own and (heading.mode, heading.world), own and (base.mode, base.world)),
                ("capabilities", heading.capabilities, base.capabilities),
                ("seed", heading.seed, self.starts.seed(plan, base.seed)),
                ("options", options, dict(base.options)),
            )
            if before != now
        ]
        if differs:
            raise UsageError(
                f"{path}: the plans of this journal were run with other settings "
                f"({', '.join(differs)}); use those, or another journal"
            )

    def _model(self, past: StoredQueue | None) -> ModelService:
        """The model that the service names. Raises GpsfsmError if it cannot be asked."""
        from gpsfsm.generation.language_model import PollingModel
        from gpsfsm.generation.providers import Configured, settings_of
        from gpsfsm.running.model_access import model_left, model_of_run

        head = self._head
        settings = settings_of(head["model"], configured=Configured(**head["model_files"]))
        if not settings.spec:
            raise UsageError("no model is named")
        numbers = [] if past is None else [*past.runs().values()]
        if not numbers:
            service = model_of_run(self._base, settings, self._capabilities, self._stack)
        else:
            with JournalReader(head["journal"]) as reader:
                run = reader.run(numbers[-1])
                state = stored(reader, run), past, self._stack
                left = model_left(reader, run, settings, state)
            assert left is not None
            service = left
        service.model = PollingModel(service.model, self._poll_now)
        return service

    def _poll_now(self) -> None:
        """Call the ``poll`` of this moment."""
        self.poll()

    @property
    def run_s(self) -> float:
        """The time that a run may take, in seconds of a clock on the wall."""
        seconds: float = self._head["run_s"]
        return seconds


class _Watch(RunObserver):
    """Sees to the service while a run goes on, and to the time."""

    def __init__(self, served: ServiceQueue, plan: int, run: Run, pace: ClientPace) -> None:
        self._served, self._plan, self._run, self._pace = served, plan, run, pace
        self._until_s = time.monotonic() + served.run_s
        self._noted_s = 0.0
        self._untold = False  # something has happened since
        self._over = False

    def __enter__(self) -> Self:
        self._served.running = (self._plan, self._pace)
        assert self._run.state is not None
        self._traced = self._served.traced.begun(self._run.state)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._served.running = None
        if (spans := self._traced()) is not None:
            self._served.tell(spans)

    def __call__(self, _at_us: int, happened: Input, _records: Sequence[Record]) -> None:
        """Something has happened in the run."""
        if self._pace.in_past:
            return  # nothing may intervene there
        self._untold = True
        self._tell()
        if happened.kind not in MARKS:  # inside of a runner nothing may intervene, either
            self.tick(0)

    def tick(self, _now_us: int) -> None:
        """See what the service has asked for, and what time it is."""
        self._tell()
        ended = self._run.kernel.status.ended
        if time.monotonic() > self._until_s and not self._over and not ended:
            self._over = True
            self._served.cancel(self._plan, f"it took more than {self._served.run_s:g} s")
        self._served.poll()

    def _tell(self) -> None:
        now_s = time.monotonic()
        soon = now_s - self._noted_s <= _NOTE_S and not self._run.kernel.status.ended
        if self._untold and not soon:
            self._noted_s, self._untold = now_s, False
            self._served.tell({"note": "EVENT"})


def _heading(head: dict[str, Any], library: Any, worlds: Worlds) -> Heading:
    """The part that the headings of all runs have in common."""
    from gpsfsm.capabilities.table import dump

    return Heading(
        plan=b"",
        capabilities=dump(library),
        world=worlds.own.content,
        seed=head.get("seed", 0),
        mode=worlds.own.mode,
        options=head.get("options", {}),
    )


_STOP_S = 5.0


def main() -> int:
    """Run plans until the service ends."""
    link = ParentLink(_stop_soon)
    head, _ = link.messages.get()
    if head.get("op") == "stop":
        return 0
    limit_memory(head["memory_mb"])
    try:
        with ExitStack() as stack:
            served = ServiceQueue(head, open_journal(head, stack), stack)
            served.tell = link.send
            served.poll = lambda: _poll(link, served)
            served.restore()
            link.send({"ready": True})
            _serve(link, served)
    except Stopping:
        return 0
    except GpsfsmError as error:
        link.send({"failed": str(error)})
        return 2
    return 0


def _stop_soon(link: ParentLink) -> None:
    """The service has gone: stop between two events, or at once if none comes for a while."""
    link.messages.put(({"op": "stop"}, b""))
    timer = threading.Timer(_STOP_S, os._exit, (0,))
    timer.daemon = True
    timer.start()


def _serve(link: ParentLink, served: ServiceQueue) -> None:
    while True:
        served.queue.run_all()
        _answer(link, served, *link.messages.get())


def _poll(link: ParentLink, served: ServiceQueue) -> None:
    """Do what the service has asked for meanwhile."""
    while not link.messages.empty():
        _answer(link, served, *link.messages.get())


def _answer(link: ParentLink, served: ServiceQueue, head: dict[str, Any], body: bytes) -> None:
    if head["op"] == "stop":
        raise Stopping

    def say(answer: dict[str, Any]) -> None:
        link.send({"id": head["id"], **answer})

    try:
        if head["op"] == "control":
            _control(served, head, say)
        else:
            say(_OPS[head["op"]](served, head, body))
    except QueueFullError as error:
        say({"problem": 507, "detail": f"{error}; start with a new journal"})
    except UsageError as error:
        say({"problem": 404, "detail": str(error)})


def _submit(served: ServiceQueue, head: dict[str, Any], body: bytes) -> dict[str, Any]:
    plan = served.keys.get(head["key"])
    if plan is None:
        if why := served.full():
            return {"problem": 429, "detail": why, "retry_s": 5}
        start = Start.of(head.get("start") or {}, "")
        if start is not None and start.world and start.world not in served.worlds.offered:
            return {"problem": 422, "detail": f"start: there is no world '{start.world:.60}'"}
        plan = served.submit(body, head["name"], head["key"], start)
        served.traced.submitted(plan, head)
    return to_json(served, served.queue.state(plan))


def _cancel(served: ServiceQueue, head: dict[str, Any], _: bytes) -> dict[str, Any]:
    done = served.cancel(head["plan"], head["reason"])
    return {**to_json(served, served.queue.state(head["plan"])), "done": done}


def _control(
    served: ServiceQueue, head: dict[str, Any], say: Callable[[dict[str, Any]], None]
) -> None:
    """Do something to the run of a plan. It is in the journal when that is said."""

    def answer(why: str) -> None:
        state = to_json(served, served.queue.state(head["plan"]))
        say({**state, "done": not why, "why": why})

    if served.running is None or served.running[0] != head["plan"]:
        answer("the plan is not running")
    elif why := _wished(served.running[1], head, answer):
        answer(why)


def _wished(pace: ClientPace, head: dict[str, Any], done: Callable[[str], None]) -> str:
    what, number, message = head["what"], -1, ""
    if what == FAIL:
        number = _instance(pace, head)
        if number < 0:
            return "the plan has no such runner"
        message = head.get("message") or "a client has let it fail"
    speed, events = head.get("speed") or 0.0, head.get("events", 1)
    return pace.wish(note(what, number=number, speed=speed, events=events, message=message), done)


def _instance(pace: ClientPace, head: dict[str, Any]) -> int:
    """The number of the runner that a node or an element stands for; -1 for none."""
    automaton = pace.driver.kernel.automaton
    for node in automaton.runners:
        if node.index == head.get("node") or automaton.name(node.index) == head.get("element"):
            return automaton.runner_number(node.index)
    return -1


def _worlds(served: ServiceQueue, _head: dict[str, Any], _: bytes) -> dict[str, Any]:
    worlds = [each.to_json() for each in served.worlds.offered.values()]
    return {"worlds": [{**each, "default": not place} for place, each in enumerate(worlds)]}


def _world(served: ServiceQueue, head: dict[str, Any], _: bytes) -> dict[str, Any]:
    """The outline of a world for a map."""
    choice = served.worlds.offered.get(head["world"])
    if choice is None or not choice.content:
        return {"problem": 404, "detail": "there is no such world"}
    from gpsfsm.simulation.load import read_world
    from gpsfsm.simulation.world import outline

    return {"outline": {"world": choice.name, **outline(read_world(choice.content))}}


_OPS = {
    "submit": _submit,
    "cancel": _cancel,
    **ABOUT_PLANS,
    "worlds": _worlds,
    "world": _world,
}


if __name__ == "__main__":
    sys.exit(main())
