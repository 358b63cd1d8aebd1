"""The terminal as an observer of a session: it shows runs, and makes the exit code of them all."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.execution.queue_rows import QueueKind
from gpsfsm.execution.records import Status
from gpsfsm.model.printable import clip
from gpsfsm.ros.ledger import IN_DOUBT
from gpsfsm.running.admission import Refused
from gpsfsm.running.one_run import RunObserver, StderrObserver
from gpsfsm.running.prepare import OF_A_JOURNAL, REAL, WORLD
from gpsfsm.streams import complain
from gpsfsm.watch.console import View, header, write_line

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from types import TracebackType
    from typing import Self

    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.execution.kernel import Kernel
    from gpsfsm.execution.queue import PlanState
    from gpsfsm.execution.queue_rows import QueueRow
    from gpsfsm.execution.records import Input, Record
    from gpsfsm.running.admission import Decision
    from gpsfsm.running.interruption import Interruption
    from gpsfsm.running.one_run import Run
    from gpsfsm.watch.groot_stream import GrootStream, Shown
    from gpsfsm.watch.keys import Keys

_ORDER = (0, 1, 2, 130, 3)
_GO_ON = (WORLD, REAL)


def worst(codes: Iterable[int]) -> int:
    """The exit code of several runs: 3, 130, 2, 1, 0, the first of them. Without a run it is 2."""
    return max(codes, key=_ORDER.index, default=2)


def exit_code(status: Status, interruption: Interruption) -> int:
    """0 completed, 1 anything else, 130 cancelled with Ctrl-C."""
    if status is Status.CANCELLED and interruption.requested:
        return 130
    return 0 if status is Status.COMPLETED else 1


@dataclass(frozen=True, slots=True)
class Show:
    """The looks of runs; ``titled``: a line above the first one as well."""

    output_format: str = "auto"
    verbose: bool = False
    at_once: bool = False
    titled: bool = False
    claim: str = ""  # how a scenario says that the plan ends


class Terminal(StderrObserver):
    """Shows the runs of a session. ``codes`` are the exit codes of its plans, 0 being no plan.

    ``keys`` is the keyboard, where somebody may press a key; ``groot`` shows trees to Groot2.
    """

    def __init__(self, show: Show, interruption: Interruption) -> None:
        self.codes: dict[int, int] = {}
        self.keys: Keys | None = None
        self.groot: GrootStream | None = None
        self._show, self._interruption = show, interruption

    def exit_code(self) -> int:
        """The worst of all codes."""
        if not self.codes:
            complain("no plan has been run")
        return worst(self.codes.values())

    # -- the queue ------------------------------------------------------------------------------

    def wrote(self, row: QueueRow) -> None:
        """Tell what a row means, if it is about a plan that goes on or that never began."""
        data = row.data or {}
        continued = data.get("continues")
        if row.kind is QueueKind.ASKED:
            model = clip(str(data.get("model", "")), 200)
            self._write(f"plan {row.plan} gave up; {model} is asked for a plan that continues it")
        elif row.kind is QueueKind.ATTEMPT:
            from gpsfsm.generation.attempt_log import attempt_line, attempt_of

            self._write(attempt_line(attempt_of(data)))
        elif row.kind is QueueKind.GENERATED and data.get("accepted") is not True:
            self.codes[row.plan] = 130 if self._interruption.requested else 1
            complain(f"plan {row.plan} is not continued: {row.message}")
        elif isinstance(continued, int) and row.kind is QueueKind.SUBMITTED:
            self.codes.pop(continued, None)
        elif isinstance(continued, int) and row.kind is QueueKind.REFUSED:
            self.codes[continued] = 1
        elif row.kind is QueueKind.ENDED and row.plan not in self.codes:
            self._never_began(row.plan, str(data.get("status", "")), row.message)

    def _never_began(self, plan: int, status: str, why: str) -> None:
        if status != Status.CANCELLED.value:
            self.codes[plan] = 2
            complain(f"plan {plan} is not run: {why}")
        elif self._interruption.requested:
            self.codes[plan] = 130
        else:
            self.codes[plan] = 1
            complain(f"plan {plan} is not run: it was cancelled before it began")

    def _write(self, text: str) -> None:
        write_line(self._show.output_format, text)

    def refused(self, state: PlanState, decision: Decision | None) -> None:
        """A submitted plan is not run; what the gate says of it has been written."""
        code = decision.code if isinstance(decision, Refused) else 0
        if not code:  # the gate has not even been asked
            complain(f"{state.name}: {'; '.join(state.findings)}")
        self.codes[state.plan] = code or 2

    def cannot_run(self, plan: int, message: str) -> None:
        """A plan that has passed the gate cannot be run."""
        self.codes[plan] = 2
        complain(message)

    def in_doubt(self, doubts: Sequence[str]) -> None:
        """Something may still act on the robot."""
        self.codes[0] = IN_DOUBT
        for doubt in doubts:
            complain(f"in doubt: {doubt}")

    def not_submitted(self, _names: Sequence[str]) -> None:
        """An interruption came before these plans were submitted."""
        self.codes[0] = worst((130, self.codes.get(0, 0)))

    def not_begun(self, plans: int, *, resumable: bool) -> None:
        """The bond is lost or a goal may still act, so some plans have not begun."""
        why = "a goal may still act" if self.codes.get(0) == IN_DOUBT else "the bond is lost"
        self.codes[0] = worst((1, self.codes.get(0, 0)))
        what = "1 plan has" if plans == 1 else f"{plans} plans have"
        complain(
            f"{why}, so {what} not begun",
            hint="'gpsfsm resume' runs what is left in the journal" if resumable else "",
        )

    # -- runs -----------------------------------------------------------------------------------

    def run_begins(self, run: Run) -> RunObserver:
        """Show a run."""
        return _Shown(self._view(run), run, self, self._to_groot(run))

    def _to_groot(self, run: Run) -> Shown | None:
        """The tree of a run as Groot2 sees it from now on."""
        if self.groot is None:
            return None
        from gpsfsm.compile.plan_text import forest_in
        from gpsfsm.watch.groot_tree import groot_tree

        heading = run.prepared.heading
        from_response = heading.options.get("from_response") is True
        forest = forest_in(heading.plan, limits=OF_A_JOURNAL, from_response=from_response)
        if forest is None:  # the plan of a queue, or of a language model
            return None
        return self.groot.show(groot_tree(forest, run.prepared.compiled))

    def _view(self, run: Run) -> View:
        state, heading, show = run.state, run.prepared.heading, self._show
        fresh, title = run.begun is None, ""
        if state is not None and fresh and (show.titled or state.plan > 1):
            name = clip(state.name, 200)
            title = f"== {name}" if state.by else f"== plan {state.plan}: {name}"
        return View(
            show.output_format,
            run.kernel,
            header=header(heading) if fresh else "",
            title=title,
            verbose=show.verbose,
            at_once=heading.mode == REAL or show.at_once,
            is_new=lambda: run.is_new,
            keys=self.keys,
        )

    def ended(self, run: Run, view: View) -> None:
        """Write the last lines about a run."""
        status, options = run.kernel.status, run.prepared.heading.options
        view.say(view.tally.summary)
        if run.state is None:  # no queue waits for it
            self.codes[0] = exit_code(status, self._interruption)
            return
        if self._show.claim not in ("", status.value):
            view.say(f"The scenario says {self._show.claim}, which this run did not do.")
        could = run.prepared.heading.mode in _GO_ON and "model" not in options
        if could and status is Status.GAVE_UP:
            view.say("No model that could write a plan to continue from here is named (--model).")
        self.codes[run.state.plan] = exit_code(status, self._interruption)


class _Shown(RunObserver):
    """A run that is shown."""

    def __init__(self, view: View, run: Run, terminal: Terminal, groot: Shown | None) -> None:
        self._view, self._run, self._terminal = view, run, terminal
        self._groot = groot

    def __enter__(self) -> Self:
        self._view.__enter__()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._view.__exit__(kind, error, trace)

    def __call__(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        """Show what has happened."""
        if self._groot is not None:
            self._groot.add(records)
        self._view(at_us, happened, records)

    def tick(self, now_us: int) -> None:
        """Show the time."""
        self._view.tick(now_us)

    def recall(self, rows: Sequence[Row], kernel: Kernel) -> None:
        """Show what another process has journaled."""
        self._view.recall(rows, kernel)

    def ended(self) -> None:
        """Write the last lines."""
        self._terminal.ended(self._run, self._view)
