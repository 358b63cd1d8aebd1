"""Everything in this process, one item after the other: ``--jobs 1``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.workers.engines import Kind

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.workers.engines import Chunk, Engine, Item, Lost, Result, Source, Work


class Serial:
    """The engine without any other process: what ends the work ends this process."""

    chunk_size = 1
    ahead = 1

    def __enter__(self) -> Serial:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def map(
        self, work: Work[Item, Result], source: Source[Item], /
    ) -> Iterator[tuple[Chunk[Item], Sequence[Result] | Lost]]:
        """Each chunk with its results."""
        while (chunk := source.take()) is not None:
            yield chunk, [work(item) for item in chunk.items]


def _in_another_process(_jobs: str, _items: int | None, timeout_s: float) -> Engine:
    """An engine for items with a time limit: they must be ended, and this process must not."""
    from gpsfsm.workers.builtin.processes import Processes

    return Processes(1, timeout_s=timeout_s)


KIND = Kind(
    order=1,
    forms="1 for this process",
    accepts=lambda jobs: jobs == "1",
    make=lambda _jobs, _items: Serial(),
    make_timed=_in_another_process,
)
