"""What a mutation is: one small change of a plan, of the kind that language models make."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from gpsfsm.fuzzing.nodes import Tree
    from gpsfsm.model.plan import Plan

__all__ = ["Mutation", "Operator"]


@dataclass(frozen=True, slots=True)
class Mutation:
    """A change: ``element`` is the index of the element that it is told of.

    ``told`` says in one line what is changed; ``change`` does it, once, to a fresh tree.
    """

    operator: str
    element: int
    told: str
    change: Callable[[Tree], None]


@dataclass(frozen=True, slots=True)
class Operator:
    """A kind of change; ``mutations`` gives all of them for a plan, in document order."""

    name: str
    mutations: Callable[[Plan], Iterator[Mutation]]
