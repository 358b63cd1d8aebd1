"""Names of runners and controls in messages, and the stories of runs."""

from __future__ import annotations

from functools import partial
from itertools import groupby
from operator import itemgetter
from typing import TYPE_CHECKING

from gpsfsm.model.automaton import Automaton, NodeKind, Signal
from gpsfsm.model.event import Event, Outcome
from gpsfsm.model.labels import action, brief
from gpsfsm.model.plan import Element, Kind
from gpsfsm.model.story import Actor, Sentence, Statement

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping, Sequence

    from gpsfsm.model.plan import Plan
    from gpsfsm.model.story import Terms

__all__ = ["action", "count", "fewest_words", "listed", "place", "story"]

_MAX_STEPS = 8
WITHOUT = "although no action fails"


def place(element: Element) -> str:
    """An element with its line: ``WaypointRunner (x=1.0, y=3.0) at line 5``.

    Where other elements like it begin on the line, the column is named too.
    """
    if element.kind is Kind.RUNNER:
        what = action(element)
    elif element.kind is Kind.CONTROL:
        name = element.text("name")
        what = f"the {element.words}" + (f" '{brief(name)}'" if name else "")
    else:
        what = f"the {element.tag or 'plan'}"
    return f"{what} at {element.where}"


def listed(items: Sequence[str], *, most: int = 3) -> str:
    """``a``, ``a and b``, ``a, b and c``, ``a, b, c and 4 more``."""
    shown = list(items[:most])
    if len(items) > most:
        return f"{', '.join(shown)} and {len(items) - most} more"
    if len(shown) <= 1:
        return "".join(shown)
    return f"{', '.join(shown[:-1])} and {shown[-1]}"


def count(number: int, noun: str) -> str:
    """``1 failure``, ``2 failures``."""
    return f"{number} {noun}" + "s" * (number != 1)


def fewest_words(
    number: int | None, terms: Terms, *, failures: bool = True, at_least: bool = False
) -> str:
    """The fewest failures that end a plan: ``1 failure is enough``.

    ``failures``: what was named before as ending it are failures alone, so an end without any is
    another one. ``at_least``: the number is a lower bound.
    """
    if number is None or (at_least and not number):
        return "it is unknown how many failures are needed"
    if at_least and number == 1:
        return "this takes at least 1 failure"
    if number == 0 and failures:
        return f"the {terms.whole} can also {terms.give_up} {WITHOUT}"
    if number <= 1:
        return "1 failure is enough" if number else "no failure is needed"
    return f"this takes at least {number} failures in total"


def story(
    automaton: Automaton,
    trace: Collection[Signal],
    outcomes: Mapping[int, Outcome],
    actor_of: Callable[[int], Actor] | None = None,
) -> tuple[Sentence, ...]:
    """A trace as the sentences of a story; ``outcomes``: by node, of those that matter.

    ``actor_of`` gives the actor of an element index, for callers who tell many stories of one plan.
    """
    actor_of = actor_of or partial(actor, automaton.plan)
    steps: list[tuple[Statement, int]] = []  # of which runner, by element index
    ended = {signal.node for signal in trace if signal.event is not Event.STARTED}
    for signal in trace:
        if automaton.nodes[signal.node].kind is not NodeKind.RUNNER:
            continue
        outcome = outcomes.get(signal.node)
        if signal.event is Event.SUCCEEDED:
            statement = Statement.SUCCEEDS
        elif signal.event is Event.FAILED:
            unstarted = outcome is Outcome.NO_START
            statement = Statement.DOES_NOT_START if unstarted else Statement.FAILS
        elif outcome is Outcome.HANG:
            statement = Statement.NEVER_ENDS
        elif signal.node not in ended:
            statement = Statement.IS_RUNNING
        else:
            continue  # its end says it all
        steps.append((statement, automaton.nodes[signal.node].origin))
    return tuple(
        Sentence(statement, tuple(map(actor_of, row)), count)
        for statement, row, count in _shortened(steps)
    )


def actor(plan: Plan, index: int) -> Actor:
    """The runner with this element index, as stories have it."""
    return Actor(plan.path(index), place(plan.elements[index]))


def _shortened(steps: list[tuple[Statement, int]]) -> list[tuple[Statement, Sequence[int], int]]:
    """Statement, runners and count of each sentence.

    Long rows of the same become one sentence, and the middle of long stories is left out.
    """
    sentences: list[tuple[Statement, Sequence[int], int]] = []
    for statement, group in groupby(steps, key=itemgetter(0)):
        row = [index for _, index in group]
        if len(row) > (3 if statement is Statement.SUCCEEDS else 6):  # failures are what matters
            sentences.append((statement, (row[0], row[-1]), len(row) - 2))
        else:
            sentences += ((statement, (index,), 0) for index in row)
    if len(sentences) > _MAX_STEPS:
        hidden = len(sentences) - _MAX_STEPS
        left_out = (Statement.STEPS_LEFT_OUT, (), hidden)
        sentences = [*sentences[:2], left_out, *sentences[2 + hidden :]]
    return sentences
