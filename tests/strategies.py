"""Hypothesis strategies for plans, fault models and constraints.

Those that are drawn often are made once: Hypothesis looks at each new strategy, and that takes
longer than to draw from it.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from hypothesis import strategies as st

from gpsfsm.strategies._plans import TYPES, forests
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
PROVIDERS = ("demo_runners/Demo", "demo_runners/Other")

_ACTIONS, _PROVIDERS = st.sampled_from(ACTIONS), st.sampled_from(PROVIDERS)
_LABELS, _IDENTS = st.sampled_from(["", "first", "second"]), st.sampled_from(["", "7"])
_FEW_CONTROLS = st.lists(st.sampled_from(TYPES).map(C), max_size=3).map(tuple)


@cache
@st.composite
def runners(draw: DrawFn) -> R:
    """A runner with one of a few actions."""
    return R(draw(_ACTIONS), label=draw(_LABELS), ident=draw(_IDENTS), provider=draw(_PROVIDERS))


@cache
def _units(size: int, max_depth: int) -> SearchStrategy[tuple[R | C, ...]]:
    return forests(runners(), C, size=size, max_depth=max_depth)


@cache
@st.composite
def plans(draw: DrawFn, *, min_runners: int = 0, max_runners: int = 10, max_depth: int = 4) -> P:
    """A plan of up to ``max_runners`` runners; a completion runner at its end is extra.

    All controls occur anywhere, also empty ones, recoveries that guard nothing, recoveries of
    recoveries and parallels of one unit.
    """
    size = draw(st.integers(min_runners, max_runners))
    children = draw(_units(size, max_depth))
    if not size:
        children = draw(_FEW_CONTROLS)
    ending = (R(COMPLETION),) if draw(st.integers(0, 3)) == 3 else ()
    return P((*children, *ending))


def plans_of_few_actions(*, min_runners: int = 0, max_runners: int = 6) -> SearchStrategy[P]:
    """Plans in which most actions have equals, so that their outcomes belong together."""

    def respelt(node: R | C) -> R | C:
        if isinstance(node, R):
            return R("demo/Go x=1" if "Go" in node.action else "demo/Say", provider=node.provider)
        return C(node.type, tuple(map(respelt, node.children)))

    return plans(min_runners=min_runners, max_runners=max_runners).map(
        lambda whole: P(tuple(map(respelt, whole.children)))
    )


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
    return relations(atoms, max_leaves=max_leaves)


def relations(atoms: SearchStrategy[Says], *, max_leaves: int = 5) -> SearchStrategy[Constraint]:
    """Constraints that are made of these."""
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
