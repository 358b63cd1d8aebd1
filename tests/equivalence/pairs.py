"""What the tests of equivalence share."""

from __future__ import annotations

import random
from collections import Counter
from typing import TYPE_CHECKING, Any

from gpsfsm.equivalence import Difference, compare
from tests.oracle import P, par_all, plan, seq
from tests.support import plan_of

if TYPE_CHECKING:
    from gpsfsm.equivalence.pairs import Behaviour, Reaction

__all__ = ["differs", "last_reactions", "seeded", "wide"]


def seeded(seed: int) -> random.Random:
    return random.Random(seed)  # noqa: S311  (no secrets here)


def differs(one: P, other: P, **options: Any) -> Difference | None:
    return compare(plan_of(one), plan_of(other), **options)


def last_reactions(
    behaviours: list[Behaviour], difference: Difference
) -> tuple[Reaction, Reaction]:
    """The last reactions of both plans, played by themselves; before, they are alike."""
    (here, first), (there, second) = (each.begin() for each in behaviours)
    for (one, other), event in difference.steps:
        assert same_actions(behaviours, first, second)
        assert behaviours[0].actions[one] == behaviours[1].actions[other]
        here, first = behaviours[0].after(here, one, event)
        there, second = behaviours[1].after(there, other, event)
    assert not same_actions(behaviours, first, second)
    return first, second


def same_actions(behaviours: list[Behaviour], *reactions: Reaction) -> bool:
    seen = [
        (Counter(behaviour.actions[number] for number in reaction.triggered), reaction.end)
        for behaviour, reaction in zip(behaviours, reactions, strict=True)
    ]
    return seen[0] == seen[1]


def wide(size: int) -> P:
    units = [
        par_all(*(seq(*(f"r n={place + k + 10 * j}" for k in range(10))) for j in range(4)))
        for place in range(0, size, 40)
    ]
    return plan(*units)
