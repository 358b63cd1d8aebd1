"""Messages between the gate and its worker: a length in four bytes, then so many bytes."""

from __future__ import annotations

import struct
from typing import BinaryIO

__all__ = ["MOST", "exactly", "receive", "send"]

MOST = 1 << 30
"""Bytes of a message; more is a mistake."""

_LENGTH = struct.Struct(">I")


def send(stream: BinaryIO, message: bytes) -> None:
    """Write a message. Raises OSError if nobody reads it, ValueError if it is too long."""
    if len(message) > MOST:
        raise ValueError(f"a message of {len(message):,} bytes is too long")
    stream.write(_LENGTH.pack(len(message)))
    stream.write(message)
    stream.flush()


def receive(stream: BinaryIO) -> bytes:
    """The next message. Raises EOFError where the stream ends, ValueError for one too long."""
    length: int = _LENGTH.unpack(exactly(stream, _LENGTH.size))[0]
    if length > MOST:
        raise ValueError("a message is too long")
    return exactly(stream, length)


def exactly(stream: BinaryIO, length: int) -> bytes:
    """So many bytes of a stream. Raises EOFError where it ends before."""
    parts = []
    while length and (part := stream.read(length)):
        parts.append(part)
        length -= len(part)
    if length:
        raise EOFError("the stream has ended")
    return b"".join(parts)
