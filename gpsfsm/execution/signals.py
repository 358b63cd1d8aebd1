"""Signals as numbers, four for each node: ``node * 4 + STARTED``, and so on."""

from __future__ import annotations

from gpsfsm.model.event import Event

__all__ = ["FAILED", "STARTED", "STOPPED", "SUCCEEDED", "number_of"]

STARTED, SUCCEEDED, FAILED, STOPPED = range(4)


def number_of(node: int, event: Event) -> int:
    """The number of a signal."""
    # identity, since hashing a member of an enum is slow
    if event is Event.SUCCEEDED:
        return node * 4 + SUCCEEDED
    if event is Event.FAILED:
        return node * 4 + FAILED
    return node * 4 + (STARTED if event is Event.STARTED else STOPPED)
