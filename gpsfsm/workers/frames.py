"""The protocol between a process and its children: messages, each an object and some bytes.

Both parts are preceded by their lengths in four bytes. The object is JSON: a process that has read
a hostile text can send nothing but data. ``message`` is the whole protocol, without any input or
output: it asks for so many bytes and gets them, from a file, a pipe or an event loop.
"""

from __future__ import annotations

import json
import struct
from typing import IO, TYPE_CHECKING, Any, TypeAlias

from gpsfsm.strict_json import strict_loads

if TYPE_CHECKING:
    import asyncio
    from collections.abc import Generator

MOST = 1 << 30
"""Bytes of a part; more is a mistake."""

Message: TypeAlias = tuple[dict[str, Any], bytes]

_LENGTH = struct.Struct(">I")


class GoneError(Exception):
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
        head = strict_loads(text)
    except RecursionError as error:
        raise ValueError("nested too deeply") from error
    if not isinstance(head, dict):
        raise ValueError("a message is an object")
    return head


def message() -> Generator[int, bytes, Message]:
    """A message: yields how many bytes it needs next, and wants to be sent exactly these.

    Raises ValueError for what is no message, before any of its bytes are asked for.
    """
    head = unpack((yield _length((yield _LENGTH.size))))
    return head, (yield _length((yield _LENGTH.size)))


def read(stream: IO[bytes]) -> Message:
    """The next message of a file. Raises EOFError where it ends, ValueError for what is none."""
    parts = message()
    needed = next(parts)
    while True:
        try:
            needed = parts.send(_exactly(stream, needed))
        except StopIteration as done:
            whole: Message = done.value
            return whole


async def receive(reader: asyncio.StreamReader) -> Message:
    """The next message of a stream.

    Raises EOFError (IncompleteReadError is one) at its end, ValueError for what is none.
    """
    parts = message()
    needed = next(parts)
    while True:
        content = await reader.readexactly(needed)
        try:
            needed = parts.send(content)
        except StopIteration as done:
            whole: Message = done.value
            return whole


def _length(content: bytes) -> int:
    length: int = _LENGTH.unpack(content)[0]
    if length > MOST:
        raise ValueError("a message is too long")
    return length


def _exactly(stream: IO[bytes], length: int) -> bytes:
    """So many bytes of a stream. Raises EOFError where it ends before."""
    parts = []
    while length and (part := stream.read(length)):
        parts.append(part)
        length -= len(part)
    if length:
        raise EOFError("the stream has ended")
    return b"".join(parts)
