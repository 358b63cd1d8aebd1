"""Whether a plan is one that was shown in the prompt."""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING

from gpsfsm.tasks.equivalence import UndecidedError, compare

if TYPE_CHECKING:
    from gpsfsm.compile import Compiled

__all__ = ["Echo", "echo_of"]


class Echo(Enum):
    """SAME behaviour, OTHER behaviour, or UNDECIDED."""

    SAME = "same"
    OTHER = "other"
    UNDECIDED = "undecided"


def echo_of(plan: Compiled, example: Compiled) -> Echo:
    """Whether a plan behaves as the example does (docs/tasks.md, "Equivalence")."""
    one, other = plan.automaton, example.automaton
    if one.fingerprint == other.fingerprint:
        return Echo.SAME
    try:
        return Echo.SAME if compare(plan, example) is None else Echo.OTHER
    except UndecidedError:
        return Echo.UNDECIDED
