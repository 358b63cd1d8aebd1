"""Messages between the service and its processes: a length in four bytes, then so many bytes."""

from __future__ import annotations

import json
import struct
from typing import TYPE_CHECKING, Any, BinaryIO

from gpsfsm.gating.frames import exactly

if TYPE_CHECKING:
    import asyncio

__all__ = ["MOST", "pack", "read", "receive", "unpack"]

MOST = 256 << 20
"""Bytes of a message; more is a mistake."""

_LENGTH = struct.Struct(">I")


def pack(head: dict[str, Any], body: bytes = b"") -> bytes:
    """A message: an object, and bytes that belong to it."""
    text = json.dumps(head, separators=(",", ":")).encode()
    return b"".join((_LENGTH.pack(len(text)), text, _LENGTH.pack(len(body)), body))


def unpack(text: bytes) -> dict[str, Any]:
    """The object of a message. Raises ValueError if it is none."""
    found = json.loads(text)
    if not isinstance(found, dict):
        raise ValueError("a message is an object")
    return found


def read(stream: BinaryIO) -> tuple[dict[str, Any], bytes]:
    """The next message of a file. Raises EOFError where it ends."""
    head = exactly(stream, _length(exactly(stream, _LENGTH.size)))
    return unpack(head), exactly(stream, _length(exactly(stream, _LENGTH.size)))


async def receive(reader: asyncio.StreamReader) -> tuple[dict[str, Any], bytes]:
    """The next message of a stream. Raises EOFError (IncompleteReadError is one) at its end."""
    head = await reader.readexactly(_length(await reader.readexactly(_LENGTH.size)))
    body = await reader.readexactly(_length(await reader.readexactly(_LENGTH.size)))
    return unpack(head), body


def _length(found: bytes) -> int:
    length: int = _LENGTH.unpack(found)[0]
    if length > MOST:
        raise EOFError("a message is too long")
    return length
