"""The monitor of a task's steps: what is due, and how a run leaves it (docs/tasks.md, 3)."""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.analysis.words import place
from gpsfsm.capabilities.defects import quoted
from gpsfsm.model.event import End, Event, Outcome
from gpsfsm.tasks.monitor import Violation, end_words

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterator

    from gpsfsm.tasks.monitor import Branching, Matching, MState
    from gpsfsm.tasks.task import Pattern, Task


_GUARD = "add a recovery for what can fail after the last step, or remove it"
_WAIT = "wait for the step: run what follows after it, not beside it in a parallel_any"
_UNHIDE = "remove what runs in its place and hides the failure, so that nothing handles it"


class _Phase(IntEnum):
    """DUE: an attempt must start. RUNNING: it has started. DONE: so have all steps, with success.

    LOST: an action has failed for which the task has no alternative left. Anything goes then, but
    that the plan completes as if the step were done.
    """

    DUE = 0
    RUNNING = 1
    DONE = 2
    LOST = 3


class _At(NamedTuple):
    """The place of a run: step and attempt from 0; ``runner`` is the instance that runs it.

    ``excused``: an action has failed of which the task says nothing, so that nobody can demand
    that the plan does not give up.
    """

    phase: _Phase
    step: int
    attempt: int
    runner: int
    excused: bool


