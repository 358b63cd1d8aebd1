"""The rows of a journal: what is kept of each event, and the one line that it is written as.

The line is canonical: the same event has the same bytes. It is what is exported (``jsonl``), what
is compared at a replay, and what the chain of hashes goes over. It carries no wall-clock time. What
rows say of each instance (``endings``) serves runs that go on: what an instance got from outside,
such as the answers of a language model, is not asked for again.
"""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass, field
from json.encoder import encode_basestring_ascii as quoted
from typing import TYPE_CHECKING, Any, NamedTuple

from gpsfsm.execution.journal_errors import DamagedJournalError
from gpsfsm.execution.records import Input, Kind, Record

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from gpsfsm.execution.journal_read import JournalReader, StoredRun
    from gpsfsm.execution.kernel import Kernel
    from gpsfsm.execution.queue import QueueRow
    from gpsfsm.execution.records import RunValue

_LONGEST = 10_000  # characters of a message
_WALL_BYTES = 8
"""Of a hash in the second chain: it is to show damage, in a column that makes rows longer."""


class Row(NamedTuple):
    """One event in a journal.

    - ``seq``: the number of the row; ``at_us``: its time in microseconds since the run began.
    - ``input``: the row came from outside; ``record``: it is an event of the run. Most inputs are
      both. If outputs are not declared by the provider, the answer is an input of its own with the
      outputs as they came.
    - ``node``, ``runner``: -1 if there is none; ``element``, ``interface`` and ``provider`` are the
      same in words.
    - ``cause``: the ``seq`` of the input that caused the event; 0 for inputs.
    - ``data``: canonical JSON of an object, or "".
    - ``wall_us``: microseconds since 1970; not part of the written line.
    """

    seq: int
    at_us: int
    input: bool
    record: bool
    kind: str
    node: int
    element: str
    runner: int
    interface: str
    provider: str
    cause: int
    data: str
    message: str
    wall_us: int = 0

    @property
    def values(self) -> dict[str, Any]:
        """The parameters, outputs or status of the event."""
        return decoded(self.data) if self.data else {}


def line(row: Row, *, wall_clock: bool = False) -> str:
    """The row as one line of JSON, without line end.

    >>> line(Row(1, 0, True, True, "BEGIN", -1, "", -1, "", "", 0, "", ""))
    '{"seq":1,"at_us":0,"kind":"BEGIN","input":true}'
    """
    parts = [f'{{"seq":{row.seq},"at_us":{row.at_us},"kind":{quoted(row.kind)}']
    if row.input:
        parts.append('"input":true' if row.record else '"input":true,"record":false')
    else:
        parts.append(f'"cause":{row.cause}')
    if row.node >= 0:
        parts.append(f'"node":{row.node},"element":{quoted(row.element)}')
    if row.runner >= 0:
        parts.append(f'"runner":{row.runner}')
    if row.interface:
        parts.append(f'"interface":{quoted(row.interface)},"provider":{quoted(row.provider)}')
    if row.data:
        parts.append(f'"data":{row.data}')
    if row.message:
        parts.append(f'"message":{quoted(row.message)}')
    if wall_clock:
        parts.append(f'"wall_us":{row.wall_us}')
    return ",".join(parts) + "}"


def is_regular(values: Sequence[Any]) -> bool:
    """True if the first values of a stored row are as ``RowMaker`` makes them.

    Of a row that is, the line leaves nothing out but ``unlined``, so the chains cover all of it.
    """
    seq, at_us, happened, record, _, node, element, runner, interface, provider, cause = values[:11]
    return (
        seq > 0 <= at_us
        and ((happened == 1 and cause == 0 and record in (0, 1)) or (happened == 0 and record == 1))
        and (node >= 0 or (node == -1 and not element))
        and (runner >= 0 or runner == -1)
        and bool(interface or not provider or node >= 0 or runner >= 0)
    )


def unlined(row: Row) -> str | None:
    """The provider of a runner that has no interface, which the line leaves out; else None.

    Only a plan that was forced has such runners. The line stays as it is, for it is also what
    journals are compared by; so the second chain covers the provider.
    """
    return None if row.interface else row.provider


