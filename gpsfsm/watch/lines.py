"""A run as plain lines, one per event."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.watch.moments import moments, seconds
from gpsfsm.watch.words import Detail, Words

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from gpsfsm.execution.records import Input, Record

__all__ = ["Lines"]


class Lines:
    """A watcher of a host that writes a line for each event.

    >>> from gpsfsm.compile import compile_plan
    >>> from gpsfsm.execution.records import Input, Kind, Record
    >>> from gpsfsm.syntax import parse
    >>> text = '<Plan><Runner interface="a/Go" provider="a/Go" x="1"/></Plan>'
    >>> automaton = compile_plan(parse(text, file="p.xml").plan).automaton
    >>> lines = Lines(Words(automaton, [("a/Go", "a/Go")]), print)
    >>> lines(12_300_000, Input(Kind.SUCCEEDED, 0), [Record(Kind.SUCCEEDED, 1)])
        12.300 s  line 1  Go (x=1) succeeded
    """

    def __init__(
        self, words: Words, write: Callable[[str], object], *, detail: Detail = Detail.RUN
    ) -> None:
        self._words = words
        self._write = write
        self._detail = detail

    def __call__(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        """Tell what has happened."""
        for moment in moments(at_us, happened, records):
            if self._words.shown(moment.record, self._detail):
                self._write(f"{seconds(at_us):>10} s  {self._words.told(moment.record)}")
