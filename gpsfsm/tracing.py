"""Spans: what a process does, and how long each part of it takes.

Nothing is recorded, and next to nothing costs time, until somebody begins a recording. A recording
is plain data, so that a process which has read a hostile text needs no connection to anybody: it
hands its spans to its parent, which knows the collector (``gpsfsm.service.traces``).

    with recording() as spans:          [["gpsfsm.check", 10, 95, -1, {"verdict": "accepted"}, ""],
        gate_text(...)                   ["gpsfsm.read", 11, 20, 0, {}, ""], …]
"""

from __future__ import annotations

import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import TracebackType
    from typing import Self

Row: TypeAlias = list[Any]
"""Name, begin and end in nanoseconds since 1970, the index of its parent or -1, attributes, and the
type of the exception that has ended it, or ""."""

_MOST = 1_000
"""Spans of a recording; further ones are left out."""


class Span:
    """A span, entered while it lasts. ``note`` adds attributes."""

    def __init__(self, name: str, attributes: dict[str, Any]) -> None:
        self._name, self._attributes = name, attributes
        self._index = -1

    def note(self, **attributes: Any) -> None:
        """Add attributes: numbers and words of ours, nothing that is from a plan."""
        self._attributes.update(attributes)

    def __enter__(self) -> Self:
        if _RECORDINGS and len(_RECORDINGS[-1][0]) < _MOST:
            rows, stack = _RECORDINGS[-1]
            self._index = len(rows)
            parent = stack[-1] if stack else -1
            rows.append([self._name, time.time_ns(), 0, parent, self._attributes, ""])
            stack.append(self._index)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._index >= 0 and _RECORDINGS:
            rows, stack = _RECORDINGS[-1]
            assert stack.pop() == self._index, "spans overlap"
            rows[self._index][2] = time.time_ns()
            rows[self._index][5] = "" if kind is None else kind.__name__


class _NoSpan(Span):
    """The span of a process that records nothing."""

    def __init__(self) -> None:
        super().__init__("", {})

    def note(self, **attributes: Any) -> None:
        """Add nothing."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass


_NONE = _NoSpan()
_RECORDINGS: list[tuple[list[Row], list[int]]] = []


def span(name: str, **attributes: Any) -> Span:
    """A span of this process, which records one request at a time."""
    return Span(name, attributes) if _RECORDINGS else _NONE


@contextmanager
def recording() -> Iterator[list[Row]]:
    """Record all spans, in the order in which they begin."""
    rows: list[Row] = []
    _RECORDINGS.append((rows, []))
    try:
        yield rows
    finally:
        _RECORDINGS.pop()
