"""Order, division and repetition, held against what must come out, with engines made of chance."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.errors import UsageError
from gpsfsm.workers import LATER, Lost, Settled, engine_of, map_items
from gpsfsm.workers.builtin.processes import Processes
from gpsfsm.workers.builtin.serial import Serial
from gpsfsm.workers.engines import MOST_NODES

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.workers import Chunk, Later, Source


class Chance:
    """Answers chunks in any order; loses those with a killer, and others with their machine."""

    def __init__(self, seed: int, chunk_size: int, ahead: int, killers: set[int]) -> None:
        self.chunk_size = chunk_size
        self.ahead = ahead
        self._random = random.Random(seed)  # noqa: S311
        self._killers = killers
        self.entered = 0
        self.most = 0
        self.lost_with_node = 0

    def __enter__(self) -> Chance:
        self.entered += 1
        return self

    def __exit__(self, *_: object) -> None:
        self.entered -= 1

    def map(self, work: Any, source: Source[Any]) -> Iterator[tuple[Chunk[Any], Any]]:
        flying: list[Chunk[Any]] = []
        while True:
            while len(flying) < self.ahead and (chunk := source.take()) is not None:
                assert 1 <= len(chunk.items) <= self.chunk_size
                flying.append(chunk)
            self.most = max(self.most, len(flying))
            if not flying:
                return
            chunk = flying.pop(self._random.randrange(len(flying)))
            if chunk.losses < MOST_NODES and self._random.random() < 0.2:
                self.lost_with_node += 1
                yield chunk, Lost("was lost", with_node=True)
            elif self._killers & set(chunk.items):
                yield chunk, Lost("was killed")
            else:
                yield chunk, [work(item) for item in chunk.items]


@given(
    count=st.integers(0, 120),
    killers=st.sets(st.integers(0, 119), max_size=6),
    failing=st.sets(st.integers(0, 119), max_size=40),
    sizes=st.tuples(st.integers(1, 30), st.integers(1, 5)),
    seed=st.integers(0, 1000),
)
def test_every_item_has_its_result_in_order(
    count: int, killers: set[int], failing: set[int], sizes: tuple[int, int], seed: int
) -> None:
    engine = Chance(seed, *sizes, killers - failing)
    items = [Settled(-item) if item in failing else item for item in range(count)]
    results = list(
        map_items(engine, lambda item: 10 * item, items, lost=lambda item, how: (item, how))
    )
    expected = [
        -item if item in failing else (item, "was killed") if item in killers else 10 * item
        for item in range(count)
    ]
    assert results == expected
    assert engine.most <= sizes[1]
    assert engine.entered == 0


def test_items_are_taken_only_as_they_are_needed() -> None:
    taken: list[int] = []

    def items() -> Iterator[int]:
        for item in range(10_000):
            taken.append(item)
            yield item

    engine = Chance(3, 10, 2, set())
    results = map_items(engine, lambda item: item, items(), lost=lambda item, _: item)
    for wanted in range(500):
        assert next(results) == wanted
        assert len(taken) <= wanted + 1 + 4 * 2 * 10 + 10
    results.close()  # type: ignore[attr-defined]
    assert engine.entered == 0


@given(st.integers(1, 20), st.integers(1, 5), st.integers(0, 1000))
def test_items_may_depend_on_results(chunk_size: int, ahead: int, seed: int) -> None:
    """A tree is walked: each result tells how many further items there are."""
    todo: list[int] = [4]
    open_items = 0

    def items() -> Iterator[int | Later]:
        nonlocal open_items
        while todo or open_items:
            if todo:
                open_items += 1
                yield todo.pop()
            else:
                yield LATER

    actual = []
    engine = Chance(seed, chunk_size, ahead, set())
    for result in map_items(engine, lambda item: item, items(), lost=lambda item, _: item):
        open_items -= 1
        actual.append(result)
        todo.extend([result - 1] * result)
    assert sorted(actual, reverse=True) == [4, *[3] * 4, *[2] * 12, *[1] * 24, *[0] * 24]


def test_a_chunk_that_is_lost_with_every_machine_is_divided_in_the_end() -> None:
    class Doomed(Chance):
        def map(self, work: Any, source: Source[Any]) -> Iterator[tuple[Chunk[Any], Any]]:
            while (chunk := source.take()) is not None:
                lost = 3 in chunk.items
                self.lost_with_node += lost
                yield chunk, Lost("was lost", with_node=True) if lost else [0] * len(chunk.items)

    engine = Doomed(0, 4, 1, set())
    actual = list(
        map_items(engine, lambda item: item, range(4), lost=lambda item, how: f"{item} {how}")
    )
    assert actual == [0, 0, 0, "3 was lost"]
    assert engine.lost_with_node == 3 * (MOST_NODES + 1)  # four items, two, one


@pytest.mark.parametrize("jobs", ["", "2.5", "-1", "257", "ray:", "ray://", "ray://host", "dask"])
def test_jobs_that_there_are_not(jobs: str) -> None:
    with pytest.raises(UsageError, match=r"write 1 for .*; ray, or ray://HOST:PORT"):
        engine_of(jobs)


def test_which_engine_it_is() -> None:
    assert isinstance(engine_of(1), Serial)
    assert isinstance(engine_of("1", 10), Serial)
    assert isinstance(engine_of(8, 1), Serial)
    several = engine_of(8, 5)
    assert isinstance(several, Processes)
    assert several.ahead == 5
