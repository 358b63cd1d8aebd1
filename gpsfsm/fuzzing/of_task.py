"""The property that a task file stands for: every run keeps to its steps and rules."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.errors import UsageError
from gpsfsm.execution.records import Kind, Status
from gpsfsm.fuzzing.acts import Fate
from gpsfsm.fuzzing.properties.base import Breach, Property
from gpsfsm.model.event import End, Event
from gpsfsm.tasks.ltlf import TooLarge
from gpsfsm.tasks.monitor import Matching, RuleMonitor, Violation
from gpsfsm.tasks.steps import StepsMonitor

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fuzzing.record import Run
    from gpsfsm.tasks.monitor import Demand
    from gpsfsm.tasks.task import Task

__all__ = ["property_of_task"]

_EVENTS = {Kind.STARTED: Event.STARTED, Kind.SUCCEEDED: Event.SUCCEEDED, Kind.FAILED: Event.FAILED}
_ENDS = {Status.COMPLETED: End.COMPLETED, Status.GAVE_UP: End.GAVE_UP, Status.STUCK: End.STUCK}


def property_of_task(task: Task) -> Property:
    """The property; its breaches are told apart as the findings GP6xx are."""
    holds = f"every run does what {task.file} asks for"
    return Property("task", holds, _Check(task), by_default=True)


@dataclass(frozen=True, slots=True)
class _Check:
    """The check; an object, so that it can be handed to other processes."""

    task: Task

    def __call__(self, run: Run) -> Iterator[Breach]:
        for demand in _demands(run, self.task):
            violation = _followed(demand, run)
            if violation is not None:
                numbers = () if violation.runner is None else (violation.runner,)
                about = (violation.code, *map(str, violation.about))
                yield Breach(violation.message, numbers, about)


def _demands(run: Run, task: Task) -> Iterator[Demand]:
    matching = Matching(run.plan.runners, run.subject.compiled.bindings)
    if task.steps:
        yield StepsMonitor(task, matching)
    for rule in task.rules:
        try:
            yield RuleMonitor(rule, task.patterns, matching)
        except TooLarge:
            raise UsageError(
                f"{task.file}: the rule '{rule.name:.100}' has too many states to be followed; "
                "make several rules of it"
            ) from None


def _followed(demand: Demand, run: Run) -> Violation | None:
    """Take a demand through a run, up to where it is left."""
    state = demand.start
    silent = _without_start(run)
    for moment in run.moments[: run.decided + 1]:
        for record in moment.records:
            number = record.node - 1
            if record.kind is Kind.TRIGGERED and number in silent:
                found = demand.without_start(state, number)
            elif record.kind in _EVENTS:
                found = demand.after(state, _EVENTS[record.kind], number)
            else:
                continue
            if isinstance(found, Violation):
                return found
            if found is None:
                return None
            state = found
    for number in _starting_at_the_end(run):
        found = demand.after(state, Event.STARTED, number)
        if isinstance(found, Violation):
            return found
        if found is None:
            return None
        state = found
    return demand.at_end(state, _ENDS[run.status], hanging=bool(run.active_at_end))


def _starting_at_the_end(run: Run) -> list[int]:
    """The instances that start at the instant at which the run ends (semantics, 4.4).

    The executor has stopped by then, so that there is no record of it.
    """
    started = {
        record.node - 1
        for moment in run.moments[: run.decided + 1]
        for record in moment.records
        if record.kind is Kind.STARTED
    }
    acts = run.scenario.acts
    return [
        number
        for number in sorted(run.triggered)
        if number not in started and acts[number].fate is not Fate.NO_START
    ]


def _without_start(run: Run) -> set[int]:
    """The instances that fail without having started."""
    started = {
        record.node - 1
        for moment in run.moments
        for record in moment.records
        if record.kind is Kind.STARTED
    }
    return {number for number in run.ended if number not in started}
