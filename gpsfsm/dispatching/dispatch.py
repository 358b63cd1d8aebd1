"""One plan, dispatched to a Fabric server: gated, submitted, followed to its end, explained.

The status is requested now and then; events of the Capabilities2 server, where they can
be received, drive a mirror of the run (``mirror.py``), which is journaled. Whatever does not answer
has a deadline.
"""

from __future__ import annotations

import json
import os
import queue
import time
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from gpsfsm.capabilities.table import dump
from gpsfsm.compile.engine_text import EngineReading, read_for_engine
from gpsfsm.dispatching.explanation import explained, quiet
from gpsfsm.dispatching.gate_node import for_engine, is_machine
from gpsfsm.dispatching.mirror import Attribution, Mirror, Trace, instances
from gpsfsm.errors import GpsfsmError
from gpsfsm.execution.journal import Heading
from gpsfsm.execution.records import Status
from gpsfsm.gating import Gate
from gpsfsm.model.printable import clip
from gpsfsm.model.report import Report
from gpsfsm.model.ros import NETWORK
from gpsfsm.report import RenderOptions, render
from gpsfsm.ros.fabric import EVENTS, PUBLIC, WAIT_S, Code, Fabric, subscribe
from gpsfsm.ros.node import RosError, RosNode
from gpsfsm.running.interruption import REASON
from gpsfsm.running.prepare import FABRIC, prepare
from gpsfsm.streams import complain, emit, form_of, to_stderr
from gpsfsm.watch.console import View, header
from gpsfsm.watch.record_text import Words

if TYPE_CHECKING:
    from gpsfsm.execution.host import Sink
    from gpsfsm.execution.journal import Journal
    from gpsfsm.gating import GateOptions, Verdict
    from gpsfsm.model.ros import RosSettings
    from gpsfsm.ros.fabric import PlanStatus, RunnerEvent
    from gpsfsm.running.interruption import Interruption
    from gpsfsm.running.prepare import Prepared

_POLL_S = 0.5
_ANSWER_S = 2.0
_SUBMIT_S = 60.0
"""For the id of a plan: behind the names there may be a gate, which decides first."""
_SILENT_POLLS = 3
"""Polls without an answer, or without a status, after which the server counts as gone."""
_SETTLE_S = 1.5
"""For events to arrive that were sent before a status, and the other way round."""
_QUEUED_S = 4.0
_QUIET_S = 60.0
"""Without an event, after which it is said what may be the matter."""
_MOST_EVENTS = 100_000

_EARLY = (Code.QUEUED, Code.PARSING, Code.VALIDATING)

_QUEUE_ENDED = (
    "the plan is still QUEUED: another plan runs, or the thread that takes plans out of the queue "
    "has ended, as that of Fabric V2 does whenever the queue is empty; then no plan runs "
    "until the server is restarted"
)
_LOST_SIGHT = (
    "Fabric V3 does not report the status of a running plan (UNKNOWN); it is followed by the "
    "events of its runners alone"
)
_V2_CANCEL = (
    "Fabric V2 reports that it has cancelled the plan, but does not: it keeps waiting for the end "
    "of the plan, and so do all plans behind it, until the server is restarted"
)


@dataclass(frozen=True, kw_only=True)
class Dispatch:
    """The settings of a dispatch. ``root`` are the server's names, ``events`` is the topic."""

    options: GateOptions
    ros: RosSettings
    budget_ms: int
    memory_mb: int
    root: str = PUBLIC
    events: str = EVENTS
    wait_s: float = WAIT_S
    timeout_s: float | None = None
    output_format: str = "auto"
    verbose: bool = False


@dataclass(frozen=True, slots=True)
class Outcome:
    """The end of a dispatch: the status of the run, sentences about it, and the exit code."""

    status: str
    explanation: tuple[str, ...]
    code: int


def dispatch(
    settings: Dispatch,
    text: bytes,
    name: str,
    journal: Journal | None,
    interruption: Interruption,
) -> int:
    """Dispatch a plan; the exit code as of ``gpsfsm run``. Raises GpsfsmError if it cannot be."""
    plan = _as_message(text, name)
    with ExitStack() as stack:
        node = RosNode(settings.ros, "gpsfsm_dispatch", threads=3, on_error=_odd_message)
        stack.callback(node.close)
        fabric = Fabric.at(node, settings.root, settings.wait_s, lambda: interruption.requested)
        options = for_engine(settings.options, fabric.release.engine)
        with Gate(options, budget_ms=settings.budget_ms, memory_mb=settings.memory_mb) as gate:
            verdict = gate(text, name)
        if not verdict or is_machine(verdict):
            return _refused(verdict, name)
        run = _Run(settings, options, fabric, text, name)
        return run.go(node, plan, journal, interruption)


