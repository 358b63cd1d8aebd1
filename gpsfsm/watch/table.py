"""The events of a run as a table for people."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING

from gpsfsm.watch.moments import seconds

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.watch.moments import Moment
    from gpsfsm.watch.words import Words

__all__ = ["WALL", "table_lines", "wall_time"]

_HEAD = ("event", "time", "kind", "what has happened")
WALL = "wall clock (UTC)"
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def table_lines(
    events: Iterable[tuple[Row, Moment]], words: Words, *, wall_clock: bool = False
) -> Iterator[str]:
    """One line per event, below a heading; without line ends."""
    yield _line(*_HEAD, WALL if wall_clock else None)
    for row, moment in events:
        yield _line(
            str(row.seq),
            f"{seconds(row.at_us)} s",
            row.kind,
            words.told(moment.record),
            wall_time(row.wall_us) if wall_clock else None,
        )


def _line(seq: str, time: str, kind: str, told: str, wall: str | None) -> str:
    shown = "" if wall is None else f"{wall:<26}  "
    return f"{seq:>6}  {shown}{time:>12}  {kind:<10}  {told}"


def wall_time(wall_us: int) -> str:
    """Microseconds since 1970 as ``2026-01-31 12:00:00.000000``; "?" where there is no such date.

    >>> wall_time(1_500_000)
    '1970-01-01 00:00:01.500000'
    """
    try:
        found = _EPOCH + timedelta(microseconds=wall_us)
    except OverflowError:
        return "?"
    return found.strftime("%Y-%m-%d %H:%M:%S.%f")
