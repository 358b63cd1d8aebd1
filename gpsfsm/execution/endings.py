"""What has become of the instances of a run, by its rows: for those that cannot act again.

A simulated run that is simulated once more meets what came from outside: the answers of a language
model. They are not asked for again, but taken from the journal.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from gpsfsm.execution.records import Kind

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.execution.records import RunValue

__all__ = ["Ending", "endings"]

_ENDS = (Kind.SUCCEEDED, Kind.FAILED, Kind.TIMEOUT, Kind.STOPPED)


@dataclass(slots=True)
class Ending:
    """One instance: its parameters, the lines that it logged, and its end if it has one.

    ``kind`` is "" while there is none; ``at_us`` is the time of the end, ``outputs`` are those that
    the runner gave, declared or not.
    """

    parameters: Mapping[str, RunValue] = field(default_factory=dict)
    lines: list[tuple[int, str]] = field(default_factory=list)
    kind: str = ""
    at_us: int = -1
    outputs: Mapping[str, RunValue] = field(default_factory=dict)
    message: str = ""


def endings(rows: Iterable[Row]) -> dict[int, Ending]:
    """What has become of each instance that was triggered, by its number."""
    found: dict[int, Ending] = {}
    for row in rows:
        number = row.node - 1  # node 0 is the start
        if row.kind == Kind.TRIGGERED:
            found.setdefault(number, Ending()).parameters = row.values
        elif number not in found:
            continue
        elif row.kind == Kind.LOG:
            found[number].lines.append((row.at_us, row.message))
        elif row.kind in _ENDS and not found[number].kind:
            ending = found[number]
            ending.kind, ending.at_us = row.kind, row.at_us
            ending.outputs, ending.message = row.values, row.message
    return found