def _as_message(text: bytes, name: str) -> str:
    """The text as a message holds it: what is submitted must be what was decided about."""
    try:
        plan = text.decode()
    except UnicodeDecodeError as error:
        raise GpsfsmError(
            f"{name}: byte {error.start + 1:,} is not UTF-8, and nothing else can be submitted"
        ) from None
    if "\0" in plan:
        raise GpsfsmError(f"{name}: it holds the character U+0000, behind which nothing is sent")
    return plan


def _odd_message(error: Exception) -> None:
    complain(f"a message of ROS 2 was dropped: {type(error).__name__}: {clip(str(error), 200)}")


def _refused(verdict: Verdict, name: str) -> int:
    """Write why a plan is not submitted."""
    if verdict.report is not None and verdict.findings:
        shown = Report((replace(verdict.report, findings=verdict.findings),))
        to_stderr(render(shown, options=RenderOptions(quiet=True)))
    if verdict:
        complain(f"{name}: it is a machine, and Fabric runs plans only: it is not submitted")
    else:
        complain(f"{name}: {verdict}, so it is not submitted: {clip(verdict.message, 500)}")
    return verdict.reason.exit_code or 1


class _Nowhere:
    """The sink of a run that nobody journals."""

    def write(self, *_: object) -> None:
        """Keep nothing."""


