"""The write-ahead log of a journal, read without SQLite, which ends it silently at any damage.

The format is that of https://sqlite.org/fileformat2.html#the_write_ahead_log. Nothing is changed.
"""

from __future__ import annotations

import struct
import time
from pathlib import Path
from typing import IO, NamedTuple

__all__ = ["Break", "damage_of"]

_HEADER = struct.Struct(">8I")
_FRAME = struct.Struct(">6I")
_MAGIC = 0x377F0682  # the last bit says in which order the bytes of words are summed up
_SMALLEST_PAGE, _LARGEST_PAGE = 512, 65536
_LONGEST = 1 << 28
"""Bytes of a log that are looked at. SQLite keeps it at a few megabytes."""

_SECOND_LOOK_S = 0.02


class Break(NamedTuple):
    """Where a log is not as it was written: the first byte of that frame, and what is there."""

    place: int
    found: bytes


def damage_of(path: str) -> Break | None:
    """Where the log at ``path`` is damaged; None if it is not, or there is none.

    A crash may leave the last transaction incomplete. What cannot come of one is damage: further
    transactions behind a frame that is not as it was written. Raises OSError.
    """
    found = _first_break(path)
    if found is not None:
        time.sleep(_SECOND_LOOK_S)  # what is just being written looks otherwise by then
        if _first_break(path) != found:
            return None
    return found


def _first_break(path: str) -> Break | None:
    place = Path(path)
    if not place.is_file():  # it is not there, or a pipe, at which one could wait for ever
        return None
    try:
        with place.open("rb") as log:
            return _break_of(log)
    except FileNotFoundError:
        return None


def _break_of(log: IO[bytes]) -> Break | None:
    start = log.read(_HEADER.size)
    if len(start) < _HEADER.size:
        return None
    magic, _, size, _, *salts, first, second = _HEADER.unpack(start)
    known = magic & ~1 == _MAGIC and size.bit_count() == 1
    if not (known and _SMALLEST_PAGE <= size <= _LARGEST_PAGE):
        return _unless_empty(log, start)
    order = ">" if magic & 1 else "<"
    if _sums(start[:24], order, (0, 0)) != (first, second):
        return _unless_empty(log, start)
    sums = (first, second)
    place = log.tell()
    while place < _LONGEST:
        head, page = log.read(_FRAME.size), log.read(size)
        if len(page) < size:
            return None
        number, _, *rest = _FRAME.unpack(head)
        sums = _sums(page, order, _sums(head[:8], order, sums))
        if not number or rest != [*salts, *sums]:
            behind = _commits(log, place, (_FRAME.size + size, salts))
            return Break(place, head) if behind else None
        place += len(head) + size
    return None


def _unless_empty(log: IO[bytes], start: bytes) -> Break | None:
    """A log whose beginning is damaged, if there can be any frame in it."""
    behind = log.read(_FRAME.size + _SMALLEST_PAGE)
    return Break(0, start) if len(behind) == _FRAME.size + _SMALLEST_PAGE else None


def _commits(log: IO[bytes], place: int, shape: tuple[int, list[int]]) -> bool:
    """Whether more than one incomplete transaction begins at ``place``.

    ``shape`` is the size of a frame and the salts of those that belong to this log: behind them
    there may be those of an older one.
    """
    size, salts = shape
    ended = False
    for each in range(place, _LONGEST, size):
        log.seek(each)
        head = log.read(_FRAME.size)
        if len(head) < _FRAME.size:
            return False
        number, commit, *rest = _FRAME.unpack(head)
        if not number or rest[:2] != salts:
            continue
        if ended:
            return True
        ended = commit != 0
    return False


def _sums(content: bytes, order: str, sums: tuple[int, int]) -> tuple[int, int]:
    """The running checksum of a log."""
    words = struct.unpack(f"{order}{len(content) // 4}I", content)
    first, second = sums
    for even, odd in zip(words[::2], words[1::2], strict=True):
        first = (first + even + second) & 0xFFFFFFFF
        second = (second + odd + first) & 0xFFFFFFFF
    return first, second
