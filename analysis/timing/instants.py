"""What the deciders ask where durations are declared, without knowing how it is answered."""

from __future__ import annotations

from typing import Protocol

__all__ = ["Instants"]


class Instants(Protocol):
    """Answers about instants; may raise Inconclusive."""

    def meet(self, first: int, second: int) -> bool:
        """Whether in some run both instances are active at one instant, before it ends."""
        ...

    def outlives(self, number: int) -> bool:
        """Whether in some run the instance is active when the plan completes."""
        ...
