"""A difference between two plans, told side by side."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

from gpsfsm.model.event import End, Event
from gpsfsm.model.printable import clip
from gpsfsm.model.words import action

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.model.plan import Element, Plan
    from gpsfsm.tasks.behaviour import Reaction
    from gpsfsm.tasks.pairs import Difference

__all__ = ["difference_as_data", "difference_lines"]

_ENDS = {End.COMPLETED: "completes", End.GAVE_UP: "gives up", End.STUCK: "is stuck"}
_VERBS = {Event.SUCCEEDED: "succeeds", Event.FAILED: "fails"}
_MAX_NAMED = 5
_MAX_STEPS = 200
_MAX_NAME = 200


def difference_lines(first: Plan, second: Plan, found: Difference) -> Iterator[str]:
    """The scenario in lines: the outcomes, numbered, and what either plan then does."""
    names = [clip(plan.file, _MAX_NAME) for plan in (first, second)]
    skipped = max(0, len(found.steps) - _MAX_STEPS)
    if skipped:
        yield f"  … ({skipped} outcomes before)"
    for number, ((one, other), event) in enumerate(found.steps[skipped:], start=skipped + 1):
        what = clip(action(first.runners[one]), _MAX_NAME)
        ends = (first.runners[one], second.runners[other])
        places = ", ".join(f"{name}:{_spot(end)}" for name, end in zip(names, ends, strict=True))
        yield f"  {number}. {what} {_VERBS[event]} ({places})"
    head = "then" if found.steps else "at the beginning"
    pad = " " * len(head)
    yield f"  {head} {names[0]} {_reaction(first, found.first, second, found.second)}"
    yield f"  {pad} {names[1]} {_reaction(second, found.second, first, found.first)}"


def _spot(runner: Element) -> str:
    """The line, with the column if the line does not tell the runner."""
    return f"{runner.line}:{runner.column}" if runner.shares_line else str(runner.line)


def _reaction(plan: Plan, mine: Reaction, other: Plan, theirs: Reaction) -> str:
    """What a plan does, less what the other does too."""
    parts: list[str] = []
    extra = _extra(plan, mine, other, theirs)
    if extra:
        told = [_place(plan, number) for number in extra[:_MAX_NAMED]]
        more = [f"{len(extra) - _MAX_NAMED} more"] if len(extra) > _MAX_NAMED else []
        parts.append(f"starts {_and([*told, *more])}")
    elif mine.end is None or mine.triggered:
        parts.append("starts nothing else" if mine.triggered else "starts nothing")
    if mine.end is not None:
        parts.append(_ENDS[mine.end])
    elif theirs.end is not None and not extra:
        parts.append("goes on")
    return " and ".join(parts)


def _extra(plan: Plan, mine: Reaction, other: Plan, theirs: Reaction) -> list[int]:
    """What only this plan triggers."""
    left = Counter(other.runners[number].action for number in theirs.triggered)
    found = []
    for number in mine.triggered:
        key = plan.runners[number].action
        if left[key]:
            left[key] -= 1
        else:
            found.append(number)
    return found


def _place(plan: Plan, number: int) -> str:
    runner = plan.runners[number]
    return f"{clip(action(runner), _MAX_NAME)} at {runner.where}"


def _and(parts: Sequence[str]) -> str:
    return " and ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)


def difference_as_data(first: Plan, second: Plan, found: Difference) -> dict[str, Any]:
    """The same for programs: every outcome and reaction with its places in both plans."""
    return {
        "shortest": found.shortest,
        "steps": [
            {
                "action": action(first.runners[one]),
                "event": event.value,
                "first": _location(first, one),
                "second": _location(second, other),
            }
            for (one, other), event in found.steps
        ],
        "first": _reaction_as_data(first, found.first),
        "second": _reaction_as_data(second, found.second),
    }


def _reaction_as_data(plan: Plan, reaction: Reaction) -> dict[str, Any]:
    return {
        "starts": [
            {"action": action(plan.runners[number]), **_location(plan, number)}
            for number in reaction.triggered
        ],
        "end": None if reaction.end is None else reaction.end.value,
    }


def _location(plan: Plan, number: int) -> dict[str, Any]:
    found = plan.location(plan.runners[number])
    return {"line": found.line, "column": found.column, "path": found.element}
