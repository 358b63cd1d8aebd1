"""How a client wants a plan of the service to begin: in which world, how fast, paused."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

from gpsfsm.execution.queue_rows import QueueKind

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.execution.queue_rows import QueueRow
    from gpsfsm.execution.records import RunValue

__all__ = ["Start", "Starts"]

_PREFIX = "start_"


@dataclass(frozen=True, slots=True)
class Start:
    """What a client has said; what is left out is as the service has it.

    ``world``: the plan begins in a fresh world of this name; "" stands for the world of the
    service, which goes on from plan to plan. ``speed``: so many seconds of the run pass in a
    second, 0 for no waiting. ``paused``: it stands still before anything but its beginning.
    """

    world: str = ""
    speed: float | None = None
    paused: bool = False
    seed: int | None = None

    @classmethod
    def of(cls, data: Mapping[str, Any], prefix: str = _PREFIX) -> Start | None:
        """What the data of a row say; None if nothing."""
        names = [each.name for each in fields(cls)]
        found = {name: data[prefix + name] for name in names if prefix + name in data}
        return cls(**found) if found else None

    def data(self) -> dict[str, RunValue]:
        """As a row keeps it."""
        every = {_PREFIX + each.name: getattr(self, each.name) for each in fields(self)}
        return {name: value for name, value in every.items() if value is not None}


class Starts:
    """How the plans of a queue are to begin, by its rows.

    A plan that a client has not submitted begins as the one that submitted it, or that it goes on
    for, and in its world; but a pause is nothing that it inherits.
    """

    def __init__(self) -> None:
        self._own: dict[int, Start] = {}
        self._by: dict[int, int] = {}

    def take(self, row: QueueRow) -> None:
        """Take in a row of the queue."""
        if row.kind is not QueueKind.SUBMITTED:
            return
        self._by[row.plan] = row.by
        found = Start.of(row.data or {})
        if found is not None:
            self._own[row.plan] = found

    def of(self, plan: int) -> Start:
        """How a plan begins."""
        found = self._above(plan, lambda _: True)
        if not found:
            return Start()
        own = self._own[found]
        return own if found == plan else replace(own, paused=False)

    def root(self, plan: int) -> int:
        """The plan with which the world began in which a plan runs; 0 for that of the service."""
        return self._above(plan, lambda own: own.world != "")

    def seed(self, plan: int, base: int) -> int:
        """The seed of a plan, where those of the service begin with ``base``."""
        found = self._above(plan, lambda own: own.seed is not None)
        seed = self._own[found].seed if found else None
        return base + plan - 1 if seed is None else seed + plan - found

    def _above(self, plan: int, wanted: Any) -> int:
        """The plan itself, or that above it, which says what is wanted; 0 if none does."""
        while plan:
            own = self._own.get(plan)
            if own is not None and wanted(own):
                return plan
            plan = self._by.get(plan, 0)
        return 0
