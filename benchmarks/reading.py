"""How long does reading a plan take, against lxml, which makes a tree of the same text?

Both read the same bytes in turn, in one process. Attributes are made when they are first asked for,
as most rules do: "with attributes" asks each element for them. The scanner reads all texts in which
something is unusual; before there was a fast reader it read all. Memory is that of the plan; its
text is there anyway.

Hostile texts repeat what a reader may look for again and again: of each, how many times longer does
a text of twice the size take (2 if the time grows with the size, 4 if it grows with its square)?
"""

from __future__ import annotations

import argparse
import gc
import tempfile
import time
import tracemalloc
from pathlib import Path
from typing import TYPE_CHECKING
from unittest import mock

from lxml import etree

from benchmarks.common import circumstances, median, table, write_plan
from gpsfsm.syntax import frontend, parse

if TYPE_CHECKING:
    from collections.abc import Callable

FAMILIES: dict[str, Callable[[int], tuple[int, ...]]] = {
    "chain": lambda runners: (runners // 2,),
    "nested": lambda runners: (len(str(runners)) - 1, 10),
    "random": lambda runners: (1, runners),
}
SIZES = (10, 1_000, 10_000, 100_000)
MOST_ROUNDS = 300
TARGET = 5
HOSTILE = (
    *("<", "<!--", "<!-- < -->", '"', '="1', 'a="1 1"', "&", '<Runner a="1"', "<Control>"),
    *("<!-- gpsfsm: ignore -->", "<![CDATA[", "]]>", "\r"),
)
HOSTILE_SIZE = 400_000  # code points
TARGET_GROWTH = 3


def read(text: bytes) -> object:
    parsed = parse(text)
    assert parsed.plan is not None
    return parsed.plan


def read_attributes(text: bytes) -> object:
    plan = parse(text).plan
    assert plan is not None
    return plan, [element.attributes for element in plan.elements]


def scan(text: bytes) -> object:
    with mock.patch.object(frontend, "read_plain", return_value=None):
        return read(text)


def held_mb(way: Callable[[bytes], object], text: bytes) -> float:
    """The memory that stays while the plan is there, and its text is there anyway."""
    gc.collect()
    tracemalloc.start()
    plan = way(text)
    gc.collect()
    size, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    del plan
    return size / 1e6


def row(family: str, runners: int) -> tuple[list[str], float]:
    """One line of the table, and how many times longer than lxml reading takes."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "plan.xml"
        write_plan(file, family, *FAMILIES[family](runners))
        text = file.read_bytes()
    ways: tuple[Callable[[bytes], object], ...] = (etree.fromstring, read, read_attributes, scan)
    times: tuple[list[float], ...] = tuple([] for _ in ways)
    for number in range(max(3, min(MOST_ROUNDS, 50_000 // runners)) + 1):
        for way, spent in zip(ways, times, strict=True):
            started = time.perf_counter()
            result = way(text)
            if number:  # the first round fills the caches
                spent.append(1000 * (time.perf_counter() - started))
            del result
    theirs, *ours = map(median, times)
    figures = [f"{value:.2f} ({value / theirs:.1f}x)" for value in ours]
    memory = [f"{held_mb(way, text):.2f}" for way in (read, read_attributes, scan)]
    start = [family, f"{runners:,}", f"{len(text) / 1e6:.3f}", f"{theirs:.2f}"]
    return [*start, *figures, *memory], ours[0] / theirs


def growth(piece: str) -> tuple[list[str], float]:
    """One line about a hostile text, and how many times longer the one of twice its size takes."""
    texts = [
        b"<Plan>" + piece.encode() * (size // len(piece))
        for size in (HOSTILE_SIZE // 2, HOSTILE_SIZE)
    ]
    times: tuple[list[float], list[float]] = ([], [])
    for _ in range(5):
        for text, spent in zip(texts, times, strict=True):
            started = time.perf_counter()
            parse(text)
            spent.append(1000 * (time.perf_counter() - started))
    half, whole = map(min, times)
    return [f"`{piece!r}`", f"{half:.1f}", f"{whole:.1f} ({whole / half:.1f}x)"], whole / half


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--largest", type=int, default=SIZES[-1])
    largest = parser.parse_args().largest
    where = circumstances()
    measured = [row(family, size) for family in FAMILIES for size in SIZES if size <= largest]
    print(where)
    print()
    ways = ["lxml, ms", "reading, ms", "with attributes, ms", "scanner, ms"]
    memory = ["memory, MB", "with attributes, MB", "scanner, MB"]
    print(table(["family", "runners", "plan, MB", *ways, *memory], [line for line, _ in measured]))
    print()
    ratios = [ratio for _, ratio in measured]
    print(
        f"In parentheses: times lxml. Reading takes {min(ratios):.1f} to {max(ratios):.1f} times "
        f"as long as lxml (target: at most {TARGET})."
    )
    print()
    hostile = [growth(piece) for piece in HOSTILE]
    head = ["hostile piece", f"{HOSTILE_SIZE // 2:,} code points, ms", "twice as many, ms"]
    print(table(head, [line for line, _ in hostile]))
    print()
    print(
        f"Twice the size takes at most {max(ratio for _, ratio in hostile):.1f} times as long "
        f"(target: at most {TARGET_GROWTH})."
    )


if __name__ == "__main__":
    main()
