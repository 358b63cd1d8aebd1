"""A campaign: batch after batch of the comparison that is furthest from its goal."""

from __future__ import annotations

import multiprocessing
import time
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tests.campaigns.batch import Batch, play

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    from tests.campaigns.base import Pair
    from tests.campaigns.counts import Counts

__all__ = ["Goal", "campaign", "reproducer"]


@dataclass(frozen=True, slots=True)
class Goal:
    """When to stop: at ``cases`` of a comparison, after ``seconds``, whatever comes first.

    ``cases`` None: the number that the comparison has for a long campaign. However short the time
    is, there is a batch for each comparison: none passes without having been made.
    """

    cases: int | None = None
    seconds: float | None = None

    def of(self, pair: Pair) -> int:
        return pair.full if self.cases is None else self.cases


def campaign(
    pairs: Mapping[str, Pair],
    counts: Counts,
    goal: Goal,
    *,
    jobs: int = 1,
    tell: Callable[[Batch], None] = lambda batch: None,
) -> Iterator[Batch]:
    """Play batches until every goal is reached or one disagrees, and count them."""
    until_s = None if goal.seconds is None else time.monotonic() + goal.seconds
    batches = _batches(pairs, counts, goal)
    for done in _played(batches, jobs, until_s, least=len(pairs)):
        counts.tally(done.pair).add(done)
        tell(done)
        yield done
        if done.failure is not None:
            return


def _batches(
    pairs: Mapping[str, Pair], counts: Counts, goal: Goal
) -> Iterator[tuple[str, int, int, int]]:
    """What to play next: name, seed, number of the batch and how many cases.

    A batch may find fewer different cases than it was asked for; what is given out counts as
    played here, so that a comparison with few cases comes to an end.
    """
    counts_ = {name: counts.tally(name).cases for name in pairs}
    while True:
        open_ = [name for name, pair in pairs.items() if counts_[name] < goal.of(pair)]
        if not open_:
            return
        name = min(open_, key=lambda name: counts_[name] / goal.of(pairs[name]))
        size = min(pairs[name].batch, goal.of(pairs[name]) - counts_[name])
        tally = counts.tally(name)
        number = tally.batches
        tally.batches += 1
        counts_[name] += size
        yield name, counts.seed, number, size


def _played(
    batches: Iterator[tuple[str, int, int, int]], jobs: int, until_s: float | None, least: int
) -> Iterator[Batch]:
    begun = 0

    def in_time() -> bool:
        return until_s is None or begun < least or time.monotonic() < until_s

    if jobs == 1:
        while in_time() and (each := next(batches, None)) is not None:
            begun += 1
            yield play(*each)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=context) as pool:
        running: set[Future[Batch]] = set()
        while True:
            while len(running) < jobs and in_time():
                with suppress(StopIteration):
                    running.add(pool.submit(play, *next(batches)))
                    begun += 1
                    continue
                break
            if not running:
                return
            done, running = wait(running, return_when=FIRST_COMPLETED)
            for each in done:
                yield each.result()


def reproducer(done: Batch, folder: Path) -> Path:
    """Write down the smallest case of a failure, and how to come by it again."""
    assert done.failure is not None
    place = folder / f"{done.pair}-{done.seed}-{done.number}"
    place.mkdir(parents=True, exist_ok=True)
    (place / "case.txt").write_text(done.failure.text, encoding="utf-8", errors="surrogatepass")
    again = f"python -m tests.campaigns --only {done.pair} --seed {done.seed} --batch {done.number}"
    said = f"{again}\n\n{done.failure.said}"
    (place / "said.txt").write_text(said, encoding="utf-8", errors="backslashreplace")
    return place
