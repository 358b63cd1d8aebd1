"""Random behaviour trees, ticked by others, and what gpsfsm says of them.

``btcpp``: in the real BehaviorTree.CPP. ``ticks``: Nav2's nodes and TryCatch, which its wheel
lacks, in an interpreter that is written from their documentation. Outcomes are drawn for each
visit, and so is how many ticks a leaf runs. The machine of the tree must be able to follow each run
of the engine, and no fact may rule out what the engine does.
"""

from __future__ import annotations

import importlib.util
from typing import TYPE_CHECKING

from hypothesis import strategies as st

from tests.campaigns.base import Pair
from tests.equivalence.pairs import seeded
from tests.oracle import btcpp, ticks
from tests.oracle.random_trees import RandomTree

if TYPE_CHECKING:
    from collections.abc import Iterable


def _in_the_engine(seed: int) -> Iterable[str]:
    parted, labels = btcpp.disagreement(seed)
    assert not parted, parted
    return labels


def _in_the_interpreter(seed: int) -> Iterable[str]:
    parted, labels = ticks.disagreement(seed)
    assert not parted, parted
    return labels


def _missing() -> str:
    there = importlib.util.find_spec("behaviortreepy") is not None
    return "" if there else "the wheel behaviortreepy is not installed"


PAIRS = [
    Pair(
        name="btcpp",
        about="random trees over all nodes of BehaviorTree.CPP 4, in the real engine",
        cases=lambda: st.integers(0, 2**31 - 1),
        judge=_in_the_engine,
        text=lambda seed: RandomTree(seeded(seed)).text,
        full=20_000,
        missing=_missing,
    ),
    Pair(
        name="ticks",
        about="random trees over Nav2's nodes and TryCatch, in an interpreter of ticks",
        cases=lambda: st.integers(0, 2**31 - 1),
        judge=_in_the_interpreter,
        text=lambda seed: ticks.random_tree(seeded(seed)),
        full=20_000,
    ),
]
