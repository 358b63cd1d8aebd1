"""Hypothesis strategies for plans, fault models and constraints."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hypothesis import strategies as st

from tests.oracle import (
    COMPLETION,
    Both,
    C,
    Constraint,
    Either,
    Implies,
    Not,
    P,
    R,
    Says,
    runner_paths,
)

if TYPE_CHECKING:
    from hypothesis.strategies import DrawFn, SearchStrategy

    from tests.oracle.model import Node, Type

# Few, so that equal actions occur; several differ in spelling only.
ACTIONS = (
    "demo_capabilities/GoRunner x=1",
    "demo_capabilities/GoRunner x=1.0",
    "demo_capabilities/GoRunner x=true",
    "demo_capabilities/GoRunner x=2 y=door",
    "demo_capabilities/GoRunner y=door x=2.0",
    "demo_capabilities/SayRunner text=true",
    "demo_capabilities/SayRunner",
    COMPLETION,
)
TYPES: tuple[Type, ...] = ("sequential", "recovery", "parallel_any", "parallel_all")
PROVIDERS = ("demo_runners/Demo", "demo_runners/Other")
# Kinds of children; the more often one is named the more often it is drawn. None is a runner,
# first, to shrink to it. At the start of a list recoveries are rare, for they guard nothing there.
_FIRST: list[Type | None] = [
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
_RECOVERY: Type = "recovery"
_LATER: list[Type | None] = [*_FIRST, *([_RECOVERY] * 14)]


@st.composite
def runners(draw: DrawFn) -> R:
    """A runner with one of a few actions."""
    return R(
        draw(st.sampled_from(ACTIONS)),
        label=draw(st.sampled_from(["", "first", "second"])),
        ident=draw(st.sampled_from(["", "7"])),
        provider=draw(st.sampled_from(PROVIDERS)),
    )


@st.composite
def _children(draw: DrawFn, size: int, depth: int) -> tuple[Node, ...]:
    """Children that hold exactly ``size`` runners in controls nested at most ``depth`` deep."""
    children: list[Node] = []
    while size:
        kinds = (_LATER if children else _FIRST) if depth else [None]
        kind = draw(st.sampled_from(kinds))
        if kind is None:
            children.append(draw(runners()))
            size -= 1
        else:
            # The larger of two, or most plans would be one long sequence.
            inside = max(draw(st.integers(1, size)), draw(st.integers(1, size)))
            children.append(C(kind, draw(_children(inside, depth - 1))))
            size -= inside
        if depth and draw(st.integers(0, 9)) == 9:
            children.append(C(draw(st.sampled_from(TYPES))))
    return tuple(children)


@st.composite
def plans(draw: DrawFn, *, min_runners: int = 0, max_runners: int = 10, max_depth: int = 4) -> P:
    """A plan of up to ``max_runners`` runners; a completion runner at its end is extra.

    All controls occur anywhere, also empty ones, recoveries that guard nothing, recoveries of
    recoveries and parallels of one unit.
    """
    size = draw(st.integers(min_runners, max_runners))
    children = draw(_children(size, max_depth))
    if not size:
        children = draw(st.lists(st.sampled_from(TYPES).map(C), max_size=3).map(tuple))
    ending = (R(COMPLETION),) if draw(st.integers(0, 3)) == 3 else ()
    return P((*children, *ending))


def faults() -> SearchStrategy[frozenset[str]]:
    """Fault models beyond the default one."""
    return st.frozensets(st.sampled_from(["no-start", "hang"]))


def constraints(
    whole: P, *, faults: frozenset[str] = frozenset(), max_leaves: int = 5
) -> SearchStrategy[Constraint]:
    """A constraint between outcomes of a plan that has a runner; ``str`` gives its text."""
    verbs = ["succeeds", "fails"]
    verbs += ["does not start"] if "no-start" in faults else []
    verbs += ["hangs"] if "hang" in faults else []
    atoms = st.builds(Says, st.sampled_from(runner_paths(whole)), st.sampled_from(verbs))
    return st.recursive(
        atoms,
        lambda parts: st.one_of(
            st.builds(Not, parts),
            st.builds(Both, parts, parts),
            st.builds(Either, parts, parts),
            st.builds(Implies, parts, parts),
        ),
        max_leaves=max_leaves,
    )
