"""Random behaviour trees in the real BehaviorTree.CPP, and what gpsfsm says of them.

Outcomes are drawn for each visit, and so is how many ticks a leaf runs. The machine of the tree
must be able to follow each run of the engine, and no fact may rule out what the engine does.
"""

from __future__ import annotations

import importlib.util
from typing import TYPE_CHECKING

from hypothesis import strategies as st

from tests.campaigns.base import Pair
from tests.equivalence.pairs import seeded
from tests.oracle.btcpp import disagreement
from tests.oracle.random_trees import RandomTree

if TYPE_CHECKING:
    from collections.abc import Iterable


def _judge(seed: int) -> Iterable[str]:
    parted, labels = disagreement(seed)
    assert not parted, parted
    return labels


def _missing() -> str:
    there = importlib.util.find_spec("behaviortreepy") is not None
    return "" if there else "the wheel behaviortreepy is not installed"


PAIR = Pair(
    name="btcpp",
    about="random trees over all nodes of BehaviorTree.CPP 4, in the real engine",
    cases=lambda: st.integers(0, 2**31 - 1),
    judge=_judge,
    text=lambda seed: RandomTree(seeded(seed)).text,
    full=20_000,
    missing=_missing,
)
