"""Foreign elements, attributes, keys and statements in valid inputs: nothing is dropped in silence.

A case is the seed of an insertion. What was inserted is refused, told, or taken over; the modules
named here say what needs no word, and why.
"""

from __future__ import annotations

from functools import partial
from random import Random
from typing import TYPE_CHECKING

from hypothesis import strategies as st

from tests.campaigns.base import Pair
from tests.capabilities import foreign_keys
from tests.compile import foreign_markup
from tests.compile.formats import builder_programs, foreign, foreign_statements

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable


def _chance(seed: int) -> Random:
    return Random(seed)  # noqa: S311  (no secrets here)


def _of_markup(pool: Callable[[], tuple[str, ...]], seed: int) -> Iterable[str]:
    before, after, what = foreign_markup.inserted(pool(), _chance(seed))
    label = foreign_markup.judged(before, after)
    assert label != "silent" or foreign_markup.harmless(what), what
    yield label


def _of_keys(seed: int) -> Iterable[str]:
    label = foreign_keys.judged(*foreign_keys.inserted(_chance(seed)))
    assert label != "silent"
    yield label


def _of_machines(seed: int) -> Iterable[str]:
    yield foreign.judged(*foreign.changed(_chance(seed)))


def _program(seed: int, *, flexbe: bool) -> str:
    return foreign_statements.inserted(_chance(seed), flexbe=flexbe)


def _of_programs(seed: int, *, flexbe: bool) -> Iterable[str]:
    return builder_programs.judged(_program(seed, flexbe=flexbe))


def _pair(
    name: str,
    about: str,
    judge: Callable[[int], Iterable[str]],
    text: Callable[[int], str],
) -> Pair:
    return Pair(
        name=f"foreign-{name}",
        about=f"foreign {about}: told, refused or taken over",
        cases=lambda: st.integers(0, 2**31 - 1),
        judge=judge,
        text=text,
        batch=100,
    )


PAIRS = [
    _pair(
        "trees",
        "elements and attributes in behaviour trees",
        partial(_of_markup, foreign_markup.trees),
        lambda seed: foreign_markup.inserted(foreign_markup.trees(), _chance(seed))[1],
    ),
    _pair(
        "plans",
        "elements and attributes in plans",
        partial(_of_markup, foreign_markup.plans),
        lambda seed: foreign_markup.inserted(foreign_markup.plans(), _chance(seed))[1],
    ),
    _pair(
        "keys",
        "keys in capability files, robot profiles, worlds and tasks",
        _of_keys,
        lambda seed: foreign_keys.inserted(_chance(seed))[2],
    ),
    _pair(
        "machines",
        "elements, attributes and keys in machines and graphs",
        _of_machines,
        lambda seed: foreign.changed(_chance(seed))[1],
    ),
    _pair(
        "smach",
        "statements in programs with SMACH",
        partial(_of_programs, flexbe=False),
        partial(_program, flexbe=False),
    ),
    _pair(
        "flexbe",
        "statements in programs with FlexBE",
        partial(_of_programs, flexbe=True),
        partial(_program, flexbe=True),
    ),
]
