"""Whether a plan fulfils a task, straight from docs/tasks.md, over every scenario and order.

Shares no code with the product but the data of a task: plans are compiled and run by the oracle,
steps are followed as the page tells them, and formulas are evaluated on whole traces.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations
from typing import TYPE_CHECKING

from gpsfsm.tasks import ltlf
from tests.oracle import FAILED, HANG, P, R, Run, System, action_key
from tests.oracle.model import place

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from tests.oracle import Constraint

Key = tuple[object, ...]
Action = tuple[str, frozenset[tuple[str, str, object]]]


@dataclass(frozen=True)
class Trace:
    """The events of a run up to its end: what, and the number of the instance."""

    events: tuple[tuple[str, int], ...]
    ends: str
    hanging: bool


def actions_of(whole: P) -> list[Action]:
    return [action_key(at.node) for at in place(whole).walk() if isinstance(at.node, R)]


def traces(system: System, outcomes: tuple[str, ...]) -> Iterator[Trace]:
    """All runs of a scenario; what is triggered at one instant starts in any order."""
    graph = system.graph

    def go(delivered: frozenset[str], events: tuple[tuple[str, int], ...]) -> Iterator[Trace]:
        fired = Run(system, outcomes, 0)._after(delivered)
        triggered = [each.index for each in graph.runners if each.trigger & fired]
        begun = {number for _, number in events}
        for order in permutations([number for number in triggered if number not in begun]):
            told = (*events, *(("start", number) for number in order))
            pending = [number for number in triggered if system.paths[number] not in delivered]
            if fired & graph.success:
                yield Trace(told, "completes", False)
                continue
            if fired & graph.failure:
                yield Trace(told, "gives_up", False)
                continue
            coming = [number for number in pending if outcomes[number] != HANG]
            if not coming:
                yield Trace(told, "stuck", bool(pending))
            for number in coming:
                what = "fails" if outcomes[number] == FAILED else "succeeds"
                yield from go(delivered | {system.paths[number]}, (*told, (what, number)))

    yield from go(frozenset(), ())


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
        if what == "start":
            if running is None and todo and action == todo[0][0]:
                running = number
            elif action not in allowed and not (others and action not in named):
                return place_
        elif number == running:
            running = None
            tried = what == "fails"
            if what == "succeeds":
                del todo[0]
            elif len(todo[0]) == 1:
                return None
            else:
                del todo[0][0]
        elif what == "fails":
            excused = True
    ended = len(trace.events) + 1
    if trace.ends == "stuck":
        return None if trace.hanging else ended
    if trace.ends == "gives_up":
        was_alternative = bool(todo) and len(todo[0]) < len(steps[len(steps) - len(todo)])
        assert not tried or was_alternative
        return None if excused and not was_alternative else ended
    return ended if todo else None


def holds(
    formula: ltlf.Formula,
    trace: Trace,
    names: Mapping[str, frozenset[Action]],
    actions: Sequence[Action],
    at: int = 0,
) -> bool:
    """Whether a formula holds from event ``at`` on; the end of the run is the last event."""
    size = len(trace.events) + 1

    def true(part: ltlf.Formula, at: int) -> bool:
        match part:
            case ltlf.Constant(value):
                return value
            case ltlf.Known(some):
                return (at < size) == some
            case ltlf.Atom(happening, name, wanted):
                if at == size - 1:
                    return (happening == trace.ends) == wanted
                what, number = trace.events[at]
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
