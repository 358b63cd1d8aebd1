"""The events of a run, and the decisions about the plans of a queue, as tables for people."""

from __future__ import annotations

from collections import Counter
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING

from gpsfsm.execution.queue_rows import QueueKind
from gpsfsm.execution.records import Status
from gpsfsm.model.printable import clip
from gpsfsm.watch.moments import seconds

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.execution.queue_rows import QueueRow
    from gpsfsm.watch.moments import Moment
    from gpsfsm.watch.record_text import Words


_EVENT_HEAD = ("event", "time", "kind", "what has happened")
WALL = "wall clock (UTC)"
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def table_lines(
    events: Iterable[tuple[Row, Moment]], words: Words, *, wall_clock: bool = False
) -> Iterator[str]:
    """One line per event, below a heading; without line ends."""
    yield _event_line(*_EVENT_HEAD, WALL if wall_clock else None)
    for row, moment in events:
        yield _event_line(
            str(row.seq),
            f"{seconds(row.at_us)} s",
            row.kind,
            words.sentence(moment.record),
            wall_time(row.wall_us) if wall_clock else None,
        )


def _event_line(seq: str, time: str, kind: str, event: str, wall: str | None) -> str:
    shown = "" if wall is None else f"{wall:<26}  "
    return f"{seq:>6}  {shown}{time:>12}  {kind:<10}  {event}"


def wall_time(wall_us: int) -> str:
    """Microseconds since 1970 as ``2026-01-31 12:00:00.000000``; "?" where there is no such date.

    >>> wall_time(1_500_000)
    '1970-01-01 00:00:01.500000'
    """
    try:
        moment = _EPOCH + timedelta(microseconds=wall_us)
    except OverflowError:
        return "?"
    return moment.strftime("%Y-%m-%d %H:%M:%S.%f")


_HEAD = ("decision", "time", "plan", "kind", "what has happened")
_LONGEST = 500
_ABOUT_MODELS = (QueueKind.ASKED, QueueKind.ATTEMPT, QueueKind.GENERATED)


def decision_lines(
    rows: Sequence[tuple[int, QueueRow]], wall_us: Sequence[int] | None = None
) -> Iterator[str]:
    """One line per decision, below a heading; without line ends. ``rows`` come with their times.

    ``wall_us``: when each was written, in microseconds since 1970, if that is to be shown.
    """
    yield _line(_HEAD, None if wall_us is None else WALL)
    for place, (at_us, row) in enumerate(rows):
        plan = str(row.plan) if row.plan else ""
        cells = (str(place + 1), f"{seconds(at_us)} s", plan, row.kind.value, _sentence(row))
        yield _line(cells, None if wall_us is None else wall_time(wall_us[place]))


def model_lines(rows: Sequence[tuple[int, QueueRow]], plan: int) -> Iterator[str]:
    """The requests to a model when a plan gave up, with its answers; nothing for other plans."""
    exchange = [row for _, row in rows if row.plan == plan and row.kind in _ABOUT_MODELS]
    if exchange:
        yield f"plan {plan} gave up:"
    for row in exchange:
        yield f"  {_sentence(row)}"


def _line(cells: tuple[str, str, str, str, str], wall: str | None) -> str:
    seq, time, plan, kind, event = cells
    shown = "" if wall is None else f"{wall:<26}  "
    return f"{seq:>8}  {shown}{time:>12}  {plan:>5}  {kind:<12}  {event}"


def _sentence(row: QueueRow) -> str:
    """The decision as a sentence about "it": the plan of the row."""
    data = row.data or {}
    if row.kind in _ABOUT_MODELS:
        return _of_a_model(row, data)
    if row.kind is QueueKind.SUBMITTED and "continues" in data:
        return f"it is queued, to continue where plan {clip(str(data['continues']), 20)} gave up"
    by = f" by plan {row.by}" if row.by else ""
    name = clip(str(data.get("name", "")), 200) or "it"
    message = clip(row.message, _LONGEST)
    because = f": {message}" if message else ""
    findings = data.get("findings")
    listed = findings if isinstance(findings, list) else []
    said = clip("; ".join(map(str, listed)), _LONGEST)
    sentences = {
        QueueKind.SUBMITTED: f"{name} is queued{by}",
        QueueKind.REFUSED: f"{name}{by and f', submitted{by},'} is refused: {said or 'no reason'}",
        QueueKind.BEGUN: "it is its turn",
        QueueKind.RUN: f"it is run {clip(str(data.get('run', '?')), 20)} of this journal",
        QueueKind.CANCEL: f"it is to be cancelled{by}{because}",
        QueueKind.ENDED: f"it has ended: {clip(str(data.get('status', '?')), 20)}{because}",
        QueueKind.BOND_LOST: f"the bond is lost, nothing begins{because}",
        QueueKind.BOND_RENEWED: "the bond is back",
        QueueKind.HELD: f"the queue is held, nothing begins{because}",
        QueueKind.RELEASED: "the queue is released",
    }
    return sentences.get(row.kind, message)


def _of_a_model(row: QueueRow, data: Mapping[str, object]) -> str:
    if row.kind is QueueKind.ASKED:
        model = clip(str(data.get("model", "")), 200)
        why = clip(str(data.get("why", "")), _LONGEST)
        return f"{model} is asked for a plan{why and f' that continues it: {why}'}"
    number = clip(str(data.get("round", "?")), 20)
    if row.kind is QueueKind.ATTEMPT:
        return f"attempt {number}: {_verdict(data)}"
    if data.get("accepted") is True:
        return f"the plan of attempt {number} is taken"
    return f"there is no plan: {clip(row.message, _LONGEST) or 'no reason'}"


def _verdict(data: Mapping[str, object]) -> str:
    problem, findings = data.get("problem"), data.get("findings")
    if problem or "accepted" not in data:
        return clip(str(problem or "no answer"), _LONGEST)
    if data["accepted"] is True:
        return "accepted"
    if not data.get("plan"):
        return "rejected, there is no plan in the answer"
    pairs = (
        [each for each in findings if isinstance(each, list)] if isinstance(findings, list) else []
    )
    errors = data.get("errors")
    most = errors if isinstance(errors, int) and errors > 0 else len(pairs)
    codes = ", ".join(dict.fromkeys(str(pair[0]) for pair in pairs[:most] if pair))
    return clip(f"rejected{codes and f', {codes}'}", _LONGEST)


def fates(rows: Sequence[tuple[int, QueueRow]]) -> str:
    """The number of plans and what has become of them, in words.

    >>> from gpsfsm.execution.queue import QueueRow
    >>> rows = [QueueRow(QueueKind.SUBMITTED, 1), QueueRow(QueueKind.REFUSED, 2)]
    >>> fates([(0, row) for row in [*rows, QueueRow(QueueKind.BEGUN, 1)]])
    '2 plans: 1 RUNNING, 1 REFUSED'
    """
    states: dict[int, str] = {}
    for _, row in rows:
        if row.kind is QueueKind.SUBMITTED:
            states[row.plan] = Status.QUEUED.value
        elif row.kind is QueueKind.REFUSED:
            states[row.plan] = Status.REFUSED.value
        elif row.kind is QueueKind.BEGUN:
            states[row.plan] = Status.RUNNING.value
        elif row.kind is QueueKind.ENDED:
            states[row.plan] = clip(str((row.data or {}).get("status", "?")), 20)
    counts = ", ".join(f"{count} {status}" for status, count in Counter(states.values()).items())
    return f"{len(states)} plan{'s' * (len(states) != 1)}{counts and f': {counts}'}"