class RowMaker:
    """Makes rows of inputs and records, numbered on from ``seq``; ``kernel`` is one of the run."""

    def __init__(self, kernel: Kernel, seq: int = 0) -> None:
        self.seq = seq
        self._name = kernel.automaton.name
        self._runner_node = kernel.automaton.runner_node
        self._runners = kernel.runners
        self._runner_of = kernel.runner_of
        self._words: dict[int, tuple[str, str, str]] = {-1: ("", "", "")}

    def make(self, at_us: int, happened: Input, records: Sequence[Record]) -> list[Row]:
        """The rows of one input and what follows from it; ``seq`` is then that of the last."""
        node = -1 if happened.number < 0 else self._runner_node(happened.number)
        data = canonical(happened.outputs) if happened.outputs else ""
        first = self.seq + 1
        rows: list[Row] = []
        if not (records and _same(records[0], happened, node, data)):
            raw = Record(happened.kind, node, happened.runner, happened.outputs, happened.message)
            rows.append(self._row(raw, at_us, 0)._replace(record=False))
        rows += [self._row(record, at_us, first) for record in records]
        rows[0] = rows[0]._replace(input=True, cause=0)
        self.seq += len(rows)
        return [row._replace(seq=first + place) for place, row in enumerate(rows)]

    def _row(self, record: Record, at_us: int, cause: int) -> Row:
        kind, node, runner, data, message = record
        words = self._words.get(node)
        if words is None:
            words = self._words[node] = self._described(node)
        element, interface, provider = words
        if runner >= 0:
            interface, provider = self._runners[runner]
        return Row(
            seq=0,
            at_us=at_us,
            input=False,
            record=True,
            kind=kind.value,
            node=node,
            element=element,
            runner=runner,
            interface=interface,
            provider=provider,
            cause=cause,
            data=canonical(data) if data else "",
            message=clean(message) if message else "",
        )

    def _described(self, node: int) -> tuple[str, str, str]:
        number = node - self._runner_node(0)
        if 0 <= number < len(self._runner_of):
            return (self._name(node), *self._runners[self._runner_of[number]])
        return self._name(node), "", ""


def _same(record: Record, happened: Input, node: int, data: str) -> bool:
    """True if a record says all that an input says."""
    return (
        record.kind is happened.kind
        and record.node == node
        and record.runner == happened.runner
        and record.message == happened.message
        and (canonical(record.data) if record.data else "") == data
    )


def input_of(row: Row, instances: int, runners: int) -> Input:
    """The input that a row tells of, in a plan of so many instances and runners."""
    try:
        kind = Kind(row.kind)
    except ValueError:
        raise DamagedJournalError(f"event {row.seq} has the unknown kind {row.kind}") from None
    number = -1 if row.node < 0 else row.node - 1
    if number >= instances or row.runner >= runners or row.node == 0:
        raise DamagedJournalError(f"event {row.seq} is about a runner that the plan does not have")
    return Input(kind, number, row.runner, row.values, row.message)


def clean(text: str) -> str:
    """Text that every file and terminal can hold: no lone surrogates, 10,000 characters."""
    text = text[:_LONGEST]
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def canonical(values: Mapping[str, Any]) -> str:
    """JSON with sorted names and without spaces; nan and infinities become text."""
    try:
        return _ENCODE(values)
    except ValueError:
        return _ENCODE(_finite(values))


