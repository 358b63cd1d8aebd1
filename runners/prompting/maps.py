"""Maps for models: a large one gets larger cells, so that it takes no more than some tokens."""

from __future__ import annotations

import re

__all__ = ["MAX_CELLS", "shortened_map"]

MAX_CELLS = 1_600
"""Cells of a map that a model is shown: each one may be a token."""
_MAX_OTHER = 6_000  # characters of what is no map that we can read

_HEAD = re.compile(
    r"width=(\d{1,6}) height=(\d{1,6}) resolution=(\d{1,6}(?:\.\d{1,9})?)(?: ([^\n]{0,100}))?"
)


def shortened_map(text: str) -> str:
    """A map in at most 1,600 cells; a large cell has something in it if any of its parts has.

    The form is that of OccupancyGridRunner: a line with ``width=`` ``height=`` ``resolution=``,
    then one line for each row, ``#`` for what has something in it. Other texts are clipped.
    """
    lines = text.strip().split("\n")
    head = _HEAD.fullmatch(lines[0].strip())
    rows = [line.strip() for line in lines[1:]]
    width = 0 if head is None else int(head[1])
    if head is None or len(rows) != int(head[2]) or any(len(row) != width for row in rows):
        return text if len(text) <= _MAX_OTHER else f"{text[:_MAX_OTHER]}…"
    side = 1
    while -(-width // side) * -(-len(rows) // side) > MAX_CELLS:
        side += 1
    if side == 1:
        return text
    coarse = [_row(rows[begin : begin + side], side) for begin in range(0, len(rows), side)]
    edge = float(head[3]) * side
    found = f"width={len(coarse[0])} height={len(coarse)} resolution={edge:g} {head[4] or ''}"
    return "\n".join((found.strip(), *coarse))


def _row(rows: list[str], side: int) -> str:
    """One row of large cells."""
    return "".join(
        "#" if any("#" in row[begin : begin + side] for row in rows) else "."
        for begin in range(0, len(rows[0]), side)
    )
