"""Reading of a journal: its runs, their events, and the proof that they are as they were written.

The proof is a chain of hashes over the rows, followed one by one as they are read.
"""

from __future__ import annotations

import hashlib
import sys
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from gpsfsm.execution.journal_errors import (
    DATABASE_ERRORS,
    DamagedJournalError,
    EmptyJournalError,
    JournalError,
    journal_error,
)
from gpsfsm.execution.journal_file import (
    FIRST_FORM,
    QUEUE,
    MarkKind,
    check_tables,
    ending_of,
    first_mark,
    form_of,
    last_mark,
    open_to_read,
)
from gpsfsm.execution.journal_loss import loss_in
from gpsfsm.execution.journal_rows import (
    Row,
    chained,
    decoded,
    heading_wall_hash,
    is_regular,
    line,
    queue_line,
    unlined,
    wall_chained,
)
from gpsfsm.execution.records import Kind, Status

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from gpsfsm.execution.journal_file import Ending, Mark


ANY = sys.maxsize


@dataclass(slots=True)
class Chain:
    """The chains of hashes of one run, or of the plan queue, up to some row.

    ``path`` and ``what`` are for messages: what a row is called and of what it is one. ``count`` is
    the number of the last row, ``link`` and ``wall_link`` are the links there. Rows up to ``bare``
    may be of the first form, without a second chain.
    """

    path: str
    what: tuple[str, str]
    link: bytes
    wall_link: bytes
    bare: int = 0
    count: int = 0
    ended: str = ""

    def take(
        self,
        seq: int,
        text: str,
        wall_us: int,
        hashes: tuple[bytes, bytes],
        provider: str | None = None,
    ) -> None:
        """Go on to the next row; ``provider`` is what its line leaves out, None for nothing.

        Raises DamagedJournalError if it is not as it was written.
        """
        self.count += 1
        if seq != self.count:
            raise self.missing(self.count, seq - 1)
        self.link = chained(self.link, text)
        if self.link != hashes[0]:
            raise DamagedJournalError(f"{self._row()} is not as it was written")
        if not hashes[1] and not self.wall_link and seq <= self.bare:
            return
        self.wall_link = wall_chained(self.wall_link, seq, wall_us, provider)
        if self.wall_link != hashes[1]:
            what = "its date and time" if provider is None else "its date and time, or its provider"
            raise DamagedJournalError(f"{self._row()} is not as it was written: {what}")

    def missing(self, first: int, last: int) -> DamagedJournalError:
        """The error that rows are not there."""
        one, of = self.what
        which = f"{one} {first:,}" if last <= first else f"{one}s {first:,} to {last:,}"
        are = "is" if last <= first else "are"
        return DamagedJournalError(
            f"{self.path}: {which} of {of} {are} missing: the journal is damaged"
        )

    def _row(self) -> str:
        return f"{self.path}: {self.what[0]} {self.count:,} of {self.what[1]}"


class Recorded(NamedTuple):
    """The recorded end of a run, or of the queue, and the last mark of the journal.

    Both are None in the first form.
    """

    ending: Ending | None
    mark: Mark | None

    def check(self, chain: Chain, now: Mark | None) -> None:
        """Compare it with a chain that was followed to its end.

        ``now`` is the last mark after that; while it is the same, nobody can have written. Raises
        DamagedJournalError.
        """
        ending, same = self.ending, self.mark is not None and self.mark == now
        if ending is None:
            if same and self.mark is not None and self.mark.closed and chain.count:
                raise DamagedJournalError(
                    f"{chain.path}: the end of {chain.what[1]} is not recorded, though the journal "
                    "was closed: it is damaged"
                )
            return
        if chain.count < ending.rows:
            raise chain.missing(chain.count + 1, ending.rows)
        if chain.count > ending.rows:
            if same and self.mark is not None and self.mark.closed:
                raise DamagedJournalError(
                    f"{chain.path}: {chain.what[1]} has more {chain.what[0]}s than the "
                    f"{ending.rows:,} that were written: the journal is damaged"
                )
            return
        link = chain.link if chain.count else b""
        if (chain.count, chain.ended, link, chain.wall_link) != ending:
            raise DamagedJournalError(
                f"{chain.path}: the end of {chain.what[1]} is not as recorded: the journal "
                "is damaged"
            )


