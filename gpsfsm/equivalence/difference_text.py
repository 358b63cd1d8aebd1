"""A difference between two plans, shown side by side."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

from gpsfsm.compile import MachinePlan
from gpsfsm.model.event import End
from gpsfsm.model.labels import action, verb
from gpsfsm.model.printable import clip
from gpsfsm.model.story import Vocabulary

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.equivalence.pairs import Difference, Reaction
    from gpsfsm.model.plan import Element, Plan

_ENDS = {End.COMPLETED: "completes", End.GAVE_UP: "gives up", End.STUCK: "is stuck"}
_MAX_NAMED = 5
_MAX_STEPS = 200
_MAX_NAME = 200


def difference_lines(first: Plan, second: Plan, difference: Difference) -> Iterator[str]:
    """The scenario in lines: the outcomes, numbered, and what either plan then does."""
    names = [clip(plan.file, _MAX_NAME) for plan in (first, second)]
    skipped = max(0, len(difference.steps) - _MAX_STEPS)
    if skipped:
        yield f"  … ({skipped} outcomes before)"
    for number, ((one, other), event) in enumerate(difference.steps[skipped:], start=skipped + 1):
        what = clip(action(first.runners[one]), _MAX_NAME)
        ends = ((first, first.runners[one]), (second, second.runners[other]))
        places = ", ".join(f"{name}:{_spot(*end)}" for name, end in zip(names, ends, strict=True))
        yield f"  {number}. {what} {verb(first.runners[one], event)} ({places})"
    head = "then" if difference.steps else "at the beginning"
    pad = " " * len(head)
    yield f"  {head} {names[0]} {_reaction(first, difference.first, second, difference.second)}"
    yield f"  {pad} {names[1]} {_reaction(second, difference.second, first, difference.first)}"


def _spot(plan: Plan, runner: Element) -> str:
    """The line, with the column if the line does not tell the runner; in a machine its name."""
    if isinstance(plan, MachinePlan) and plan.vocabulary is not Vocabulary.TREE:
        return clip(plan.path(runner).removeprefix("/machine/"), _MAX_NAME)
    return f"{runner.line}:{runner.column}" if runner.shares_line else str(runner.line)


def _reaction(plan: Plan, mine: Reaction, other: Plan, theirs: Reaction) -> str:
    """The reaction of a plan, less what the other does too."""
    parts: list[str] = []
    extra = _extra(plan, mine.triggered, other, theirs.triggered)
    stops = _stops(plan, mine, other, theirs)
    if extra:
        parts.append(f"starts {_places(plan, extra)}")
    elif not stops and (mine.end is None or mine.triggered):
        parts.append("starts nothing else" if mine.triggered else "starts nothing")
    if stops:
        parts.append(f"stops {_places(plan, stops)}")
    elif mine.end is None and theirs.stopped and not extra:
        parts.append("stops nothing else" if mine.stopped else "stops nothing")
    if mine.end is not None:
        parts.append(_ENDS[mine.end])
    elif theirs.end is not None and not extra:
        parts.append("continues")
    return " and ".join(parts)


def _stops(plan: Plan, mine: Reaction, other: Plan, theirs: Reaction) -> Sequence[int]:
    """The instances that only this machine stops; all, if it is another one of equal actions."""
    if mine.end is not None or theirs.end is not None:
        return ()
    extra = _extra(plan, mine.stopped, other, theirs.stopped)
    alike = len(mine.stopped) == len(theirs.stopped) and not extra
    starts = _extra(plan, mine.triggered, other, theirs.triggered)
    if alike and not starts and len(mine.triggered) == len(theirs.triggered):
        return mine.stopped
    return extra


def _extra(plan: Plan, mine: Sequence[int], other: Plan, theirs: Sequence[int]) -> list[int]:
    """The instances that are of this plan alone, by their actions."""
    left = Counter(other.runners[number].action for number in theirs)
    extra = []
    for number in mine:
        key = plan.runners[number].action
        if left[key]:
            left[key] -= 1
        else:
            extra.append(number)
    return extra


def _places(plan: Plan, numbers: Sequence[int]) -> str:
    places = [_place(plan, number) for number in numbers[:_MAX_NAMED]]
    more = [f"{len(numbers) - _MAX_NAMED} more"] if len(numbers) > _MAX_NAMED else []
    return _and([*places, *more])


def _place(plan: Plan, number: int) -> str:
    runner = plan.runners[number]
    where = f"({_spot(plan, runner)})" if isinstance(plan, MachinePlan) else f"at {runner.where}"
    return f"{clip(action(runner), _MAX_NAME)} {where}"


def _and(parts: Sequence[str]) -> str:
    return " and ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)


def difference_as_data(first: Plan, second: Plan, difference: Difference) -> dict[str, Any]:
    """The same for programs: every outcome and reaction with its places in both plans."""
    return {
        "shortest": difference.shortest,
        "steps": [
            {
                "action": action(first.runners[one]),
                "event": event.value,
                "first": _location(first, one),
                "second": _location(second, other),
            }
            for (one, other), event in difference.steps
        ],
        "first": _reaction_as_data(first, difference.first),
        "second": _reaction_as_data(second, difference.second),
    }


def comparison_as_data(first: Plan, second: Plan, difference: Difference | None) -> dict[str, Any]:
    """The outcome of a comparison for programs: ``gpsfsm diff --format json`` prints it."""
    return {
        "first": first.file,
        "second": second.file,
        "equal": difference is None,
        "difference": None if difference is None else difference_as_data(first, second, difference),
    }


def _reaction_as_data(plan: Plan, reaction: Reaction) -> dict[str, Any]:
    def listed(numbers: Sequence[int]) -> list[dict[str, Any]]:
        return [
            {"action": action(plan.runners[number]), **_location(plan, number)}
            for number in numbers
        ]

    stops = {"stops": listed(reaction.stopped)} if isinstance(plan, MachinePlan) else {}
    end = None if reaction.end is None else reaction.end.value
    return {"starts": listed(reaction.triggered), **stops, "end": end}


def _location(plan: Plan, number: int) -> dict[str, Any]:
    location = plan.location(plan.runners[number])
    return {"line": location.line, "column": location.column, "path": location.element}
