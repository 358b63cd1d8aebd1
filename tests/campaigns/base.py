"""What one comparison is made of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from hypothesis.strategies import SearchStrategy

__all__ = ["Pair", "UnknownError", "nothing_missing"]


class UnknownError(Exception):
    """A tool gave no answer: neither an agreement nor a disagreement."""


def nothing_missing() -> str:
    """For comparisons that need nothing but what the tests need."""
    return ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """One comparison.

    ``judge`` takes a case and raises AssertionError where answers differ; any other exception is a
    defect as well, but for UnknownError. It returns labels to count, by which one sees that
    both answers occur. ``text`` writes a case down. ``full`` is the number of cases of a
    long campaign, ``batch`` how many are drawn from one seed, ``few`` how many the test suite
    plays. ``missing`` says what is not here. An ``attack`` is judged by one rule, that the product
    is not fooled, instead of by a second answer; ``make attack`` plays those.
    """

    name: str
    about: str
    cases: Callable[[], SearchStrategy[Any]]
    judge: Callable[[Any], Iterable[str]]
    text: Callable[[Any], str]
    full: int = 10_000
    batch: int = 25
    few: int = 10
    attack: bool = False
    missing: Callable[[], str] = nothing_missing