_EVENTS = (
    "SELECT seq, at_us, input, record, kind, node, element, runner, interface, provider, cause, "
    "data, message, wall_us, hash, {wall_hash} FROM event WHERE run = ? AND seq > ? ORDER BY seq"
)
_EVENT_TYPES = "iiiisisississibb"
_EVENT_LINKS = "SELECT hash, {wall_hash} FROM event WHERE run = ? AND seq = ?"
_RUNS = "SELECT run, id, header, file, wall_us, {wall_hash} FROM run"
_RUN_TYPES = "isssib"
_SPAN = "SELECT coalesce(min(run), 0), coalesce(max(run), 0) FROM run"
_LAST = "SELECT coalesce(max(seq), 0) FROM event WHERE run = ?"
_ENDED = "SELECT seq, data FROM event WHERE run = ? AND seq <= ? AND kind = 'ENDED'"
_GAPS = """SELECT run FROM (
  SELECT run, count(*) AS rows, min(seq) AS first, max(seq) AS last FROM event GROUP BY run
  UNION ALL SELECT ?, count(*), min(seq), max(seq) FROM queue
) WHERE first <> 1 OR last <> rows LIMIT 1"""
_QUEUE = (
    "SELECT seq, at_us, kind, plan, by, data, message, wall_us, hash, {wall_hash} FROM queue "
    "WHERE seq > ? ORDER BY seq"
)
_QUEUE_TYPES = "iisiissibb"
_QUEUE_LINKS = "SELECT hash, {wall_hash} FROM queue WHERE seq = ?"
_LAST_DECISION = "SELECT coalesce(max(seq), 0) FROM queue"
_TYPES = {"i": int, "s": str, "b": bytes}

_LATEST_US = 253_402_300_799_999_999
"""The end of the year 9999 in microseconds since 1970: no date is later."""

_LARGEST = 1 << 28
"""Bytes of a file whose structure is checked."""


class _Heading(NamedTuple):
    """The row of a run."""

    number: int
    id: str
    header: str
    file: str
    wall_us: int
    wall_hash: bytes


@dataclass(frozen=True, slots=True)
class StoredRun:
    """A run in a journal. ``header`` is the heading with digests; ``events`` how many there are.

    ``status`` is RUNNING for a run that has no end in the journal: it goes on, or its process has
    ended without it.
    """

    number: int
    id: str
    header: Mapping[str, Any]
    file: str
    wall_us: int
    events: int
    at_us: int
    status: Status

    @property
    def seed(self) -> int:
        """The seed of the run."""
        seed = self.header.get("seed", 0)
        return seed if isinstance(seed, int) else 0

    @property
    def mode(self) -> str:
        """The mode in which the runners were made."""
        return str(self.header.get("mode", ""))

    @property
    def options(self) -> Mapping[str, Any]:
        """The options that decided what happened."""
        options = self.header.get("options", {})
        return options if isinstance(options, dict) else {}