class _Run:
    """One plan that is gated: its submission, and all that comes after."""

    def __init__(
        self, settings: Dispatch, options: GateOptions, fabric: Fabric, text: bytes, name: str
    ) -> None:
        self.settings, self.fabric, self.name = settings, fabric, name
        check = options.check
        library = check.described.library
        engine = fabric.release.engine
        of_run: dict[str, Any] = {
            **{"engine": engine, "fabric": fabric.release.name, "server": fabric.root},
            NETWORK: settings.ros.network(os.environ),
        }
        heading = Heading(
            plan=text,
            file=name,
            capabilities=dump(library),
            mode=FABRIC,
            options=of_run,
        )
        self.prepared: Prepared = prepare(heading, library, check.limits)
        reading = read_for_engine(text, engine, name, library, check.limits)
        assert isinstance(reading, EngineReading), "what was prepared is accepted by the engine"
        self._instances = instances(reading)
        self._events: queue.SimpleQueue[RunnerEvent | None] = queue.SimpleQueue()
        self._has_events = False
        self._cancelled = ""
        self._said: set[str] = set()

    def go(
        self, node: RosNode, plan: str, journal: Journal | None, interruption: Interruption
    ) -> int:
        """Submit the plan and follow it to its end."""
        self._listen(node)
        kernel = self.prepared.kernel()
        sink: Sink = _Nowhere()
        if journal is not None:
            sink = journal.begin(kernel, self.prepared.heading)
        self.trace, self.attribution = Trace(), Attribution(self._instances)
        self.mirror = Mirror(kernel, sink, self.attribution)
        view = View(
            self.settings.output_format,
            kernel,
            header=header(self.prepared.heading),
            verbose=self.settings.verbose,
            at_once=True,
        )
        with view:
            self.mirror.watchers += [self.trace, view]
            if interruption.requested:
                self.mirror.cancel(REASON)
                complain(f"{self.name}: {REASON}, so it is not submitted")
                return 130
            self.plan_id = self.attribution.plan_id = self._submitted(plan)
            try:
                self._note(f"submitted to {self.fabric.release}", fabric_plan=self.plan_id)
                interruption.on_request = lambda: self._events.put(None)
                outcome = self._followed(interruption, view)
            except BaseException:  # nobody follows the plan any more: it must not go on alone
                with suppress(RosError):
                    self.fabric.cancel(self.plan_id, _ANSWER_S)
                raise
        self._show(outcome, view)
        return outcome.code

    def _submitted(self, plan: str) -> str:
        """The id of the plan. Raises GpsfsmError if the server rejects it."""
        unsure = "the server may have taken the plan, and it may run"
        try:
            plan_id, error = self.fabric.submit(plan, _SUBMIT_S)
        except RosError as trouble:
            self._note(f"{trouble}: {unsure}")
            raise GpsfsmError(f"{self.name}: {trouble}: {unsure}") from None
        except KeyboardInterrupt:
            complain(f"{self.name}: {unsure}")
            raise
        if plan_id:
            return plan_id
        why = f"{self.fabric.release} rejects the plan: {clip(error, 500) or 'without a reason'}"
        self.mirror.reported(Status.REFUSED, why)
        raise GpsfsmError(f"{self.name}: {why}")

    def _listen(self, node: RosNode) -> None:
        def take(event: RunnerEvent) -> None:
            if self._events.qsize() < _MOST_EVENTS:
                self._events.put(event)

        try:
            subscribe(node, self.settings.events, take)
            self._has_events = True
        except RosError as error:
            complain(f"only the status of the plan can be followed: {error}")

    # -- following ------------------------------------------------------------------------------

    def _followed(self, interruption: Interruption, view: View) -> Outcome:
        """The end of the run."""
        mirror = self.mirror
        began = quiet = time.monotonic()
        end = None if self.settings.timeout_s is None else began + self.settings.timeout_s
        last, unknown = Code.QUEUED, 0
        while True:
            if interruption.requested or (end is not None and time.monotonic() >= end):
                return self._cancel(REASON if interruption.requested else "its time is up")
            earlier = self._events.qsize()  # while it is QUEUED, they are about other plans
            try:
                status = self._status(interruption)
            except RosError as error:
                return self._lost(str(error))
            if status is None:
                continue
            code = status.code
            if code is not last:
                self._note(f"the status is {code.name}", fabric=code.name)
                last, quiet = code, time.monotonic()
            if code in _EARLY:
                self._wait_for_turn(code, began, interruption, earlier)
                continue
            outcome = self._ended(status)
            if outcome is not None:
                return outcome
            if self._take_events(_POLL_S):
                quiet = time.monotonic()
            if mirror.kernel.status.ended:
                return self._settled()
            view.tick(mirror.now_us())
            silent_s = time.monotonic() - quiet
            unknown = unknown + 1 if code is Code.UNKNOWN else 0
            if self._is_forgotten(unknown, silent_s):
                return self._forgotten()
            if code in (Code.RUNNING, Code.UNKNOWN) and silent_s > _QUIET_S:
                self._tell_quiet()

    def _status(self, interruption: Interruption) -> PlanStatus | None:
        """The status; None if somebody wants to stop. Raises RosError if no answer comes."""
        for attempt in range(_SILENT_POLLS):
            try:
                return self.fabric.status(self.plan_id, _ANSWER_S)
            except RosError:
                if interruption.requested:
                    return None
                if attempt == _SILENT_POLLS - 1:
                    raise
        return None

    def _is_forgotten(self, unknown: int, silent_s: float) -> bool:
        """True if the server has said often enough that it does not know the plan."""
        if unknown < _SILENT_POLLS or silent_s <= _SETTLE_S:
            return False
        if self._has_events and self.fabric.release.loses_sight:
            self._tell(_LOST_SIGHT)
            return False
        return True

    def _wait_for_turn(
        self, code: Code, began: float, interruption: Interruption, earlier: int
    ) -> None:
        """Another plan runs, or nothing of this one can have happened yet."""
        if code is Code.QUEUED:
            for _ in range(earlier):
                self._events.get()
            if time.monotonic() - began > _QUEUED_S:
                self._tell(_QUEUE_ENDED)
        end = time.monotonic() + _POLL_S
        while time.monotonic() < end and not interruption.requested:
            time.sleep(_POLL_S / 10)

    def _take_events(self, within_s: float) -> int:
        """Hand events to the mirror until there is none for so long; how many there were."""
        taken, end = 0, time.monotonic() + within_s
        while (left := end - time.monotonic()) > 0:
            try:
                event = self._events.get(timeout=left)
            except queue.Empty:
                break
            if event is None:  # somebody wants it to stop
                break
            taken += 1
            self.mirror.begin()
            self.mirror.take(event)
            if self.mirror.kernel.status.ended:
                break
        return taken

    def _note(self, message: str, **data: Any) -> None:
        if not self.mirror.kernel.status.ended:
            self.mirror.note(message, **data)

    def _tell(self, message: str) -> None:
        """Say something to people, once."""
        if message not in self._said:
            self._said.add(message)
            complain(message)

    def _tell_quiet(self) -> None:
        kernel = self.mirror.kernel
        words = Words(kernel.automaton, kernel.runners)
        for each in quiet(self.trace, words, has_events=self._has_events):
            self._tell(each)

    # -- ends -----------------------------------------------------------------------------------

    def _ended(self, status: PlanStatus) -> Outcome | None:
        """The end, if the status is that of a plan that has ended."""
        code, mirror = status.code, self.mirror
        if code is Code.COMPLETED:
            mirror.begin()
            self._take_events(_SETTLE_S if self._has_events else 0)
            mirror.reported(Status.COMPLETED, "the server reports that the plan has completed")
            if mirror.kernel.status is Status.COMPLETED:
                return self._outcome(0)
            return self._outcome(1, "the server reports COMPLETED, but its events contradict that")
        if code is Code.CANCELLED:
            mirror.cancel("another client has cancelled the plan")
            return self._outcome(1, "another client has cancelled the plan")
        if code is Code.RUNNING:
            mirror.begin()
        if code.failed:
            mirror.reported(Status.REFUSED, f"the server does not run the plan: {code.name}")
            rejected = f": {', '.join(status.rejected)}" if status.rejected else ""
            return self._outcome(1, f"the server does not run the plan: {code.name}{rejected}")
        return None

    def _settled(self) -> Outcome:
        """The events have ended the run; what the server says of it."""
        kernel = self.mirror.kernel
        end = time.monotonic() + _SETTLE_S
        code = Code.UNKNOWN
        while time.monotonic() < end and code is not Code.COMPLETED:
            try:
                code = self.fabric.status(self.plan_id, _ANSWER_S).code
            except RosError:
                break
            time.sleep(_POLL_S / 5)
        if kernel.status is Status.COMPLETED:
            return self._outcome(0)
        odd = "the server says COMPLETED nevertheless" if code is Code.COMPLETED else ""
        return self._outcome(1, odd)

    def _forgotten(self) -> Outcome:
        return self._outcome(
            1,
            "the server no longer knows the plan (UNKNOWN): it has ended, or was cancelled, "
            "or the server was restarted",
        )

    def _lost(self, why: str) -> Outcome:
        self._note(why)
        with suppress(RosError):  # it may hear, and only not answer
            self.fabric.cancel(self.plan_id, _ANSWER_S)
        return self._outcome(
            1, f"the Fabric server is gone: {why}; if it still runs, so may the plan"
        )

    def _cancel(self, why: str) -> Outcome:
        stands = self._explained(Status.RUNNING)
        problem = ""
        try:
            self.fabric.cancel(self.plan_id, _ANSWER_S)
            if not self.fabric.release.cancels:
                problem = _V2_CANCEL
        except RosError as error:
            problem = f"the plan could not be cancelled: {error}"
        self.mirror.cancel(why)
        code = 130 if why == REASON else 1
        sentences = [f"the plan was cancelled: {why}", *stands, *filter(None, [problem])]
        return Outcome(Status.CANCELLED.value, tuple(sentences), code)

    def _explained(self, status: Status) -> list[str]:
        kernel = self.mirror.kernel
        words = Words(kernel.automaton, kernel.runners)
        return explained(
            status, self.trace, words, self.mirror.now_us(), has_events=self._has_events
        )

    def _outcome(self, code: int, why: str = "") -> Outcome:
        status = self.mirror.kernel.status
        sentences = self._explained(status) if status is not Status.REFUSED else []
        return Outcome(
            status.value if status.ended else "UNKNOWN",
            tuple(filter(None, [why, *sentences])),
            code,
        )

    def _show(self, outcome: Outcome, view: View) -> None:
        """Write the last lines."""
        if self.settings.output_format == "json":
            last = {
                "plan_id": self.plan_id,
                "server": str(self.fabric.release),
                "status": outcome.status,
                "explanation": list(outcome.explanation),
                "events": self._has_events,
            }
            emit(json.dumps({"dispatch": last}) + "\n", form_of("json"))
            return
        view.say(f"plan {clip(self.plan_id, 200)} on {self.fabric.release}: {view.tally.summary}")
        for each in outcome.explanation:
            view.say(each)
