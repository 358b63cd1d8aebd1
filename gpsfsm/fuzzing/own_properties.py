"""Properties that users bring: a Python function that looks at a run, or a task file.

The function takes a ``Run`` and says what is wrong with it: nothing (None, True), a text, False, or
breaches. An AssertionError is a text too. Its module is imported because the user names it, and
only then.
"""

from __future__ import annotations

import importlib
import importlib.util
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from gpsfsm.errors import UsageError
from gpsfsm.execution.records import Kind
from gpsfsm.execution.runner import said
from gpsfsm.fuzzing.properties import Breach, Property, guarded
from gpsfsm.fuzzing.runs import EVENTS
from gpsfsm.fuzzing.subject import Fate
from gpsfsm.model.event import End, Event, Outcome
from gpsfsm.tasks.ltlf import TooLargeError
from gpsfsm.tasks.monitor import Matching, RuleMonitor, Violation
from gpsfsm.tasks.steps import StepsMonitor

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from types import ModuleType

    from gpsfsm.fuzzing.runs import Moment, Run
    from gpsfsm.tasks.monitor import Demand
    from gpsfsm.tasks.task import Task

_MOST = 20


def property_of(name: str) -> Property:
    """The property that ``module:function`` or ``file.py:function`` names. Raises UsageError.

    A function that is a ``Property`` already is taken as it is, under this name.
    """
    folder = str(Path.cwd())
    loaded = _loaded(name, folder)
    return replace(loaded, check=_Named(name, folder, loaded.check))


def _loaded(name: str, folder: str) -> Property:
    """The property; the path of a file begins at ``folder``."""
    module_name, _, function_name = name.rpartition(":")
    loaded = getattr(_module(module_name, folder), function_name, None)
    if isinstance(loaded, Property):
        return guarded(Property(name, loaded.holds, loaded.check, loaded.severity))
    if not callable(loaded):
        raise UsageError(f"--property {name}: there is no function '{function_name}' in it")
    return property_of_function(loaded, name)


class _Named:
    """The check of a property that has a name. Another process looks it up by that name."""

    def __init__(
        self, name: str, folder: str, check: Callable[[Run], Iterable[Breach]] | None = None
    ) -> None:
        self._name = name
        self._folder = folder
        self._check = check

    def __call__(self, run: Run) -> Iterable[Breach]:
        if self._check is None:
            self._check = _loaded(self._name, self._folder).check
        return self._check(run)

    def __reduce__(self) -> tuple[type[_Named], tuple[str, str]]:
        return _Named, (self._name, self._folder)


def property_of_function(function: Callable[[Run], object], name: str = "") -> Property:
    """A property made of a function.

    >>> from gpsfsm.fuzzing import play, subject_of
    >>> def quick(run):
    ...     assert run.at_s < 1, f"it takes {run.at_s:g} s"
    >>> subject = subject_of('<Plan><Runner interface="a/Go" provider="a/Go"/></Plan>')
    >>> run = play(subject, subject.plain)
    >>> [breach.message for breach in property_of_function(quick).check(run)]
    ['it takes 1 s']
    """
    label = getattr(function, "__name__", "function")
    first = (getattr(function, "__doc__", None) or label).strip().splitlines()[0]

    def check(run: Run) -> list[Breach]:
        try:
            answer = function(run)
        except AssertionError as error:
            answer = next(iter(str(error).splitlines()), "") or False
        except Exception as error:  # whatever a user's function does wrong
            raise UsageError(
                f"the property {name or label} cannot be checked: {said(error)}"
            ) from error
        return _breaches(answer, name or label)

    return Property(name or label, first, check)


def _breaches(answer: object, name: str) -> list[Breach]:
    if answer is None or answer is True:
        return []
    if answer is False:
        return [Breach(f"{name} does not hold")]
    if isinstance(answer, str):
        return [Breach(answer)]
    if isinstance(answer, Breach):
        return [answer]
    if isinstance(answer, list | tuple) and all(isinstance(one, Breach) for one in answer):
        return list(answer)[:_MOST]
    raise UsageError(
        f"the property {name} answers {type(answer).__name__}; it should answer None or True if it "
        "holds, else a text, False, or a list of gpsfsm.fuzzing.Breach"
    )


def _module(name: str, folder: str) -> ModuleType:
    try:
        if name.endswith(".py"):
            return _of_file(Path(folder, name))
        return importlib.import_module(name)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a module may also want to exit
        raise UsageError(
            f"--property: {name or 'the module'} cannot be imported: {said(error)}"
        ) from error


def _of_file(path: Path) -> ModuleType:
    if not path.is_file():
        raise UsageError("there is no such file")
    spec = importlib.util.spec_from_file_location(f"gpsfsm_property_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise UsageError("it is not a Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[module.__name__] = module
    spec.loader.exec_module(module)
    return module


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
        except TooLargeError:
            raise UsageError(
                f"{task.file}: the rule '{rule.name:.100}' has too many states to be followed; "
                "make several rules of it"
            ) from None


def _followed(demand: Demand, run: Run) -> Violation | None:
    """Take a demand through a run, up to where it is left."""
    state = demand.start
    for event, number in _moves(run):
        after = demand.after(state, event, number)
        if isinstance(after, Violation):
            return after
        if after is None:
            return None
        state = after
    return demand.at_end(state, End(run.status.value), hanging=bool(run.active_at_end))


def _moves(run: Run) -> Iterator[tuple[Event | Outcome, int]]:
    """The events of a run, each with the number of its instance, and the starts that never come."""
    silent = _without_start(run)
    for moment in run.moments[: run.decided + 1]:
        for record in moment.records:
            number = record.node - 1
            if record.kind is Kind.TRIGGERED and number in silent:
                yield Outcome.NO_START, number
            elif record.kind in EVENTS:
                yield EVENTS[record.kind], number
    for number in _starting_at_the_end(run):
        yield Event.STARTED, number


def _starting_at_the_end(run: Run) -> list[int]:
    """The instances that start at the instant at which the run ends (semantics, 4.4).

    The executor has stopped by then, so that there is no record of it.
    """
    started, acts = _started(run.moments[: run.decided + 1]), run.scenario.acts
    return [
        number
        for number in sorted(run.triggered)
        if number not in started and acts[number].fate is not Fate.NO_START
    ]


def _without_start(run: Run) -> set[int]:
    """The instances that fail without having started."""
    return set(run.ended) - _started(run.moments)


def _started(moments: Iterable[Moment]) -> set[int]:
    return {
        record.node - 1
        for moment in moments
        for record in moment.records
        if record.kind is Kind.STARTED
    }
