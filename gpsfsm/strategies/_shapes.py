"""The shapes of plans: how runners are nested in controls, whatever they are made of."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Literal, TypeVar

from hypothesis import strategies as st

if TYPE_CHECKING:
    from collections.abc import Callable

    from hypothesis.strategies import DrawFn, SearchStrategy

__all__ = ["TYPES", "ControlWord", "forests"]

T = TypeVar("T")
ControlWord = Literal["sequential", "recovery", "parallel_any", "parallel_all"]

TYPES: tuple[ControlWord, ...] = ("sequential", "recovery", "parallel_any", "parallel_all")
# Kinds of children; the more often one is named the more often it is drawn. None is a runner,
# first, to shrink to it. At the start of a list recoveries are rare, for they guard nothing there.
_FIRST: list[ControlWord | None] = [
    *([None] * 4),
    "sequential",
    "sequential",
    "parallel_any",
    "parallel_any",
    "parallel_any",
    "parallel_all",
    "parallel_all",
    "parallel_all",
    "recovery",
]
_RECOVERY: ControlWord = "recovery"
_LATER: list[ControlWord | None] = [*_FIRST, *([_RECOVERY] * 14)]

# Made once: Hypothesis looks at each new strategy, and that takes longer than to draw from it.
_FIRST_KIND, _LATER_KIND = st.sampled_from(_FIRST), st.sampled_from(_LATER)
_NO_CONTROL: SearchStrategy[ControlWord | None] = st.none()
_ANY_TYPE, _ONE_OF_TEN = st.sampled_from(TYPES), st.integers(0, 9)


def forests(
    runners: SearchStrategy[T],
    control: Callable[[ControlWord, tuple[T, ...]], T],
    *,
    size: int,
    max_depth: int = 4,
) -> SearchStrategy[tuple[T, ...]]:
    """Children of one element that hold exactly ``size`` runners in all, and any controls.

    ``control`` makes an element of a type and its children. Controls are nested at most
    ``max_depth`` deep, may be empty, and occur anywhere. For those who have nodes of their own;
    ``plans`` draws texts.

    >>> from hypothesis import find, settings, strategies as st
    >>> trees = forests(st.just("go"), lambda word, inside: f"{word}({', '.join(inside)})", size=2)
    >>> simple = settings(database=None)
    >>> find(trees, lambda found: len(found) == 1, settings=simple)
    ('sequential(go, go)',)
    """

    @cache
    def within(size: int, depth: int) -> SearchStrategy[tuple[T, ...]]:
        return _children(runners, control, within, size=size, depth=depth)

    return within(size, max_depth)


@st.composite
def _children(
    draw: DrawFn,
    runners: SearchStrategy[T],
    control: Callable[[ControlWord, tuple[T, ...]], T],
    within: Callable[[int, int], SearchStrategy[tuple[T, ...]]],
    *,
    size: int,
    depth: int,
) -> tuple[T, ...]:
    children: list[T] = []
    while size:
        kinds = (_LATER_KIND if children else _FIRST_KIND) if depth else _NO_CONTROL
        kind = draw(kinds)
        if kind is None:
            children.append(draw(runners))
            size -= 1
        else:
            # The larger of two, or most plans would be one long sequence.
            sizes = st.integers(1, size)
            inside = max(draw(sizes), draw(sizes))
            children.append(control(kind, draw(within(inside, depth - 1))))
            size -= inside
        if depth and draw(_ONE_OF_TEN) == 9:
            children.append(control(draw(_ANY_TYPE), ()))
    return tuple(children)
