"""Engines, which do work on many items, and the order of what they give back.

A kind of engine is a module of ``gpsfsm.workers.builtin`` with a ``KIND``. ``map_items`` divides
items into chunks and puts results in order. A chunk that is lost with its machine is tried again, a
few times. A chunk whose process has ended is divided, until the item that ends processes is alone:
it has no result, all others do.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections import deque
from contextlib import closing
from dataclasses import dataclass, replace
from enum import Enum
from functools import cache
from typing import TYPE_CHECKING, Generic, Protocol, TypeAlias, TypeVar, cast

from gpsfsm.errors import UsageError
from gpsfsm.workers import builtin

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
    from types import TracebackType

Item = TypeVar("Item")
Result = TypeVar("Result")

Work: TypeAlias = "Callable[[Item], Result]"
"""The work that is done with an item.

It is sent to other processes, as are items and results: an object of a module that can be imported
there, with ``__call__``, such as a frozen dataclass. It raises nothing but UsageError.
"""


@dataclass(frozen=True, slots=True)
class Settled(Generic[Result]):
    """In place of an item: its result, for which nothing has to be done any more."""

    result: Result


class Later(Enum):
    """In place of an item: there is none now, but there will be after a result."""

    LATER = "later"


LATER = Later.LATER


@dataclass(frozen=True, slots=True)
class Lost:
    """There are no results, since the process that worked on the chunk has ended.

    ``how`` goes on after "the process that …". ``with_node``: the whole machine was lost, which is
    no fault of the items. ``late``: the process was ended because it took too long.
    """

    how: str
    with_node: bool = False
    late: bool = False


@dataclass(frozen=True, slots=True)
class Chunk(Generic[Item]):
    """Items that travel together, with their numbers; ``losses``: how often that went wrong."""

    numbers: tuple[int, ...]
    items: tuple[Item, ...]
    losses: int = 0


class Source(Protocol[Item]):
    """A source of chunks for an engine."""

    def take(self) -> Chunk[Item] | None:
        """The next chunk; None if there is none now. There may be one after a result."""


class Engine(Protocol):
    """A place where work is done; use it in a ``with`` statement.

    ``chunk_size``: the most items of a chunk; ``ahead``: the most chunks to hold at once. Both may
    be asked for once the engine has been entered.
    """

    @property
    def chunk_size(self) -> int:
        """The most items of a chunk."""

    @property
    def ahead(self) -> int:
        """The most chunks that are worked on, or wait for it, at once."""

    def __enter__(self) -> Engine:
        """Get ready. Raises UsageError if that is not possible."""

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
        /,
    ) -> object:
        """End all that is still running."""

    def map(
        self, work: Work[Item, Result], source: Source[Item], /
    ) -> Iterator[tuple[Chunk[Item], Sequence[Result] | Lost]]:
        """Each chunk with its results, as they come in.

        It ends when the source has nothing and nothing is under way. Raises UsageError if the work
        does.
        """


@dataclass(frozen=True, slots=True, kw_only=True)
class Kind:
    """A kind of engines: ``forms`` says what ``--jobs`` takes for it.

    ``order``: which kind is asked first. ``make`` gets the text of ``--jobs`` and the number of
    items, None if that is not known; ``make_timed`` also the seconds that an item may take. It is
    None where nothing can be ended.
    """

    order: int
    forms: str
    accepts: Callable[[str], bool]
    make: Callable[[str, int | None], Engine]
    make_timed: Callable[[str, int | None, float], Engine] | None = None


@cache
def all_kinds() -> tuple[Kind, ...]:
    """All kinds of engines, in the order in which they are asked."""
    names = sorted(module.name for module in pkgutil.iter_modules(builtin.__path__))
    kinds = [importlib.import_module(f"{builtin.__name__}.{name}").KIND for name in names]
    return tuple(sorted(kinds, key=lambda kind: kind.order))


def jobs_of(jobs: int | str) -> str:
    """The text of ``--jobs``, if there is an engine for it. Raises UsageError."""
    text = str(jobs).strip()
    if any(kind.accepts(text) for kind in all_kinds()):
        return text
    forms = "; ".join(kind.forms for kind in all_kinds())
    raise UsageError(f"'{text[:80]}' is not a value of --jobs; write {forms}")


def engine_of(
    jobs: int | str, items: int | None = None, *, timeout_s: float | None = None
) -> Engine:
    """Return the backend that ``--jobs`` names, for ``items`` items (None: unknown).

    ``timeout_s`` is the time limit of each item in seconds.

    Raises UsageError if there is no such backend, if it is not installed, or if it does not support
    time limits.
    """
    text = jobs_of(jobs)
    kind = next(kind for kind in all_kinds() if kind.accepts(text))
    if timeout_s is None:
        return kind.make(text, items)
    if kind.make_timed is None:
        raise UsageError(f"there is no time limit with --jobs {text}; use processes: --jobs N")
    return kind.make_timed(text, items, timeout_s)


MOST_NODES = 5
"""So many machines may be lost with a chunk before it is suspected."""
_WINDOW = 4
"""So many times the chunks of an engine may be ahead of the first one that has no result."""


def map_items(
    engine: Engine,
    work: Work[Item, Result],
    items: Iterable[Item | Settled[Result] | Later],
    *,
    lost: Callable[[Item, str], Result],
    late: Callable[[Item], Result] | None = None,
) -> Iterator[Result]:
    """Yield the result for each item in order, while later items are still being processed.

    ``lost(item, how)`` makes the result for an item whose process ended; ``how`` is a phrase that
    completes "the process that worked on it …". ``late(item)`` makes the result for an item that
    took too long; the default is ``lost``. Items are taken from the iterable as they are needed,
    and may depend on earlier results: yield LATER while the next item needs a result that is still
    missing.

    Raises UsageError if the work does, or if the backend is not available.
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
        items: Iterable[Item | Settled[Result] | Later],
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
        self._delivered = 0
        self._exhausted = False

    @property
    def over(self) -> bool:
        """True once nothing is left to take."""
        return self._exhausted and not self._again

    def take(self) -> Chunk[Item] | None:
        """The next chunk, first those that were lost."""
        if self._again:
            return self._again.popleft()
        chosen: dict[int, Item] = {}
        while len(chosen) < self._size and self._taken - self._delivered < self._window:
            try:
                item = next(self._items)
            except StopIteration:
                self._exhausted = True
                break
            if item is LATER:
                break
            if isinstance(item, Settled):
                self._results[self._taken] = item.result
            else:
                chosen[self._taken] = item
            self._taken += 1
        return Chunk(tuple(chosen), tuple(chosen.values())) if chosen else None

    def answer(self, chunk: Chunk[Item], results: Sequence[Result] | Lost) -> None:
        """Take in what has become of a chunk."""
        assert not self._results.keys() & set(chunk.numbers), "an item has two results"
        assert all(self._delivered <= number < self._taken for number in chunk.numbers)
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
        while self._delivered in self._results:
            result = self._results.pop(self._delivered)
            self._delivered += 1
            yield result