_ENCODE = json.JSONEncoder(
    ensure_ascii=True, allow_nan=False, sort_keys=True, separators=(",", ":")
).encode


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _finite(each) for name, each in value.items()}
    if isinstance(value, list):
        return [_finite(each) for each in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value


def decoded(data: str) -> dict[str, RunValue]:
    """The object that canonical JSON stands for. Raises DamagedJournalError."""
    try:
        values = json.loads(data)
    except (ValueError, RecursionError):
        values = None
    if not isinstance(values, dict):
        raise DamagedJournalError(f"the data of an event are damaged: {data!r:.80}")
    return values


def queue_line(values: Sequence[Any]) -> str:
    """A decision of the plan queue as one line: what the chain of hashes goes over."""
    return canonical({"decision": list(values)})


def heading_wall_hash(name: str, file: str, wall_us: int) -> bytes:
    """The beginning of the second chain of a run: its id, the name of its plan, its time."""
    return chained(b"", f"{wall_us} {name}\n{file}")[:_WALL_BYTES]


def wall_chained(previous: bytes, seq: int, wall_us: int, provider: str | None = None) -> bytes:
    """The hash in the second chain, for when an event or a decision was written.

    The second chain covers what the first one must not: that differs between runs that are equal.
    It also covers what the line leaves out (``unlined``).
    """
    more = f"\n{provider}".encode() if provider else b""
    return hashlib.sha256(b"%b%d %d%b" % (previous, seq, wall_us, more)).digest()[:_WALL_BYTES]


def chained(previous: bytes, text: str) -> bytes:
    """The hash of a line in the chain."""
    return hashlib.sha256(previous + text.encode()).digest()


_ENDS = (Kind.SUCCEEDED, Kind.FAILED, Kind.TIMEOUT, Kind.STOPPED)


class LogLine(NamedTuple):
    """A line that an instance logged; ``data`` say the same for programs, if they say anything."""

    at_us: int
    text: str
    data: Mapping[str, RunValue]


@dataclass(slots=True)
class Ending:
    """One instance: its parameters, the lines that it logged, and its end if it has one.

    ``kind`` is "" while there is none; ``at_us`` is the time of the end, ``outputs`` are those that
    the runner gave, declared or not.
    """

    parameters: Mapping[str, RunValue] = field(default_factory=dict)
    lines: list[LogLine] = field(default_factory=list)
    kind: str = ""
    at_us: int = -1
    outputs: Mapping[str, RunValue] = field(default_factory=dict)
    message: str = ""


def endings(rows: Iterable[Row]) -> dict[int, Ending]:
    """The ending of each instance that was triggered, by its number."""
    by_number: dict[int, Ending] = {}
    for row in rows:
        number = row.node - 1  # node 0 is the start
        if row.kind == Kind.TRIGGERED:
            by_number.setdefault(number, Ending()).parameters = row.values
        elif number not in by_number:
            continue
        elif row.kind == Kind.LOG:
            by_number[number].lines.append(LogLine(row.at_us, row.message, row.values))
        elif row.kind in _ENDS and not by_number[number].kind:
            ending = by_number[number]
            ending.kind, ending.at_us = row.kind, row.at_us
            ending.outputs, ending.message = row.values, row.message
    return by_number


def jsonl(run: StoredRun, rows: Iterable[Row], *, wall_clock: bool = False) -> Iterator[str]:
    """One line of JSON for the run, then one for each event; with line ends.

    Without ``wall_clock`` nothing depends on when, where or as which run of a file it was run.
    """
    yield _header(run, wall_clock=wall_clock)
    for row in rows:
        yield line(row, wall_clock=wall_clock) + "\n"


def journal_jsonl(
    reader: JournalReader, run: StoredRun, *, wall_clock: bool = False
) -> Iterator[str]:
    """The same for all events of a run in a journal, whose lines the reader has made already."""
    yield _header(run, wall_clock=wall_clock)
    for row, text in reader.events_written(run.number):
        yield (line(row, wall_clock=True) if wall_clock else text) + "\n"


def _header(run: StoredRun, *, wall_clock: bool) -> str:
    header = {"journal": 1, **run.header}
    if wall_clock:
        header["wall_us"] = run.wall_us
    return canonical(header) + "\n"


def queue_jsonl(
    rows: Iterable[tuple[int, QueueRow]], wall_us: Sequence[int] | None = None
) -> Iterator[str]:
    """One line of JSON for each decision of a plan queue, with line ends.

    ``wall_us``: when each was written, in microseconds since 1970, if that is to be told.
    """
    for place, (at_us, row) in enumerate(rows):
        parts = [f'{{"seq":{place + 1},"at_us":{at_us},"kind":{quoted(row.kind.value)}']
        if row.plan:
            parts.append(f'"plan":{row.plan},"by":{row.by}')
        if row.data:
            parts.append(f'"data":{canonical(row.data)}')
        if row.message:
            parts.append(f'"message":{quoted(row.message)}')
        if wall_us is not None:
            parts.append(f'"wall_us":{wall_us[place]}')
        yield ",".join(parts) + "}\n"