class StepsMonitor:
    """Follows the steps of a task."""

    def __init__(self, task: Task, matching: Matching) -> None:
        self._task = task
        self._steps = task.steps
        self._matching = matching
        self._whole = f"the {matching.terms.whole}"
        self._named = [pattern for step in task.steps for pattern in step.attempts]

    @property
    def start(self) -> MState:
        """The first step is due."""
        return _At(_Phase.DUE if self._steps else _Phase.DONE, 0, 0, -1, False)

    def after(self, state: MState, event: Event | Outcome, runner: int) -> MState | Violation:
        """The steps due after an event; a start that does not come is an attempt all the same."""
        assert isinstance(state, _At)
        if state.phase is _Phase.LOST:
            return state
        if event is Event.STARTED or event is Outcome.NO_START:
            return self._started(state, runner)
        if state.phase is _Phase.RUNNING and state.runner == runner:
            return self._ended(state, event)
        if event is Event.FAILED:
            return state._replace(excused=True)
        return state

    def branching(self) -> Branching:
        """The monitor itself: it never branches."""
        return self

    def letter(self, event: Event | Outcome, runner: int) -> Hashable:
        """Outcomes of what no step names differ in nothing but whether they are failures."""
        is_named = any(self._matching(pattern, runner) for pattern in self._named)
        if is_named or event in (Event.STARTED, Outcome.NO_START):
            return (event, -1) if not is_named and self._ignored(runner) else (event, runner)
        return (event, -1)

    def branches(
        self, state: MState, event: Event | Outcome, runner: int
    ) -> Iterator[MState | Violation]:
        """The state after an event."""
        yield self.after(state, event, runner)

    def at_end(self, state: MState, end: End, *, hanging: bool) -> Violation | None:
        """The violation, if the run must not end so."""
        assert isinstance(state, _At)
        if end is End.STUCK and hanging:
            return None  # an action that never ends leaves nothing to demand
        if state.phase is _Phase.LOST:
            return self._swallowed(state) if end is End.COMPLETED else None
        alternative_due = state.phase is _Phase.DUE and state.attempt > 0
        if end is End.GAVE_UP and state.excused and not alternative_due:
            return None
        if state.phase is _Phase.DONE:
            if end is End.COMPLETED:
                return None
            ends = end_words(end, self._matching.terms)
            closing = f"every step of the task is done, and {ends}"
            what = f"{ends} at the end"
            return Violation("GP607", ("done", end), what, closing, hint=_GUARD)
        return self._unfinished(state, end)

    def _started(self, state: _At, runner: int) -> MState | Violation:
        if state.phase is _Phase.DUE and self._matching(self._due(state), runner):
            return state._replace(phase=_Phase.RUNNING, runner=runner)
        if self._ignored(runner):
            return state
        if state.phase is _Phase.DUE:
            return self._wrong(state, runner)
        if state.phase is _Phase.DONE:
            return self._too_much(runner, len(self._steps))
        due = self._named_step(state)
        if self._step_of(runner, 0) is None:
            return self._too_much(runner, state.step)
        what = self._place(runner)
        message = f"{what} can start while {due} is still running"
        closing = f"{what} starts while {due} is still running"
        return Violation("GP604", ("during", state.step), message, closing, runner)

    def _ended(self, state: _At, event: Event | Outcome) -> MState:
        if event is Event.FAILED:
            if state.attempt + 1 == len(self._steps[state.step].attempts):
                return _At(_Phase.LOST, state.step, 0, -1, True)
            return _At(_Phase.DUE, state.step, state.attempt + 1, -1, state.excused)
        following = state.step + 1
        phase = _Phase.DUE if following < len(self._steps) else _Phase.DONE
        return _At(phase, following, 0, -1, state.excused)

    def _ignored(self, runner: int) -> bool:
        """An action that may come at any time."""
        if any(self._matching(pattern, runner) for pattern in self._task.allowed):
            return True
        return self._task.others and not any(
            self._matching(pattern, runner) for pattern in self._named
        )

    def _wrong(self, state: _At, runner: int) -> Violation:
        """Another action starts than the one that is due."""
        attempts = self._steps[state.step].attempts
        what, due = self._place(runner), self._named_step(state)
        later = self._step_of(runner, state.step + 1)
        here = [at for at, pattern in enumerate(attempts) if self._matching(pattern, runner)]
        if state.attempt:
            tried = quoted(attempts[state.attempt - 1].name)
            if later is not None or any(at > state.attempt for at in here):
                return self._skipped(state, f"{self._whole} continues with {what}", runner)
            if here:
                return self._too_much(runner, state.step, again=True)
            message = f"when {tried} fails, {self._whole} tries {what} instead of {due}"
            closing = f"{self._whole} tries {what} instead of {due}"
            return Violation("GP606", (state.step, state.attempt), message, closing, runner)
        closing = f"{what} starts although {due} is due"
        is_named = bool(here) or later is not None or self._step_of(runner, 0) is None
        if is_named and not self._matching.anywhere(attempts[0]):
            return self._missing(state, closing, runner)
        if later is not None:
            message = f"{what} comes before {due}, which the task requires first"
            return Violation("GP604", ("before", state.step), message, closing, runner)
        if here:
            message = (
                f"{what} is for when {due} fails, but {self._whole} does it without such a failure"
            )
            closing = f"{what} starts although {due} has not failed"
            return Violation("GP606", (state.step, 0), message, closing, runner)
        return self._too_much(runner, state.step)

    def _unfinished(self, state: _At, end: End) -> Violation:
        """The run ends though something is due or running."""
        due, ends = self._named_step(state), end_words(end, self._matching.terms)
        if state.phase is _Phase.RUNNING:
            message = f"{ends} while {due} is still running"
            closing = f"{ends} while {due} is still running"
            return Violation("GP607", ("running", state.step), message, closing, hint=_WAIT)
        if state.attempt:
            return self._skipped(state, ends, None)
        closing = f"{ends} although {due} is due"
        if not self._matching.anywhere(self._due(state)):
            return self._missing(state, closing, None)
        message = f"{ends} before {due}"
        return Violation("GP607", ("due", state.step), message, closing)

    def _swallowed(self, state: _At) -> Violation:
        """The run completes though a step and all its alternatives have failed."""
        step = self._named_step(state)
        both = len(self._steps[state.step].attempts) > 1
        failed = "and its alternatives fail" if both else "fails"
        terms = self._matching.terms
        ends = end_words(End.COMPLETED, terms)
        message = f"{ends} even if {step} {failed}: it must {terms.give_up} then"
        closing = f"{ends} although {step} was not done"
        return Violation("GP607", ("lost", state.step), message, closing, hint=_UNHIDE)

    def _missing(self, state: _At, closing: str, runner: int | None) -> Violation:
        message = f"{self._named_step(state)} is missing: no runner of {self._whole} does it"
        return Violation("GP601", (state.step,), message, closing, runner)

    def _skipped(self, state: _At, instead: str, runner: int | None) -> Violation:
        attempts = self._steps[state.step].attempts
        tried, untried = attempts[state.attempt - 1].name, attempts[state.attempt].name
        message = f"when {quoted(tried)} fails, {self._whole} does not try {quoted(untried)}"
        closing = f"{instead} without trying {quoted(untried)}"
        return Violation("GP605", (state.step, state.attempt), message, closing, runner)

    def _too_much(self, runner: int, step: int, *, again: bool = False) -> Violation:
        """An action that is not due and belongs to no later step."""
        what = self._place(runner)
        done = self._step_of(runner, 0)
        if again or (done is not None and done < step):
            number = step + 1 if again else (done or 0) + 1
            if not again and self._only_instead(runner, step):
                return self._not_needed(runner, number)
            message = f"{what} does step {number} of the task again"
            return Violation("GP603", (runner,), message, f"{what} starts again", runner)
        message = f"the task does not ask for {what}"
        closing = f"{what} starts, which the task does not ask for"
        return Violation("GP602", (runner,), message, closing, runner)

    def _only_instead(self, runner: int, step: int) -> bool:
        """True if the action is but an alternative in the steps before this one."""
        return not any(self._matching(one.attempts[0], runner) for one in self._steps[:step])

    def _not_needed(self, runner: int, number: int) -> Violation:
        """An alternative of a step that is done, with it or without it."""
        what, done = self._place(runner), quoted(self._steps[number - 1].attempts[0].name)
        message = (
            f"{what} is for when step {number} ({done}) fails, but {self._whole} does it after the "
            "step is done"
        )
        closing = f"{what} starts although step {number} ({done}) is done"
        return Violation("GP606", (runner,), message, closing, runner)

    def _step_of(self, runner: int, first: int) -> int | None:
        """The first step from ``first`` on to which the action belongs."""
        for number in range(first, len(self._steps)):
            if any(self._matching(one, runner) for one in self._steps[number].attempts):
                return number
        return None

    def _due(self, state: _At) -> Pattern:
        return self._steps[state.step].attempts[state.attempt]

    def _named_step(self, state: _At) -> str:
        what = "an alternative in step" if state.attempt else "step"
        return f"{what} {state.step + 1} ({quoted(self._due(state).name)})"

    def _place(self, runner: int) -> str:
        return place(self._matching.runners[runner])
