"""Controls and whole plans as texts."""

from __future__ import annotations

from functools import cache
from textwrap import indent
from typing import TYPE_CHECKING

from hypothesis import strategies as st

from gpsfsm.strategies._runners import runners as any_runners
from gpsfsm.strategies._shapes import TYPES, ControlWord, forests

if TYPE_CHECKING:
    from hypothesis.strategies import DrawFn, SearchStrategy

__all__ = ["controls", "plans"]


@st.composite
def controls(
    draw: DrawFn,
    children: SearchStrategy[str] | None = None,
    *,
    types: tuple[ControlWord, ...] = TYPES,
    min_children: int = 0,
    max_children: int = 4,
) -> str:
    """Draw a ``<Control …>`` with these children, runners if none are given.

    >>> from hypothesis import find, settings, strategies as st
    >>> pairs = controls(st.just("<Runner/>"), types=("parallel_any",), min_children=2)
    >>> print(find(pairs, lambda text: True, settings=settings(database=None)))
    <Control type="parallel_any">
      <Runner/>
      <Runner/>
    </Control>
    """
    inside = st.lists(
        any_runners() if children is None else children,
        min_size=min_children,
        max_size=max_children,
    )
    return _control(draw(st.sampled_from(types)), tuple(draw(inside)))


def plans(
    runners: SearchStrategy[str] | None = None,
    *,
    min_runners: int = 1,
    max_runners: int = 10,
    max_depth: int = 4,
) -> SearchStrategy[str]:
    """Draw the text of a plan that reads without an error.

    Its runners are drawn by ``runners`` (the function of this name, with the built-in library, if
    none are given). All controls occur anywhere: also empty ones, recoveries that guard nothing and
    parallels of one unit.
    """
    one = any_runners() if runners is None else runners

    @cache
    def of_size(size: int) -> SearchStrategy[tuple[str, ...]]:
        return forests(one, _control, size=size, max_depth=max_depth)

    return st.integers(min_runners, max_runners).flatmap(of_size).map(_plan)


def _plan(children: tuple[str, ...]) -> str:
    return _element("<Plan>", "</Plan>", children) + "\n"


def _control(word: ControlWord, children: tuple[str, ...]) -> str:
    if not children:
        return f'<Control type="{word}"/>'
    return _element(f'<Control type="{word}">', "</Control>", children)


def _element(start: str, end: str, children: tuple[str, ...]) -> str:
    return "\n".join([start, *(indent(child, "  ") for child in children), end])
