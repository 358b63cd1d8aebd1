"""Messages between processes arrive as they were sent, and nothing else passes for one."""

from __future__ import annotations

import asyncio
import io
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gpsfsm.workers import frames
from tests.cases import many

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=6,
)
MESSAGES = st.lists(
    st.tuples(st.dictionaries(st.text(max_size=5), JSON, max_size=3), st.binary()), max_size=4
)


@settings(max_examples=many(50))
@given(MESSAGES)
def test_messages_arrive_as_they_were_sent(sent: list[tuple[dict[str, Any], bytes]]) -> None:
    whole = b"".join(frames.pack(head, body) for head, body in sent)
    stream = io.BytesIO(whole)
    assert [frames.read(stream) for _ in sent] == sent
    with pytest.raises(EOFError):
        frames.read(stream)

    async def hear() -> list[tuple[dict[str, Any], bytes]]:
        reader = asyncio.StreamReader()
        reader.feed_data(whole)
        reader.feed_eof()
        actual = [await frames.receive(reader) for _ in sent]
        with pytest.raises(EOFError):
            await frames.receive(reader)
        return actual

    assert asyncio.run(hear()) == sent


@given(st.binary(max_size=40))
def test_what_is_no_message_is_told_at_once(content: bytes) -> None:
    stream = io.BytesIO(content)
    for _ in content:
        try:
            frames.read(stream)
        except (EOFError, ValueError):
            return
    assert not content  # there is always an end


def test_nobody_waits_for_a_message_that_is_said_to_be_huge() -> None:
    huge = io.BytesIO(b"\xff" * 100)
    with pytest.raises(ValueError, match="too long"):
        frames.read(huge)


def test_a_message_that_is_nested_too_deeply_is_none() -> None:
    with pytest.raises(ValueError, match="nested too deeply"):
        frames.unpack(b"[" * 100_000)
