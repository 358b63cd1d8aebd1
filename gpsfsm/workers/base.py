"""What engines take and give."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Generic, Protocol, TypeAlias, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from types import TracebackType

__all__ = [
    "LATER",
    "Chunk",
    "Engine",
    "Item",
    "Kind",
    "Known",
    "Later",
    "Lost",
    "Result",
    "Source",
    "Work",
]

Item = TypeVar("Item")
Result = TypeVar("Result")

Work: TypeAlias = "Callable[[Item], Result]"
"""What is done with an item.

It is sent to other processes, as are items and results: an object of a module that can be imported
there, with ``__call__``, such as a frozen dataclass. It raises nothing but UsageError.
"""


@dataclass(frozen=True, slots=True)
class Known(Generic[Result]):
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
    """Where an engine gets its chunks."""

    def take(self) -> Chunk[Item] | None:
        """The next chunk; None if there is none now. There may be one after a result."""


class Engine(Protocol):
    """Where work is done; use it in a ``with`` statement.

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
