"""Where messages of an editor begin and end, whatever it says of their length.

pygls believes a length that it is told: it would claim the memory of a terabyte at once, and wait
for all of it. Here a message that is too long is passed over piece by piece, and the next one that
begins is read, also where it begins too early.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable
    from io import BufferedReader

__all__ = ["MOST_BYTES", "Framed"]

MOST_BYTES = 64 << 20
"""Of a message; a plan is far smaller, and more than memory allows is worth nothing."""

_HEADER = re.compile(
    rb"Content-Length[ \t]*:[ \t]*(\d{1,18})[ \t]*\r?\n"
    rb"(?:[A-Za-z-]{1,64}[ \t]*:[^\r\n]{0,1000}\r?\n){0,16}\r?\n",
    re.IGNORECASE,
)
_LONGEST_HEADER = 20_000
_CHUNK = 1 << 16


class Framed:
    """A stream of messages as pygls reads it: a line, an empty line and so many bytes.

    ``note`` is told what was passed over.
    """

    def __init__(self, source: BufferedReader, note: Callable[[str], object]) -> None:
        self._source = source
        self._note = note
        self._buffer = bytearray()
        self._lines: list[bytes] = []
        self._body = b""

    def readline(self) -> bytes:
        """The next line of a header; nothing at the end."""
        if not self._lines:
            body = self._next()
            if body is None:
                return b""
            self._body = body
            self._lines = [b"\r\n", b"Content-Length: %d\r\n" % len(body)]
        return self._lines.pop()

    def read(self, _: int) -> bytes:
        """The message to which the header belongs."""
        body, self._body = self._body, b""
        return body

    def _next(self) -> bytes | None:
        """The next message; None at the end."""
        while True:
            header = _HEADER.search(self._buffer)
            if header is None:
                del self._buffer[:-_LONGEST_HEADER]  # what is no header is no message
                if not self._fill():
                    return None
                continue
            length = int(header[1])
            del self._buffer[: header.end()]
            if length > MOST_BYTES:
                self._note(f"a message of {length:,} bytes is passed over: it is too long")
                self._pass_over(length)
            elif length:
                while len(self._buffer) < length:
                    if not self._fill():
                        return None
                body = bytes(self._buffer[:length])
                del self._buffer[:length]
                return body

    def _pass_over(self, length: int) -> None:
        """Read ``length`` bytes, or up to a header: in the text of a message there is none."""
        while length > 0:
            header = _HEADER.search(self._buffer)
            if header is not None and header.start() < length:
                del self._buffer[: header.start()]
                return
            kept = 0 if len(self._buffer) >= length else _LONGEST_HEADER  # one may have begun
            passed = min(length, max(0, len(self._buffer) - kept))
            del self._buffer[:passed]
            length -= passed
            if length > 0 and not self._fill():
                return

    def _fill(self) -> bool:
        """Read what has come; False at the end."""
        piece = self._source.read1(_CHUNK)
        self._buffer += piece
        return bool(piece)
