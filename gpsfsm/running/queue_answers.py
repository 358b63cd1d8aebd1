"""Answers of the process that holds the plan queue, and its journal, for both kinds of runs."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

from gpsfsm.execution.journal_errors import JournalBusyError
from gpsfsm.execution.queue import CLIENT, QueueKind, QueueRow
from gpsfsm.streams import complain

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from contextlib import ExitStack

    from gpsfsm.execution.journal import Journal
    from gpsfsm.execution.queue import PlanQueue, PlanState
    from gpsfsm.execution.records import RunValue
    from gpsfsm.running.admission import Admitted
    from gpsfsm.running.worlds import Start, Starts

_BUSY_S = 15.0
_SILENT_S = 1.0
_MOST_LISTED = 200
_MOST_TRACED = 10_000


class Served(Protocol):
    """The plan queue of a service. ``numbers`` are runs by plans."""

    numbers: dict[int, int]

    @property
    def queue(self) -> PlanQueue[Admitted]:
        """The queue."""

    def pace_of(self, state: PlanState) -> dict[str, Any]:
        """In which world a plan runs, how fast, whether it stands still, and for how long."""


@dataclass(slots=True)
class KeyedLog:
    """The log of the queue: says with each plan for which request it was submitted, and how.

    ``more`` is said of every plan.
    """

    journal: Journal
    starts: Starts
    key: str = ""
    start: Start | None = None
    more: Mapping[str, RunValue] = field(default_factory=dict)

    def write_queue(self, at_us: int, row: QueueRow) -> None:
        """Keep a row."""
        if row.kind in (QueueKind.SUBMITTED, QueueKind.REFUSED):
            data = {**(row.data or {}), **self.more}
            if self.key and row.by == CLIENT:
                data |= {"key": self.key, **({} if self.start is None else self.start.data())}
            row = row._replace(data=data)
        self.journal.write_queue(at_us, row)
        self.starts.take(row)


class TracedPlans:
    """The spans of plans: how long each has waited, and how long it runs.

    A plan that goes on for another one belongs to its trace. What is traced is no part of the
    journal, so the spans of a plan end with the process that has taken it.
    """

    def __init__(self) -> None:
        self._parents: dict[int, tuple[str, int]] = {}

    def submitted(self, plan: int, head: Mapping[str, Any]) -> None:
        """A plan was taken for a request that may be traced."""
        if parent := head.get("traceparent"):
            self._parents.setdefault(plan, (parent, time.time_ns()))

    def begun(self, state: PlanState) -> Callable[[], dict[str, Any] | None]:
        """A run begins; the function makes the message about it when it has ended."""
        plan, began_ns = state.plan, time.time_ns()
        parent, since_ns = self._parents.get(state.continues, ("", began_ns))
        parent, since_ns = self._parents.pop(plan, (parent, began_ns))
        if not parent:
            return lambda: None
        self._parents[plan] = (parent, began_ns)  # for the plan that goes on for this one
        if len(self._parents) > _MOST_TRACED:
            del self._parents[next(iter(self._parents))]
        about = {"gpsfsm.plan": str(plan)}

        def ended() -> dict[str, Any]:
            rows = [
                ["wait in the plan queue", since_ns, began_ns, -1, about, ""],
                ["run the plan", began_ns, time.time_ns(), -1, about, ""],
            ]
            return {"spans": rows, "traceparent": parent}

        return ended


def open_journal(head: dict[str, Any], stack: ExitStack) -> Journal:
    """The journal; one that an earlier service has just left may be busy for a moment."""
    from gpsfsm.execution.journal import Journal

    until_s = time.monotonic() + _BUSY_S
    silent_s = until_s - _BUSY_S + _SILENT_S
    while True:
        try:
            return stack.enter_context(Journal(head["journal"], head.get("durability", "power")))
        except JournalBusyError:
            if time.monotonic() > until_s:
                raise
            if time.monotonic() > silent_s:
                silent_s = math.inf
                complain(
                    f"{head['journal']}: another process writes to this journal; "
                    f"waiting up to {_BUSY_S:g} s for it to end"
                )
        time.sleep(0.1)


def length_of(state: PlanState) -> int:
    """The time of a run that has ended, in microseconds; else 0."""
    return max(0, state.ended_us - state.began_us) if state.began_us >= 0 else 0


def to_json(served: Served, state: PlanState) -> dict[str, Any]:
    """The state of a plan, as the service gets it."""
    return {
        "plan": state.plan,
        "status": state.status.value,
        "name": state.name,
        "sha256": state.sha256,
        "by": state.by,
        "continues": state.continues,
        "findings": list(state.findings),
        "reason": state.reason,
        "attempts": state.attempts,
        "run": served.numbers.get(state.plan),
        **served.pace_of(state),
    }


def _state(served: Served, head: dict[str, Any], _: bytes) -> dict[str, Any]:
    return to_json(served, served.queue.state(head["plan"]))


def _list(served: Served, head: dict[str, Any], _: bytes) -> dict[str, Any]:
    most, first = min(head["most"], _MOST_LISTED), max(1, head["after"] + 1)
    last = min(served.queue.submitted_ever, first + most - 1)
    plans = [to_json(served, served.queue.state(plan)) for plan in range(first, last + 1)]
    return {"plans": plans, "total": served.queue.submitted_ever}


def _plans_of(served: Served, head: dict[str, Any], _: bytes) -> dict[str, Any]:
    """The plans of runs, and what has become of them."""
    plan_of = {run: plan for plan, run in served.numbers.items()}
    follows = {state.continues: state.plan for state in served.queue.states() if state.continues}
    plans = {}
    for run in head["runs"]:
        if run in plan_of:
            state = served.queue.state(plan_of[run])
            after = follows.get(state.plan, 0)
            links = {"continued_by": after, "continued_by_run": served.numbers.get(after)}
            links["continues_run"] = served.numbers.get(state.continues)
            plans[str(run)] = {**to_json(served, state), **links}
    return {"plans": plans}


ABOUT_PLANS: dict[str, Callable[[Any, dict[str, Any], bytes], dict[str, Any]]] = {
    "state": _state,
    "list": _list,
    "plans_of": _plans_of,
}
"""The requests about plans, whatever runs them."""
