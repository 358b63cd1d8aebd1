"""How much work deciding about one plan may take in all, so that no plan keeps a check busy.

The unit is a step of z3, which is the same on every machine, and so is what runs out of them.
"""

from __future__ import annotations

__all__ = ["Budget", "Inconclusive", "Purse"]

SECOND_OPINION = 5_000_000
"""Steps for a second opinion, without which an answer stands as well.

Ten times what plans of 200 runners take; trees with a counting Parallel may take more.
"""


class Inconclusive(Exception):  # noqa: N818  (not an error: an answer of its own)
    """A limit of steps was reached: the question is undecided."""


class Purse:
    """Steps that are left for one purpose; several problems may share them."""

    def __init__(self, steps: int) -> None:
        self.left = steps

    def pay(self, steps: int) -> None:
        """Take steps out; it may come out empty, and then gives nothing any more."""
        self.left -= steps

    @property
    def empty(self) -> bool:
        """Whether nothing is left."""
        return self.left <= 0

    def require(self, steps: int = 0) -> None:
        """Pay for what comes now; raises Inconclusive if nothing was left before."""
        if self.empty:
            raise Inconclusive
        self.pay(steps)


class Budget:
    """The steps for one plan, ``total`` in all.

    ``deciding``: for what the verdict rests on, and the ``second`` opinion about it;
    ``scenarios``: for those that are shown, so that no search for them leaves a verdict undecided.
    """

    def __init__(self, total: int) -> None:
        quarter = total // 4
        second = min(quarter, SECOND_OPINION)
        self.scenarios = Purse(quarter)
        self.second = Purse(second)
        self.deciding = Purse(total - quarter - second)
