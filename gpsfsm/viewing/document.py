"""The view document: everything that the page shows, as one object of JSON (docs/view.md).

Two plans side by side are compared: where they differ, one scenario is played on both.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.checking import check_text, unreadable
from gpsfsm.checking.includes import includes_of, joined_text
from gpsfsm.checking.inputs import read_bytes
from gpsfsm.compile import MachinePlan
from gpsfsm.errors import GpsfsmError, InputError
from gpsfsm.late import collecting_rarely
from gpsfsm.model.event import Event, Outcome
from gpsfsm.version import VERSION
from gpsfsm.viewing.plans import Seen, Viewed, plan_data, rules_of, seen_of
from gpsfsm.viewing.plays import Budget, Wanted, play, play_visits

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from gpsfsm.checking import CheckOptions
    from gpsfsm.checking.inputs import Input
    from gpsfsm.compile import Compiled
    from gpsfsm.equivalence import Difference

FORMAT = "gpsfsm-view"
FORMAT_VERSION = 3
_NOT_BOTH = "one of the two texts is not a plan, so it is unclear what it does"
_ON_ENGINE = "plans are compared by the paper's semantics, not as an engine runs them"
_MOST_STEPS = 200  # as many as the text of a difference lists


def view_input(
    item: Input, options: CheckOptions, notify: Callable[[str], object] = lambda _: None
) -> Viewed:
    """Read and check an input; ``notify`` is told why one cannot be read, which has no text."""
    try:
        text = read_bytes(item, options.limits.max_bytes)
    except InputError as error:
        notify(f"{item.path}: {error}")
        return Viewed(None, unreadable(item.path, str(error)))
    includes = None
    try:
        text = joined_text(item, text, options.limits)  # what is shown is one text
    except InputError:  # the check tells why
        includes = includes_of(item, text, options.limits)
    return Viewed(text, check_text(text, item.path, options, includes))


@collecting_rarely()
def document(
    viewed: Sequence[Viewed],
    options: CheckOptions,
    *,
    title: str = "",
    diff: bool = False,
) -> dict[str, Any]:
    """The document of some plans, which were checked with these options.

    If these hold a task, each plan is graded. ``diff``: the first two are compared.
    """
    budget = Budget()
    texts = [seen_of(each, options) for each in viewed]
    plans = [
        plan_data(each, seen, options, budget) for each, seen in zip(viewed, texts, strict=True)
    ]
    codes = {finding["rule"] for plan in plans for finding in plan["findings"]}
    paths = [each.report.path for each in viewed]
    return {
        "format": FORMAT,
        "version": FORMAT_VERSION,
        "tool": f"gpsfsm {VERSION}",
        "title": title or (paths[0] if len(paths) == 1 else f"{len(paths)} plans"),
        "rules": rules_of(codes),
        "plans": plans,
        "diff": compared((texts[0], texts[1]), options) if diff else None,
    }


def compared(sides: tuple[Seen, Seen], options: CheckOptions) -> dict[str, Any]:
    """The difference between the first two plans of a document; never raises for what they are."""
    from gpsfsm.equivalence import UndecidedError, compare

    first, second = (_compiled(seen) for seen in sides)
    if first is None or second is None:
        return _answer("undecided", [_NOT_BOTH])
    if not (first.automaton.traits.gives_up and second.automaton.traits.gives_up):
        return _answer("undecided", [_ON_ENGINE])
    plans = first.automaton.plan, second.automaton.plan
    analysis = options.analysis
    try:
        difference = compare(
            *plans,
            consistent=analysis.consistent,
            assumptions=analysis.assumptions,
            second_opinion=True,
        )
    except UndecidedError as error:
        return _answer("undecided", [str(error)])
    except GpsfsmError as error:  # a defect too: the plans are there to be seen
        return _answer("undecided", str(error).splitlines())
    if difference is None:
        return _answer("equal", ["the plans do the same in every scenario"])
    return _different(first, second, difference)


def _compiled(seen: Seen) -> Compiled | None:
    return seen.compiled if seen.whole else None


def _answer(
    verdict: str, words: Sequence[str], plays: Sequence[dict[str, Any] | None] = (None, None)
) -> dict[str, Any]:
    return {"left": 0, "right": 1, "verdict": verdict, "words": [*words], "plays": [*plays]}


def _different(first: Compiled, second: Compiled, difference: Difference) -> dict[str, Any]:
    from gpsfsm.equivalence.difference_text import difference_lines

    lines = [
        line.strip()
        for line in difference_lines(first.automaton.plan, second.automaton.plan, difference)
    ]
    which = "the first scenario" if difference.shortest else "a scenario (perhaps not the shortest)"
    numbers = tuple(tuple(pair[side] for pair, _ in difference.steps) for side in (0, 1))
    events = [event for _, event in difference.steps]
    plays = [
        _play(compiled, numbers[side], events, lines, side)
        for side, compiled in enumerate((first, second))
    ]
    return _answer("different", [f"{which} that shows it:", *lines], plays)


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
    if isinstance(compiled.automaton.plan, MachinePlan):
        visits = [(number, Outcome(event.value)) for event, number in order]
        records, places, ends = play_visits(compiled, visits)
    else:
        outcomes = {number: Outcome(event.value) for event, number in order}
        played = play(compiled, Wanted(outcomes, order))
        records, ends = played.records, played.status.value
        places = [played.places.get(step, 0) for step in order]
    story = [*lines[:-2], lines[-2 + side]]
    shown = places[-_MOST_STEPS:] if places else []
    hidden = len(story) - 1 - len(shown)
    return {
        "title": "where the plans differ",
        "ends": ends,
        "story": story,
        "records": records,
        "story_at": [*([0] * hidden), *shown, _instant(records, shown[-1] if shown else 0)],
    }


def _instant(records: Sequence[dict[str, Any]], place: int) -> int:
    """The last record of the instant of this one: by then the plan has reacted."""
    at_us = records[place]["at_us"]
    while place + 1 < len(records) and records[place + 1]["at_us"] == at_us:
        place += 1
    return place
