"""The built-in properties of runs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.words import listed, place
from gpsfsm.execution.journal_errors import DamagedJournalError, ReplayDivergence
from gpsfsm.execution.journal_rows import RowMaker
from gpsfsm.execution.records import Status
from gpsfsm.execution.replay import replay
from gpsfsm.fuzzing.properties import Breach, Property
from gpsfsm.fuzzing.runs import fresh_kernel
from gpsfsm.model.finding import Severity

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.fuzzing.runs import Run, Span


def _completes(run: Run) -> Iterator[Breach]:
    """Every run completes: for plans of which no failure is an excuse."""
    if run.status not in (Status.COMPLETED, Status.CANCELLED):
        how = "gives up" if run.status is Status.GAVE_UP else "is stuck"
        yield Breach(f"the {run.whole} {how}", _last_failure(run), (str(run.status),))


def _last_failure(run: Run) -> tuple[int, ...]:
    """The instance whose failure came last: most likely the one that nothing recovers from."""
    failed = [event.number for event in run.events if event.kind == "FAILED"]
    return tuple(failed[-1:])


def _ends(run: Run) -> Iterator[Breach]:
    """The plan completes or gives up, and nothing waits for ever.

    A run of a machine that was cut off says nothing: it may still end.
    """
    if run.status in (Status.COMPLETED, Status.GAVE_UP, Status.CANCELLED):
        return
    waiting = run.active_at_end
    if waiting:
        who = listed([place(run.runner(number)) for number in waiting])
        message = f"the {run.whole} waits for ever for {who}"
    else:
        message = (
            f"the {run.whole} is stuck: nothing acts any more, and it neither completes nor gives "
            "up"
        )
    yield Breach(message, waiting, (str(run.status), "waiting" if waiting else "idle"))


def _no_orphan(run: Run) -> Iterator[Breach]:
    """No runner is active when the plan completes (semantics, section 4)."""
    if run.status is not Status.COMPLETED:
        return
    for number in run.active_at_end:
        runner = run.runner(number)
        message = f"{place(runner)} is still active when the {run.whole} completes"
        yield Breach(message, (number,), (run.plan.path(runner),))


_MOST = 20
"""Breaches that are told of one run: of a thousand runners side by side all pairs overlap."""


def _no_overlap(run: Run) -> Iterator[Breach]:
    """No two runners hold the same resource at one instant (semantics, section 8.4)."""
    overlaps = 0
    for resource, spans in _holders(run).items():
        for one, other in _meeting(spans):
            both = [run.runner(number) for number in (one, other)]
            yield Breach(
                f"{place(both[0])} and {place(both[1])} both hold the resource '{resource}'",
                (other, one),
                (resource, *(run.plan.path(runner) for runner in both)),
            )
            overlaps += 1
            if overlaps >= _MOST:
                return


def _holders(run: Run) -> dict[str, list[Span]]:
    """The times at which a resource is held, by instance in document order."""
    holders: dict[str, list[Span]] = {}
    for span in run.spans:
        binding = run.compiled.bindings[span.number]
        for resource in () if binding is None else dict.fromkeys(binding.provider.resources):
            holders.setdefault(resource, []).append(span)
    return holders


def _meeting(spans: list[Span]) -> Iterator[tuple[int, int]]:
    """The pairs that are active at one instant, not later than the one that fixes the end.

    In the order in which they come to meet; each pair in document order, and once.
    """
    active: list[Span] = []
    met: set[tuple[int, int]] = set()
    for span in sorted(spans, key=lambda each: each.begin_us):
        active = [each for each in active if each.end_us > span.begin_us]
        for each in active:
            pair = min(each.number, span.number), max(each.number, span.number)
            if pair not in met:
                met.add(pair)
                yield pair
        active.append(span)


def _replays(run: Run) -> Iterator[Breach]:
    """The inputs of a run lead a fresh kernel to the same events."""
    fresh = fresh_kernel(run.subject)
    maker = RowMaker(fresh)
    rows: list[Row] = []
    for at_us, happened, records in run.moments:
        rows += maker.make(at_us, happened, records)
    try:
        replay(fresh, rows)
    except (ReplayDivergence, DamagedJournalError) as error:
        yield Breach(f"the run does not replay from its journal: {error}", (), ("diverges",))
        return
    if fresh.status is not run.status:
        yield Breach(f"the replay ends {fresh.status}, the run {run.status}", (), ("ends",))


PROPERTIES = (
    Property("completes", "every run completes", _completes),
    Property("ends", "every run completes or gives up", _ends, by_default=True),
    Property(
        "no-orphan",
        "when the plan completes, no runner is active any more",
        _no_orphan,
        Severity.WARNING,
        by_default=True,
    ),
    Property(
        "no-overlap", "no two runners hold the same resource at once", _no_overlap, by_default=True
    ),
    Property(
        "replays",
        "the journal of every run leads to the same events again",
        _replays,
        by_default=True,
    ),
)
