"""Reading files of a user: bounded in bytes and in time, and nothing that is no file.

A path may lead to a pipe at which nobody writes, to a device that never ends, or, since links are
cheap, to anything else. So a path is opened without waiting, and only then it is looked at what it
is: in between nobody can put something else in its place.
"""

from __future__ import annotations

import errno
import os
import select
import stat
import time
from typing import TYPE_CHECKING

from gpsfsm.errors import InputError, system_reason

if TYPE_CHECKING:
    from pathlib import Path

OPENED_S = 1.0
"""A pipe that a path leads to is given up if nobody has opened its other end after so many seconds:
a shell that does so has begun before us."""

WRITER_S = 10.0
"""So is one to which nobody has written after so many."""

WHOLE_S = 600.0
"""And one that has not ended after so many, and standard input: whoever writes may think, but not
for ever."""

_CHUNK = 1 << 18
_NOT_REGULAR = "is not a regular file"
_LOOK_S = 0.05


def read(
    path: str | Path, max_bytes: int, *, pipes: bool = True, within_s: float | None = None
) -> bytes:
    """The content of a file, at most one byte more than is allowed: that tells that it is too long.

    ``pipes``: pipes are read as well, as a shell makes them of ``<(…)``; devices never are.
    ``within_s``: they have to end in this time, if it is less than ``WHOLE_S``. Raises InputError,
    whose text goes on after the path.
    """
    if not str(path):  # this was a variable without a value
        raise InputError("cannot be read: the path is empty")
    try:
        number = os.open(path, _flags())
    except (OSError, ValueError) as error:
        if getattr(error, "errno", None) == errno.ENXIO:  # a socket
            raise InputError(_NOT_REGULAR) from None
        raise InputError(f"cannot be read: {system_reason(error)}") from error
    try:
        mode = os.fstat(number).st_mode
        if stat.S_ISDIR(mode):
            raise InputError("cannot be read: it is a folder")
        if not (stat.S_ISREG(mode) or (pipes and stat.S_ISFIFO(mode))):
            raise InputError(_NOT_REGULAR)
        return read_from(number, max_bytes, begun=False, within_s=within_s)
    finally:
        os.close(number)


def read_whole(path: str | Path, max_bytes: int) -> bytes:
    """The whole of a file. Raises InputError as ``read`` does, and if it is larger than this."""
    content = read(path, max_bytes)
    if len(content) > max_bytes:
        raise InputError(f"is larger than {max_bytes} bytes")
    return content


def read_from(
    number: int, max_bytes: int, *, begun: bool = True, within_s: float | None = None
) -> bytes:
    """The bytes from a file descriptor, at most one byte more than is allowed.

    In chunks, since one read would claim the memory of the whole limit. ``begun``: a pipe has a
    writer, or has had one; if not, it must have been opened without waiting. ``within_s``: as for
    ``read``. Raises InputError.
    """
    chunks: list[bytes] = []
    left = max_bytes + 1
    try:
        mode = os.fstat(number).st_mode
        piped = stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode)
        pipe = _Pipe(number, begun=begun, within_s=within_s) if piped else None
        while left > 0:
            most = min(left, _CHUNK)
            chunk = os.read(number, most) if pipe is None else pipe.read(most)
            if not chunk:
                break
            chunks.append(chunk)
            left -= len(chunk)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}") from error
    return b"".join(chunks)


def _flags() -> int:
    """Flags to open a path: without waiting, and its bytes as they are; as far as systems can."""
    return os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)


class _Pipe:
    """Reads from a pipe, and gives it up in time.

    Where nothing can poll, as on Windows, a read waits, and the clock is looked at between reads.
    """

    def __init__(self, number: int, *, begun: bool, within_s: float | None) -> None:
        self._number = number
        self._whole_s = WHOLE_S if within_s is None else min(within_s, WHOLE_S)
        self._poll = select.poll() if hasattr(select, "poll") else None
        if self._poll is not None:
            self._poll.register(number, select.POLLIN | select.POLLHUP)
        self._began_s = time.monotonic()
        self._patient = begun
        # A pipe that nobody has opened yet looks as if it were at its end, but has none.
        self._opened = begun or self._poll is None

    def read(self, most: int) -> bytes:
        """The next bytes, none at the end. Raises InputError."""
        while True:
            if self._opened:
                self._wait()
            try:
                chunk = os.read(self._number, most)
            except BlockingIOError:  # somebody has opened it, and not yet written
                self._opened = True
                if self._poll is None:
                    time.sleep(_LOOK_S)
                continue
            if chunk or self._opened or (self._poll and self._poll.poll(0)):
                self._opened = self._patient = True
                return chunk
            if self._left_s() <= 0:
                raise self._late()
            time.sleep(_LOOK_S)

    def _wait(self) -> None:
        """Until there is something to read, or the end. Raises InputError if the time is up."""
        left_s = self._left_s()
        if left_s <= 0 or not (self._poll is None or self._poll.poll(1000 * left_s)):
            raise self._late()

    def _late(self) -> InputError:
        limit_s = self._limit_s()
        if self._patient or limit_s == self._whole_s:
            return InputError(f"cannot be read: this pipe did not end within {limit_s:g} s")
        return InputError(f"cannot be read: nothing was written to this pipe within {limit_s:g} s")

    def _limit_s(self) -> float:
        if self._patient:
            return self._whole_s
        return min(WRITER_S if self._opened else OPENED_S, self._whole_s)

    def _left_s(self) -> float:
        return self._began_s + self._limit_s() - time.monotonic()
