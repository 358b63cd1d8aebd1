"""Whether a plan fulfils a task, straight from docs/tasks.md, over every scenario and order.

Shares no code with the product but the data of a task: plans are compiled and run by the oracle,
steps are followed as the page tells them, and formulas are evaluated on whole traces.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.tasks import ltlf
from tests.oracle import HANG, NO_START, SUCCEEDED, P, R, System, action_key
from tests.oracle.model import place
from tests.oracle.runs import _NO_START_TO_COME

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from tests.oracle import Constraint

Key = tuple[object, ...]
Action = tuple[str, frozenset[tuple[str, str, object]]]


@dataclass(frozen=True)
class Trace:
    """The events of a run up to its end: what, and the number of the instance.

    "silent" is no event: the instance is triggered here, and fails later without having started.
    """

    events: tuple[tuple[str, int], ...]
    ends: str
    hanging: bool

    def failing(self, size: int) -> tuple[int, ...]:
        """The instances that fail or do not start among the first ``size`` events."""
        return tuple(sorted({n for what, n in self.events[:size] if what in ("fails", "silent")}))


def actions_of(whole: P) -> list[Action]:
    return [action_key(at.node) for at in place(whole).walk() if isinstance(at.node, R)]


def traces(system: System, outcomes: tuple[str, ...]) -> Iterator[Trace]:
    """All runs of a scenario; what is triggered at one instant starts in any order.

    Where units are chained (semantics, 3.5) the start of one triggers the next, at that instant.
    """
    graph = system.graph

    def fired(begun: frozenset[int], delivered: frozenset[int]) -> int:
        """The signals that have come: all of what is delivered, STARTED of what has begun."""
        emitted = []
        for number, outcome in enumerate(outcomes):
            started = HANG if number in begun and outcome != NO_START else _NO_START_TO_COME
            emitted.append(outcome if number in delivered else started)
        return system.play(tuple(emitted))

    def go(
        begun: frozenset[int], delivered: frozenset[int], events: tuple[tuple[str, int], ...]
    ) -> Iterator[Trace]:
        now = fired(begun, delivered)
        ready = [each.index for each in graph.runners if each.trigger & now]
        ready = [number for number in ready if number not in begun]
        for number in ready:
            what = "silent" if outcomes[number] == NO_START else "start"
            yield from go(begun | {number}, delivered, (*events, (what, number)))
        if ready:
            return
        active = sorted(begun - delivered)
        coming = [number for number in active if outcomes[number] != HANG]
        if now & graph.success:
            yield Trace(events, "completes", False)
        elif now & graph.failure:
            yield Trace(events, "gives_up", False)
        elif not coming:
            yield Trace(events, "stuck", bool(active))
        else:
            for number in coming:
                what = "succeeds" if outcomes[number] == SUCCEEDED else "fails"
                yield from go(begun, delivered | {number}, (*events, (what, number)))

    yield from go(frozenset(), frozenset(), ())


def all_traces(
    whole: P,
    *,
    faults: frozenset[str] = frozenset(),
    consistent: bool = False,
    constraint: Constraint | None = None,
) -> list[tuple[tuple[str, ...], Trace]]:
    system = System(whole, faults)
    return [
        (run.outcomes, trace)
        for run in system.allowed(consistent=consistent, constraint=constraint)
        for trace in traces(system, run.outcomes)
    ]


def left_after(
    trace: Trace,
    steps: Sequence[Sequence[Action]],
    actions: Sequence[Action],
    *,
    allowed: frozenset[Action] = frozenset(),
    others: bool = False,
) -> int | None:
    """After how many events a run has left the steps (one more: at its end); None: never."""
    named = {action for step in steps for action in step}
    todo = [list(step) for step in steps]  # what is left to try, step by step
    tried = False  # whether an attempt of the first of them has failed
    running: int | None = None
    excused = False
    for place_, (what, number) in enumerate(trace.events, start=1):
        action = actions[number]
        if what in ("start", "silent"):  # what does not start was attempted all the same
            if running is None and todo and action == todo[0][0]:
                running = number
            elif action not in allowed and not (others and action not in named):
                return place_
        elif number == running:
            running = None
            tried = what == "fails"
            if what == "succeeds":
                del todo[0]
            elif len(todo[0]) == 1:  # lost: anything goes, but that the plan completes
                return len(trace.events) + 1 if trace.ends == "completes" else None
            else:
                del todo[0][0]
        elif what == "fails":
            excused = True
    ended = len(trace.events) + 1
    if trace.ends == "stuck":
        return None if trace.hanging else ended
    if trace.ends == "gives_up":
        alternative_due = tried and running is None
        return None if excused and not alternative_due else ended
    return ended if todo else None


def holds(
    formula: ltlf.Formula,
    trace: Trace,
    names: Mapping[str, frozenset[Action]],
    actions: Sequence[Action],
    at: int = 0,
) -> bool:
    """Whether a formula holds from event ``at`` on; the end of the run is the last event."""
    events = [(what, number) for what, number in trace.events if what != "silent"]
    size = len(events) + 1

    def true(part: ltlf.Formula, at: int) -> bool:
        match part:
            case ltlf.Constant(value):
                return value
            case ltlf.HasFirst(some):
                return (at < size) == some
            case ltlf.Atom(happening, name, wanted):
                if at == size - 1:
                    return (happening == trace.ends) == wanted
                what, number = events[at]
                means = name == "*" or actions[number] in names.get(name, frozenset())
                return (what == happening and means) == wanted
            case ltlf.Both(left, right):
                return true(left, at) and true(right, at)
            case ltlf.Either(left, right):
                return true(left, at) or true(right, at)
            case ltlf.Next(inner, weak):
                return true(inner, at + 1) if at + 1 < size else weak
            case ltlf.Until(left, right):
                return any(
                    true(right, end) and all(true(left, before) for before in range(at, end))
                    for end in range(at, size)
                )
            case ltlf.Release(left, right):
                return all(
                    true(right, end) or any(true(left, before) for before in range(at, end))
                    for end in range(at, size)
                )

    return true(formula, at)