class JournalReader:
    """A journal that is read, also while a run writes to it. Raises JournalError.

    Whatever is read is compared with its chain of hashes, and where the journal was closed with the
    end that was recorded then: DamagedJournalError is raised at the first row that is missing or
    not as it was written, behind those before it. ``check`` looks at the file as a whole.
    """

    def __init__(self, path: str) -> None:
        self.path = path
        try:
            self._connection = open_to_read(path)
        except EmptyJournalError:
            loss_in(path)  # maybe there was something
            raise
        self._first_form = form_of(self._connection, path) == FIRST_FORM

    def check(self) -> str:
        """Check that the file is as it was written, as far as shows without reading all events.

        Looks at its tables, at its end (``check_end``, whose note this is), and at its structure
        and for gaps if it has at most 256 MB. Raises DamagedJournalError.
        """
        check_tables(self._connection, self.path)
        note = self.check_end()
        if Path(self.path).stat().st_size <= _LARGEST:
            self.check_file()
            self.check_gaps()
        return note

    def verify_all(self) -> None:
        """Raises DamagedJournalError if anything in the journal is not as it was written."""
        for run in self.each_run():
            self.verify(run.number)
        self.verify_queue()

    @cached_property
    def covers_wall_times(self) -> bool:
        """True if hashes cover all dates, times and names of files: in the first form none."""
        return not self._first_form and self._bare == (0, 0)

    @cached_property
    def _bare(self) -> tuple[int, int]:
        """The numbers of runs and decisions from the time when the journal had the first form."""
        if self._first_form:
            return ANY, ANY
        first = first_mark(self._connection, self.path)
        return (first.runs, first.decisions) if first.kind is MarkKind.UPGRADED else (0, 0)

    def each_run(self) -> Iterator[StoredRun]:
        """One run after the other, the first one first."""
        rows = self._rows(f"{_RUNS} ORDER BY run", types=_RUN_TYPES)
        for number, row in enumerate(rows, 1):
            if row[0] != number:
                raise DamagedJournalError(
                    f"{self.path}: run {number} is missing: the journal is damaged"
                )
            yield self._stored(_Heading(*row))

    def runs(self) -> tuple[StoredRun, ...]:
        """All runs, the first one first."""
        return tuple(self.each_run())

    def run(self, number: int | None = None) -> StoredRun:
        """The run with this number, or the last one."""
        heading = self._heading(number)
        if heading is not None:
            return self._stored(heading)
        self.check_end()  # maybe there was one
        first, last = next(self._rows(_SPAN, types="ii"))
        if not last:
            raise JournalError(f"{self.path}: there is no run in this journal")
        held = f"run {first} alone" if first == last else f"runs {first} to {last}"
        raise JournalError(f"there is no run {number} in {self.path}; it holds {held}")

    def _heading(self, number: int | None) -> _Heading | None:
        if number is None:
            rows = self._rows(f"{_RUNS} ORDER BY run DESC LIMIT 1", types=_RUN_TYPES)
        else:
            rows = self._rows(f"{_RUNS} WHERE run = ?", number, types=_RUN_TYPES)
        row = next(rows, None)
        return None if row is None else _Heading(*row)

    def has_runs(self) -> bool:
        """True if any run has begun."""
        return bool(next(self._rows(_SPAN, types="ii"))[1])

    def check_end(self) -> str:
        """Check that all is here that was ever written: a note about losses by a power failure.

        The note also tells if that cannot be known. Raises DamagedJournalError if something is
        missing that the journal has to outlive.
        """
        return loss_in(self.path, self._connection)

    def check_file(self) -> None:
        """Raises DamagedJournalError if the file is damaged as a database."""
        for (result,) in self._rows("PRAGMA integrity_check(1)", types="s"):
            if result != "ok":
                what = " ".join(result.split())
                raise DamagedJournalError(
                    f"{self.path}: the journal is damaged ({what:.200}); events before the damage "
                    "can still be read"
                )

    def check_gaps(self) -> None:
        """Raises DamagedJournalError if events or decisions are not numbered 1, 2, 3 and so on.

        Without reading them, so no hash is looked at.
        """
        (number,) = next(self._rows(_GAPS, QUEUE, types="i"), (None,))
        if number is None:
            return
        rows = self._decisions(0) if number == QUEUE else self.events(number)
        for _ in rows:
            pass  # up to where one is missing
        raise DamagedJournalError(
            f"{self.path}: the journal is damaged: events or decisions are not numbered from 1 on"
        )

    def _stored(self, heading: _Heading) -> StoredRun:
        """A run whose heading, last event and end are as they were written."""
        number, recorded = heading.number, self._recorded(heading.number)
        (count,) = next(self._rows(_LAST, number, types="i"))
        chain, last = self._event(heading, count)
        _, end = self._event(heading, self._ended(number, count)[0])
        chain.ended = "" if end is None else end.data
        recorded.check(chain, self._last_mark())
        try:
            status = Status(str(end.values["status"])) if end else Status.RUNNING
        except (KeyError, ValueError):
            raise DamagedJournalError(f"{self.path}: the end of run {number} is damaged") from None
        return StoredRun(
            number,
            heading.id,
            decoded(heading.header),
            heading.file,
            heading.wall_us,
            count,
            0 if last is None else last.at_us,
            status,
        )

    def _event(self, heading: _Heading, seq: int) -> tuple[Chain, Row | None]:
        """An event that is linked to the one before it; None for 0."""
        chain = self._chain(heading, max(0, seq - 1))
        return chain, next(self._linked(chain, heading.number), (None, ""))[0] if seq else None

    def content(self, run: StoredRun, name: str) -> bytes:
        """The ``plan``, ``world`` or ``capabilities`` of a run; b"" if it has none."""
        digest = run.header.get(name, "")
        statement = "SELECT bytes FROM content WHERE sha256 = ?"
        try:
            row = next(self._rows(statement, str(digest), types="b"), None)
        except DamagedJournalError as error:
            why = str(error).removeprefix(f"{self.path}: ")
            raise DamagedJournalError(
                f"{self.path}: the {name} of run {run.number} is damaged: {why}"
            ) from error
        content: bytes = row[0] if row else b""
        if digest and hashlib.sha256(content).hexdigest() != digest:
            raise DamagedJournalError(f"{self.path}: the {name} of run {run.number} is damaged")
        return content

    def events(self, number: int, *, after: int = 0) -> Iterator[Row]:
        """The events of a run in order, those behind the event ``after``."""
        for row, _ in self.events_written(number, after=after):
            yield row

    def events_written(self, number: int, *, after: int = 0) -> Iterator[tuple[Row, str]]:
        """The same, each with its line, which the chain goes over."""
        recorded, heading = self._recorded(number), self._heading(number)
        if heading is None:
            if next(self._rows(_LAST, number, types="i"))[0]:
                raise DamagedJournalError(f"{self.path}: the heading of run {number} is missing")
            return
        if after and not 0 < after <= next(self._rows(_LAST, number, types="i"))[0]:
            return
        chain = self._chain(heading, after)
        yield from self._linked(chain, number)
        if after:
            chain.ended = self._ended(number, chain.count)[1]
        recorded.check(chain, self._last_mark())

    def _ended(self, number: int, count: int) -> tuple[int, str]:
        """The seq and data of ENDED if it is one of the first ``count`` events, else 0 and "".

        What was written since they were counted has to stay aside.
        """
        seq, data = next(self._rows(_ENDED, number, count, types="is"), (0, ""))
        return seq, data

    def _chain(self, heading: _Heading, count: int) -> Chain:
        """The chain of a run up to an event, if its heading is as it was written."""
        number, name, header, file, wall_us, wall_hash = heading
        where = f"{self.path}: the heading of run {number}"
        if hashlib.sha256(f"{number}\n{header}".encode()).hexdigest()[:32] != name:
            raise DamagedJournalError(f"{where} is not as it was written")
        bare = not wall_hash and number <= self._bare[0]
        if not bare and wall_hash != heading_wall_hash(name, file, wall_us):
            raise DamagedJournalError(f"{where} is not as it was written: its file, or its time")
        if not 0 <= wall_us <= _LATEST_US:
            raise DamagedJournalError(f"{where} has no date")
        chain = Chain(self.path, ("event", f"run {number}"), chained(b"", header), wall_hash)
        chain.bare = ANY if bare else 0
        if count:
            links = next(self._rows(_EVENT_LINKS, number, count, types="bb"), None)
            if links is None:
                raise chain.missing(count, count)
            chain.count, (chain.link, chain.wall_link) = count, links
        return chain

    def _linked(self, chain: Chain, number: int) -> Iterator[tuple[Row, str]]:
        """The events of a run behind those of the chain, which follows them."""
        for values in self._rows(_EVENTS, number, chain.count, types=_EVENT_TYPES):
            row = _row(values)
            if not is_regular(values) or not 0 <= row.wall_us <= _LATEST_US:
                raise DamagedJournalError(
                    f"{self.path}: event {row.seq:,} of run {number} is not as it was written"
                )
            text = line(row)
            chain.take(row.seq, text, row.wall_us, values[-2:], unlined(row))
            if row.kind == Kind.ENDED:
                chain.ended = row.data
            yield row, text

    def _recorded(self, number: int) -> Recorded:
        """The recorded end of a run, or of the QUEUE, as it is now."""
        mark = self._last_mark()
        if mark is None:
            return Recorded(None, None)
        return Recorded(ending_of(self._connection, self.path, number), mark)

    def _last_mark(self) -> Mark | None:
        return None if self._first_form else last_mark(self._connection, self.path)

    def verify(self, number: int, *, last: int = 0) -> int:
        """The number of events of a run, if its heading, its plan and all events are as written.

        With ``last`` only so many events at its end are looked at. Raises DamagedJournalError.
        """
        run = self.run(number)
        for name in ("plan", "world", "capabilities"):
            self.content(run, name)
        after = max(0, run.events - last) if last else 0
        return after + sum(1 for _ in self.events(number, after=after))

    def queue(self, *, after: int = 0) -> Iterator[tuple[Any, ...]]:
        """The decisions of the plan queue: seq, at_us, kind, plan, by, data (JSON), message."""
        for values in self._decisions(after):
            yield values[:7]

    def queue_wall_us(self) -> Iterator[int]:
        """When each decision was written, in microseconds since 1970."""
        for values in self._decisions(0):
            yield values[7]

    def last_decision(self) -> int:
        """The number of the last decision of the queue, 0 for none."""
        last: int = next(self._rows(_LAST_DECISION, types="i"))[0]
        return last

    def _decisions(self, after: int) -> Iterator[tuple[Any, ...]]:
        recorded, chain = self._recorded(QUEUE), self._queue_chain()
        if after:
            links = next(self._rows(_QUEUE_LINKS, after, types="bb"), None)
            if links is None:
                if after <= self.last_decision():
                    raise chain.missing(after, after)
                return
            chain.count, (chain.link, chain.wall_link) = after, links
        for values in self._rows(_QUEUE, after, types=_QUEUE_TYPES):
            seq, wall_us = values[0], values[7]
            chain.take(seq, queue_line(values[:7]), wall_us, values[8:])
            if not 0 <= wall_us <= _LATEST_US:
                raise DamagedJournalError(f"{self.path}: decision {seq:,} of the queue has no date")
            yield values
        recorded.check(chain, self._last_mark())

    def _queue_chain(self) -> Chain:
        return Chain(self.path, ("decision", "the plan queue"), b"", b"", self._bare[1])

    def verify_queue(self) -> int:
        """The number of decisions of the queue; like ``verify``."""
        return sum(1 for _ in self._decisions(0))

    def _rows(self, statement: str, *values: object, types: str) -> Iterator[tuple[Any, ...]]:
        """Rows whose values are integers, strings and bytes, as ``types`` tells."""
        wanted = tuple(_TYPES[letter] for letter in types)
        statement = statement.replace("{wall_hash}", "x''" if self._first_form else "wall_hash")
        try:
            for row in self._connection.execute(statement, values):
                if tuple(map(type, row)) != wanted:
                    raise DamagedJournalError(f"{self.path}: there are values of the wrong type")
                yield row
        except DATABASE_ERRORS as error:
            raise journal_error(error, self.path, "read") from error

    def close(self) -> None:
        """Let go of the file."""
        self._connection.close()

    def __enter__(self) -> JournalReader:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _row(values: tuple[Any, ...]) -> Row:
    return Row._make((*values[:2], values[2] != 0, values[3] != 0, *values[4:14]))
