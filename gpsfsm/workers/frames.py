"""Messages between a process and the one that it works for: an object, and bytes that belong to it.

Each part is preceded by its length in four bytes. The object is JSON: who has read a hostile text
can send nothing but data.
"""

from __future__ import annotations

import json
import struct
from typing import TYPE_CHECKING, Any, BinaryIO

from gpsfsm.strict_json import strict_loads

if TYPE_CHECKING:
    import asyncio

__all__ = ["MOST", "Gone", "pack", "read", "receive", "unpack"]

MOST = 1 << 30
"""Bytes of a part; more is a mistake."""

_LENGTH = struct.Struct(">I")


class Gone(Exception):  # noqa: N818  (no error: processes end)
    """The process at the other end has ended; the text says how."""


def pack(head: dict[str, Any], body: bytes = b"") -> bytes:
    """A message. Raises ValueError if it is too long."""
    text = json.dumps(head, separators=(",", ":")).encode()
    if max(len(text), len(body)) > MOST:
        raise ValueError("a message is too long")
    return b"".join((_LENGTH.pack(len(text)), text, _LENGTH.pack(len(body)), body))


def unpack(text: bytes) -> dict[str, Any]:
    """The object of a message. Raises ValueError if it is none."""
    try:
        found = strict_loads(text)
    except RecursionError as error:
        raise ValueError("nested too deeply") from error
    if not isinstance(found, dict):
        raise ValueError("a message is an object")
    return found


def read(stream: BinaryIO) -> tuple[dict[str, Any], bytes]:
    """The next message of a file. Raises EOFError where it ends, ValueError for what is none."""
    head = _exactly(stream, _length(_exactly(stream, _LENGTH.size)))
    return unpack(head), _exactly(stream, _length(_exactly(stream, _LENGTH.size)))


async def receive(reader: asyncio.StreamReader) -> tuple[dict[str, Any], bytes]:
    """The next message of a stream.

    Raises EOFError (IncompleteReadError is one) at its end, ValueError for what is none.
    """
    head = await reader.readexactly(_length(await reader.readexactly(_LENGTH.size)))
    body = await reader.readexactly(_length(await reader.readexactly(_LENGTH.size)))
    return unpack(head), body


def _length(found: bytes) -> int:
    length: int = _LENGTH.unpack(found)[0]
    if length > MOST:
        raise ValueError("a message is too long")
    return length


def _exactly(stream: BinaryIO, length: int) -> bytes:
    """So many bytes of a stream. Raises EOFError where it ends before."""
    parts = []
    while length and (part := stream.read(length)):
        parts.append(part)
        length -= len(part)
    if length:
        raise EOFError("the stream has ended")
    return b"".join(parts)
