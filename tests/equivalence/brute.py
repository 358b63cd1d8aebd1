"""Whether two plans do the same, straight from the definition (docs/tasks.md).

Sharing no code with the product: plans are compiled by the oracle, a run is the whole history of
what came, and every pairing of what begins at one instant is tried. For a few runners only.
"""

from __future__ import annotations

from functools import cache
from itertools import permutations, product
from typing import TYPE_CHECKING

from tests.oracle import P, R, action_key, compile_plan
from tests.oracle.graph import RunnerNode
from tests.oracle.model import place

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tests.oracle import Constraint

History = frozenset[tuple[int, bool]]
"""Which instances have had their outcome, and whether it was a success."""


class Observed:
    """A plan as an observer sees it."""

    def __init__(self, whole: P) -> None:
        self.graph = compile_plan(whole)
        runners = [placed.node for placed in place(whole).walk() if isinstance(placed.node, R)]
        self.actions = [action_key(runner) for runner in runners if isinstance(runner, R)]

    @cache  # noqa: B019  (a plan lives as long as one comparison)
    def seen(self, history: History) -> tuple[frozenset[int], str]:
        """The instances that have been triggered by now, and how the run has ended by now."""
        outcome = dict(history)
        fired = self.graph.start
        triggered = set()
        for node in self.graph.nodes:
            if isinstance(node, RunnerNode):
                if node.trigger & fired:
                    triggered.add(node.index)
                    if node.index in outcome:
                        fired |= node.succeeded if outcome[node.index] else node.failed
            elif sum(bool(signal & fired) for signal in node.inputs) >= node.need:
                fired |= node.fires
        end = "completed" if self.graph.success & fired else ""
        return frozenset(triggered), end or ("gave up" if self.graph.failure & fired else "")


class Assumed:
    """The scenarios of a plan in which a constraint holds."""

    def __init__(self, whole: P, constraint: Constraint | None, *, consistent: bool) -> None:
        placed = [each for each in place(whole).walk() if isinstance(each.node, R)]
        actions = [action_key(each.node) for each in placed if isinstance(each.node, R)]
        paths = [each.path for each in placed]
        self.scenarios = [
            outcomes
            for outcomes in product((True, False), repeat=len(paths))
            if constraint is None
            or constraint(
                {
                    path: "SUCCEEDED" if outcome else "FAILED"
                    for path, outcome in zip(paths, outcomes, strict=True)
                }
            )
            if not consistent or len({*zip(actions, outcomes, strict=True)}) == len({*actions})
        ]

    @cache  # noqa: B019  (a plan lives as long as one comparison)
    def admits(self, history: History) -> bool:
        """Whether what has come is part of a scenario."""
        return any(
            all(outcomes[number] is outcome for number, outcome in history)
            for outcomes in self.scenarios
        )


def distance(
    one: P,
    other: P,
    *,
    consistent: bool = False,
    assumed: tuple[Constraint | None, Constraint | None] = (None, None),
) -> int | None:
    """The fewest outcomes after which an observer can tell the plans apart; None if never.

    ``assumed`` are the constraints on the outcomes of either plan.
    """
    first, second = Observed(one), Observed(other)
    scenarios, others_scenarios = (
        Assumed(whole, constraint, consistent=consistent)
        for whole, constraint in zip((one, other), assumed, strict=True)
    )

    def pairings(mine: list[int], theirs: list[int]) -> Iterator[dict[int, int]]:
        for order in permutations(theirs):
            if all(first.actions[a] == second.actions[b] for a, b in zip(mine, order, strict=True)):
                yield dict(zip(mine, order, strict=True))

    @cache
    def look(here: History, there: History, pairs: frozenset[tuple[int, int]]) -> int | None:
        """From this moment on, given what came before and which instances were paired before."""
        (started, end), (also, other_end) = first.seen(here), second.seen(there)
        library = dict(pairs)
        new = sorted(started - set(library))
        others = sorted(also - set(library.values()))
        if end != other_end or len(new) != len(others):
            return 0
        worst: int | None = 0
        for more in pairings(new, others):
            shortest = None if end else play(here, there, frozenset({**library, **more}.items()))
            if shortest is None:
                return None
            worst = max(worst or 0, shortest)
        return worst

    def play(here: History, there: History, pairs: frozenset[tuple[int, int]]) -> int | None:
        done = dict(here)
        least: int | None = None
        for (number, partner), success in product(sorted(pairs), (True, False)):
            if number in done:
                continue
            now, then = here | {(number, success)}, there | {(partner, success)}
            if not (scenarios.admits(now) and others_scenarios.admits(then)):
                continue
            difference = look(now, then, pairs)
            if difference is not None and (least is None or difference + 1 < least):
                least = difference + 1
        return least

    return look(frozenset(), frozenset(), frozenset())
