"""Work on many items with any engine: chunks, what is lost on the way, and the order of results.

A chunk that is lost with its machine is tried again, a few times. A chunk whose process has ended
is divided, until the item that ends processes is alone: it has no result, all others do.
"""

from __future__ import annotations

from collections import deque
from contextlib import closing
from dataclasses import replace
from typing import TYPE_CHECKING, Generic, cast

from gpsfsm.workers.base import LATER, Chunk, Item, Known, Later, Lost, Result

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterable, Iterator, Sequence

    from gpsfsm.workers.base import Engine, Work

__all__ = ["MOST_NODES", "run"]

MOST_NODES = 5
"""So many machines may be lost with a chunk before it is suspected."""
_WINDOW = 4
"""So many times the chunks of an engine may be ahead of the first one that has no result."""


def run(
    engine: Engine,
    work: Work[Item, Result],
    items: Iterable[Item | Known[Result] | Later],
    *,
    lost: Callable[[Item, str], Result],
    late: Callable[[Item], Result] | None = None,
) -> Iterator[Result]:
    """The result for each item, in order, while later ones are still worked on.

    ``lost`` makes the result for an item that ended the process that worked on it; the text goes on
    after "the process that …". ``late`` does so for one that took too long, if that is another
    matter. Items are taken as they are needed, and may depend on the results so
    far: LATER stands where the next item needs one that is still to come. Raises UsageError if the
    work does, or if the engine is not to be had.
    """
    with engine:
        pending = _Pending(items, engine, lost, late)
        while not pending.over:
            done = cast(
                "Generator[tuple[Chunk[Item], Sequence[Result] | Lost]]", engine.map(work, pending)
            )
            with closing(done):
                for chunk, results in done:
                    pending.answer(chunk, results)
                    yield from pending.ready()
            yield from pending.ready()


class _Pending(Generic[Item, Result]):
    """A source of chunks that knows which results are still to come."""

    def __init__(
        self,
        items: Iterable[Item | Known[Result] | Later],
        engine: Engine,
        lost: Callable[[Item, str], Result],
        late: Callable[[Item], Result] | None,
    ) -> None:
        self._items = iter(items)
        self._size = engine.chunk_size
        self._window = _WINDOW * engine.ahead * engine.chunk_size
        self._lost, self._late = lost, late
        self._again: deque[Chunk[Item]] = deque()
        self._results: dict[int, Result] = {}
        self._taken = 0
        self._told = 0
        self._exhausted = False

    @property
    def over(self) -> bool:
        """Whether nothing is left to take."""
        return self._exhausted and not self._again

    def take(self) -> Chunk[Item] | None:
        """The next chunk, first those that were lost."""
        if self._again:
            return self._again.popleft()
        chosen: dict[int, Item] = {}
        while len(chosen) < self._size and self._taken - self._told < self._window:
            try:
                item = next(self._items)
            except StopIteration:
                self._exhausted = True
                break
            if item is LATER:
                break
            if isinstance(item, Known):
                self._results[self._taken] = item.result
            else:
                chosen[self._taken] = item
            self._taken += 1
        return Chunk(tuple(chosen), tuple(chosen.values())) if chosen else None

    def answer(self, chunk: Chunk[Item], results: Sequence[Result] | Lost) -> None:
        """What has become of a chunk."""
        if not isinstance(results, Lost):
            self._results.update(zip(chunk.numbers, results, strict=True))
        elif results.with_node and chunk.losses < MOST_NODES:
            self._again.append(replace(chunk, losses=chunk.losses + 1))
        elif len(chunk.items) > 1:
            half = len(chunk.items) // 2
            self._again.append(Chunk(chunk.numbers[:half], chunk.items[:half]))
            self._again.append(Chunk(chunk.numbers[half:], chunk.items[half:]))
        elif results.late and self._late is not None:
            self._results[chunk.numbers[0]] = self._late(chunk.items[0])
        else:
            self._results[chunk.numbers[0]] = self._lost(chunk.items[0], results.how)

    def ready(self) -> Iterator[Result]:
        """The results that are next in order."""
        while self._told in self._results:
            found = self._results.pop(self._told)
            self._told += 1
            yield found
