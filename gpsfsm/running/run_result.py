"""The result of a run from Python, gathered while it goes on."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from gpsfsm.execution.journal_rows import Row, RowMaker, line
from gpsfsm.execution.queue_rows import QueueKind
from gpsfsm.execution.records import Status
from gpsfsm.running.one_run import Observer, RunObserver
from gpsfsm.watch.moments import Tally

if TYPE_CHECKING:
    from gpsfsm.execution.queue import PlanState, QueueRow
    from gpsfsm.execution.records import Input, Record
    from gpsfsm.running.admission import Decision
    from gpsfsm.running.one_run import Run


@dataclass(frozen=True, slots=True)
class PlanEnding:
    """The end of a plan.

    - ``number``: the number of the plan in its queue; ``run``: that of its run in the journal, 0
      for none.
    - ``continues``: the number of the plan that this one continues; 0 for none.
    - ``findings``: the reasons for which a plan was refused.
    - ``events``: the events of the run, as in a journal; ``summary``: how the run went.
    """

    number: int
    name: str
    status: Status
    run: int = 0
    continues: int = 0
    findings: tuple[str, ...] = ()
    events: tuple[Row, ...] = ()
    summary: str = ""

    def to_dict(self) -> dict[str, Any]:
        """The end as data; an event is a line of ``gpsfsm run --format json``."""
        return {
            "number": self.number,
            "name": self.name,
            "status": self.status.value,
            "run": self.run,
            "continues": self.continues,
            "findings": list(self.findings),
            "events": [json.loads(line(each)) for each in self.events],
            "summary": self.summary,
        }


@dataclass(frozen=True, slots=True)
class RunResult:
    """The result of ``gpsfsm.run``: how the plans ended, in the order in which they ended.

    It is true if every plan completed or was continued by a plan that completed. ``notices`` are
    messages for people. ``journal`` is the path of the journal, "" for none.
    """

    plans: tuple[PlanEnding, ...]
    journal: str = ""
    notices: tuple[str, ...] = ()

    @property
    def status(self) -> Status:
        """COMPLETED, or the status of the first plan that neither completed nor was continued."""
        continued = {each.continues for each in self.plans if each.status is not Status.REFUSED}
        last = [each.status for each in self.plans if each.number not in continued - {0}]
        return next((each for each in last if each is not Status.COMPLETED), Status.COMPLETED)

    def __bool__(self) -> bool:
        return bool(self.plans) and self.status is Status.COMPLETED

    def to_dict(self) -> dict[str, Any]:
        """The result as data: the ends of the plans, with their events."""
        return {
            "completed": bool(self),
            "status": self.status.value,
            "plans": [each.to_dict() for each in self.plans],
            "journal": self.journal,
            "notices": list(self.notices),
        }


@dataclass(slots=True)
class _Kept:
    """The notes about a run while it goes on."""

    number: int = 0
    rows: list[Row] = field(default_factory=list)
    tally: Tally = field(default_factory=Tally)
    status: Status = Status.QUEUED


class _RunCollector(RunObserver):
    """Keeps the events of one run."""

    def __init__(self, run: Run, kept: _Kept) -> None:
        self._run, self._kept = run, kept
        self._maker = RowMaker(run.kernel)

    def __call__(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        self._kept.rows += self._maker.make(at_us, happened, records)
        self._kept.tally.add(at_us, records)

    def recall(self, rows: Sequence[Row], _kernel: Any) -> None:
        """Take in what another process has journaled of the run."""
        self._kept.rows += rows
        self._maker.seq = rows[-1].seq if rows else 0

    def ended(self) -> None:
        """Note how the plan ended."""
        self._kept.status = self._run.kernel.status


class Collector(Observer):
    """Keeps what happens in a session, and makes the result of it."""

    def __init__(self) -> None:
        self.notices: list[str] = []
        self._runs: dict[int, _Kept] = {}
        self._names: dict[int, str] = {}
        self._not_submitted: tuple[str, ...] = ()

    def notice(self, message: str, hint: str = "") -> None:
        """Keep it."""
        self.notices.append(f"{message}\n{hint}" if hint else message)

    def decided(self, decision: Decision) -> None:
        """Ignore it: why a plan is refused is in its state, too."""

    def wrote(self, row: QueueRow) -> None:
        """Keep why a plan that gave up is not continued."""
        if row.kind is QueueKind.GENERATED and (row.data or {}).get("accepted") is not True:
            self.notices.append(f"plan {row.plan} is not continued: {row.message}")

    def not_submitted(self, names: Sequence[str]) -> None:
        """Keep the names of plans that an interruption kept from the queue."""
        self._not_submitted = tuple(names)

    def run_begins(self, run: Run) -> RunObserver:
        """Keep the events of a run."""
        plan = 0 if run.state is None else run.state.plan
        kept = self._runs[plan] = _Kept(run.number)
        self._names[plan] = run.prepared.heading.file
        return _RunCollector(run, kept)

    def result(self, states: Sequence[PlanState], journal: str) -> RunResult:
        """The ends of all; a run that no queue waited for has the number 0."""
        plans = [self._ending(state) for state in states]
        if 0 in self._runs:
            kept = self._runs[0]
            plans.append(
                PlanEnding(
                    *(0, self._names[0], kept.status, kept.number),
                    events=tuple(kept.rows),
                    summary=kept.tally.summary,
                )
            )
        plans += [PlanEnding(0, name, Status.CANCELLED) for name in self._not_submitted]
        return RunResult(tuple(plans), journal, tuple(self.notices))

    def _ending(self, state: PlanState) -> PlanEnding:
        kept = self._runs.get(state.plan, _Kept())
        summary = kept.tally.summary if kept.rows else "; ".join((*state.findings, state.reason))
        return PlanEnding(
            *(state.plan, state.name, state.status, kept.number),
            continues=state.continues,
            findings=state.findings,
            events=tuple(kept.rows),
            summary=summary.strip("; "),
        )
