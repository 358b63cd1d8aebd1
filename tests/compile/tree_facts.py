"""All facts about a small behaviour tree by brute force, from docs/behaviour-trees.md.

It plays the tree itself, node by node, over every combination of outcomes, and knows nothing of
units and automata. What a Parallel does not wait for runs on, as the page says.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product
from typing import TYPE_CHECKING, Any

from tests.compile.trees import LOOPS, T, Use

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

__all__ = ["facts", "uses"]

Result = bool | None
"""Success, failure, or still running, because an outcome is held back."""


@dataclass
class Play:
    """One run; ``outcomes`` tells of each use of a leaf how it ends, None: it runs for ever."""

    outcomes: Mapping[Use, Result]
    triggered: list[Use] = field(default_factory=list)

    def play(self, tree: T, rounds: tuple[tuple[int, int], ...] = ()) -> Result:
        """``rounds`` are the round and the number of rounds of the loops around, outside first."""
        kind, children = tree.kind, tree.children
        if kind == "leaf":
            number = 0
            for at, of in rounds:
                number = number * of + at
            use = (tree.leaf, number + 1)
            self.triggered.append(use)
            return self.outcomes[use]
        if kind in ("AlwaysSuccess", "AlwaysFailure"):
            return kind == "AlwaysSuccess"
        if kind in LOOPS:
            return self.row(
                (self.play(children[0], (*rounds, (at, tree.number))) for at in range(tree.number)),
                kind == "Repeat",
            )
        if kind in ("Sequence", "Fallback"):
            return self.row((self.play(child, rounds) for child in children), kind == "Sequence")
        if kind in ("All", "Parallel"):
            ends = [self.play(child, rounds) for child in children]
            if ends.count(True) >= tree.number:
                return True
            return False if ends.count(False) > len(ends) - tree.number else None
        if kind == "ParallelAll":
            ends = [self.play(child, rounds) for child in children]
            return None if None in ends else ends.count(True) >= tree.number
        first = self.play(children[0], rounds)
        if first is None or kind == "SubTree":
            return first
        if kind == "IfThenElse":
            chosen = children[1:2] if first else children[2:]
            return self.play(chosen[0], rounds) if chosen else False
        return {"Inverter": not first, "ForceSuccess": True, "ForceFailure": False}[kind]

    @staticmethod
    def row(ends: Iterator[Result], going_on: bool) -> Result:
        """One after the other, as long as each ends in this way."""
        return next((end for end in ends if end is not going_on), going_on)


def uses(tree: T, times: int = 1) -> Iterator[Use]:
    """All uses of the leaves, in no particular order."""
    if tree.kind == "leaf":
        yield from ((tree.leaf, number + 1) for number in range(times))
    for child in tree.children:
        yield from uses(child, times * (tree.number if tree.kind in LOOPS else 1))


def facts(tree: T, allowed: Mapping[str, tuple[bool, ...]]) -> dict[str, Any]:
    """The facts; ``allowed`` says how the leaves can end, of those that cannot end in both ways."""
    every = sorted(uses(tree))
    ways = [allowed.get(leaf, (True, False)) for leaf, _ in every]
    runs = []
    for outcomes in product(*ways):
        decided: dict[Use, Result] = dict(zip(every, outcomes, strict=True))
        run = Play(decided)
        runs.append((decided, run.play(tree), run.triggered))
    ends = {end for _, end, _ in runs}
    reached = {use for _, _, triggered in runs for use in triggered}
    return {
        "completes": _often(ends, True),
        "gives_up": _often(ends, False),
        "unreachable": set(every) - reached,
        "fewest": min(_failures(tree, every, ways), default=None),
        "dangling": {
            (use, event): _effect(tree, runs, use, event)
            for use, event in _dangling(tree)
            if use in reached
        },
        "orphans": {
            use
            for decided, _, triggered in runs
            for use in triggered
            if Play({**decided, use: None}).play(tree) is True
        },
        "peak": max((len(load) for load in _loads(tree, every, ways)), default=0),
    }


def _often(ends: set[Result], wanted: bool) -> str:
    if wanted not in ends:
        return "never"
    return "always" if len(ends) == 1 else "sometimes"


def _effect(
    tree: T, runs: list[tuple[dict[Use, Result], Result, list[Use]]], use: Use, event: bool
) -> str:
    for decided, end, triggered in runs:
        shown = use in triggered and decided[use] is event and end is False
        if shown and Play({**decided, use: not event}).play(tree) is True:
            return "give_up"
    return "dont_care"


def _failures(tree: T, every: list[Use], ways: list[tuple[bool, ...]]) -> Iterator[int]:
    """The failures that have come when the tree fails; an outcome may still be to come then."""
    for outcomes in product(*((*way, None) for way in ways)):
        decided = dict(zip(every, outcomes, strict=True))
        run = Play(decided)
        if run.play(tree) is False:
            yield sum(decided[use] is False for use in run.triggered)


def _loads(tree: T, every: list[Use], ways: list[tuple[bool, ...]]) -> Iterator[set[str]]:
    """The leaves that are active at some instant at which the tree has not ended."""
    for outcomes in product(*((*way, None) for way in ways)):
        decided = dict(zip(every, outcomes, strict=True))
        run = Play(decided)
        if run.play(tree) is None:
            yield {use[0] for use in run.triggered if decided[use] is None}


# -- events that lead to no leaf and not to completion ---------------------------------------------


@dataclass
class Walk:
    """Walks from the end of the tree to its beginning.

    ``unled`` are the events that lead to no leaf and not to completion; True is a success.
    """

    unled: set[tuple[Use, bool]] = field(default_factory=set)

    def enter(
        self, tree: T, success: bool, failure: bool, rounds: tuple[tuple[int, int], ...]
    ) -> bool:
        """Where the trigger of the node leads to, by where its success and its failure lead to."""
        kind, children = tree.kind, tree.children
        if kind == "leaf":
            number = 0
            for at, of in rounds:
                number = number * of + at
            use = (tree.leaf, number + 1)
            self.unled |= {
                (use, event) for event, leads in ((True, success), (False, failure)) if not leads
            }
            return True
        if kind in ("AlwaysSuccess", "AlwaysFailure"):
            return success if kind == "AlwaysSuccess" else failure
        if kind in ("Sequence", "Fallback", *LOOPS):
            going_on = kind in ("Sequence", "Repeat")
            parts = [(child, rounds) for child in children]
            if kind in LOOPS:
                parts = [(children[0], (*rounds, (at, tree.number))) for at in range(tree.number)]
            after = success if going_on else failure
            for child, inner in reversed(parts):
                after = self.enter(
                    child, after if going_on else success, failure if going_on else after, inner
                )
            return after
        if kind == "IfThenElse":
            then = self.enter(children[1], success, failure, rounds)
            other = self.enter(children[2], success, failure, rounds) if children[2:] else failure
            return self.enter(children[0], then, other, rounds)
        ends = {
            "Inverter": (failure, success),
            "ForceSuccess": (success, success),
            "ForceFailure": (failure, failure),
        }.get(kind, (success, failure))
        if kind == "ParallelAll":  # it may end with the last child, however that ends
            size = len(children)
            ends = (
                success or (tree.number > 1 and failure),
                failure or (tree.number < size and success),
            )
        entered = [self.enter(child, *ends, rounds) for child in children]  # all of them
        return any(entered)


def _dangling(tree: T) -> set[tuple[Use, bool]]:
    walk = Walk()
    walk.enter(tree, True, False, ())
    return walk.unled
