"""Something to do with many items, wherever --jobs says."""

from dataclasses import dataclass

from gpsfsm import engine_of, map_items


@dataclass(frozen=True)
class Length:
    """What workers do with an item; they import it from this module."""

    unit: int

    def __call__(self, item: str) -> int:
        """Do it."""
        return len(item) * self.unit


def lengths(items: list[str], jobs: int | str) -> list[int]:
    """The lengths in their order; -1 for an item that ended the process that had it."""
    return list(
        map_items(engine_of(jobs, len(items)), Length(1), items, lost=lambda _item, _how: -1)
    )
