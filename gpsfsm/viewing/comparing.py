"""Two plans side by side: whether they do the same, and if not, one scenario played on both."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.errors import GpsfsmError
from gpsfsm.model.event import Event, Outcome
from gpsfsm.tasks.equivalence import UndecidedError, compare
from gpsfsm.tasks.story import difference_lines
from gpsfsm.viewing.playing import Wanted, play

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.checking import CheckOptions
    from gpsfsm.compile import Compiled
    from gpsfsm.model.plan import Plan
    from gpsfsm.tasks.equivalence import Difference
    from gpsfsm.viewing.reading import Seen

__all__ = ["compared"]

_NOT_BOTH = "one of the two texts is no plan, so it is not clear what it does"
_ON_ENGINE = "plans are compared as the paper has it, not as an engine runs them"
_MOST_STEPS = 200  # as many as a difference is told with


def compared(sides: tuple[Seen, Seen], options: CheckOptions) -> dict[str, Any]:
    """The difference between the first two plans of a document; never raises for what they are."""
    first, second = (_compiled(seen) for seen in sides)
    if first is None or second is None:
        return _answer("undecided", [_NOT_BOTH])
    if not (first.automaton.traits.gives_up and second.automaton.traits.gives_up):
        return _answer("undecided", [_ON_ENGINE])
    plans = first.automaton.plan, second.automaton.plan
    analysis = options.analysis
    try:
        found = compare(
            *plans,
            consistent=analysis.consistent,
            assumptions=analysis.assumptions,
            second_opinion=True,
        )
    except UndecidedError as error:
        return _answer("undecided", [str(error)])
    except GpsfsmError as error:  # a defect too: the plans are there to be seen
        return _answer("undecided", str(error).splitlines())
    if found is None:
        return _answer("equal", ["the plans do the same in every scenario"])
    return _different(first, second, found)


def _compiled(seen: Seen) -> Compiled | None:
    return seen.compiled if seen.whole else None


def _answer(
    verdict: str, words: Sequence[str], plays: Sequence[dict[str, Any] | None] = (None, None)
) -> dict[str, Any]:
    return {"left": 0, "right": 1, "verdict": verdict, "words": [*words], "plays": [*plays]}


def _different(first: Compiled, second: Compiled, found: Difference) -> dict[str, Any]:
    lines = [line.strip() for line in difference_lines(*_plans(first, second), found)]
    which = "the first scenario" if found.shortest else "a scenario (perhaps not the shortest)"
    numbers = tuple(tuple(pair[side] for pair, _ in found.steps) for side in (0, 1))
    events = [event for _, event in found.steps]
    plays = [
        _play(compiled, numbers[side], events, lines, side)
        for side, compiled in enumerate((first, second))
    ]
    return _answer("different", [f"{which} that shows it:", *lines], plays)


def _plans(first: Compiled, second: Compiled) -> tuple[Plan, Plan]:
    return first.automaton.plan, second.automaton.plan


def _play(
    compiled: Compiled,
    numbers: Sequence[int],
    events: Sequence[Event],
    lines: Sequence[str],
    side: int,
) -> dict[str, Any]:
    """The scenario on one side; what it leaves open succeeds, equal actions alike.

    The story is that of both, without what the other one then does.
    """
    order = list(zip(events, numbers, strict=True))
    outcomes = {number: Outcome(event.value) for event, number in order}
    played = play(compiled, Wanted(outcomes, order))
    story = [*lines[:-2], lines[-2 + side]]
    told = [played.places.get(step, 0) for step in order[-_MOST_STEPS:]]
    hidden = len(story) - 1 - len(told)
    return {
        "title": "where the plans differ",
        "ends": played.status.value,
        "story": story,
        "records": played.records,
        "story_at": [*([0] * hidden), *told, _instant(played.records, told[-1] if told else 0)],
    }


def _instant(records: Sequence[dict[str, Any]], place: int) -> int:
    """The last record of the instant of this one: by then the plan has reacted."""
    at_us = records[place]["at_us"]
    while place + 1 < len(records) and records[place + 1]["at_us"] == at_us:
        place += 1
    return place
