"""Messages whose length is a lie, and what comes after them."""

from __future__ import annotations

import io
import random
from pathlib import Path

import pytest

from gpsfsm.lsp.server import MOST_BYTES, Framed
from tests.lsp.client import Editor

pytest.importorskip("pygls", reason="gpsfsm lsp needs the extra lsp")


def framed(body: bytes) -> bytes:
    return b"Content-Length: %d\r\n\r\n" % len(body) + body


def read_all(content: bytes, piece: int = 1 << 16) -> tuple[list[bytes], list[str]]:
    """The messages, as pygls takes them, and what was noted."""

    class Pieces(io.BytesIO):
        def read1(self, size: int | None = -1, /) -> bytes:
            return super().read1(min(size or 0, piece))

    notes: list[str] = []
    reader = Framed(Pieces(content), notes.append)  # type: ignore[arg-type]
    results = []
    while line := reader.readline():
        length = int(line.removeprefix(b"Content-Length: "))
        assert reader.readline() == b"\r\n"
        results.append(reader.read(length))
        assert len(results[-1]) == length
    return results, notes


@pytest.mark.parametrize("piece", [1, 7, 1 << 16])
@pytest.mark.parametrize(
    "bad",
    [
        b"",
        b"Content-Length: 0\r\n\r\n",
        b"Content-Length: -5\r\n\r\n",
        b"Content-Length: abc\r\n\r\n",
        b"Content-Length: " + b"9" * 5000 + b"\r\n\r\n",
        b"Content-Type: x\r\n\r\n{}",
        b"\r\n\r\n\x00\xff",
        b"Content-Length: 999999999999\r\n\r\n",
        b"Content-Length: 999999999999\r\n\r\n{" + b" " * 5_000,
    ],
)
def test_the_next_message_is_read(bad: bytes, piece: int) -> None:
    assert read_all(framed(b"{1}") + bad + framed(b"{2}"), piece)[0] == [b"{1}", b"{2}"]


def test_a_message_that_is_too_long_is_passed_over_whole() -> None:
    long = MOST_BYTES + 1
    content = b"Content-Length: %d\r\n\r\n" % long + b"x" * long + framed(b"{2}")
    documents, notes = read_all(content, 1 << 20)
    assert documents == [b"{2}"]
    assert notes == ["a message of 67,108,865 bytes is passed over: it is too long"]


def test_other_headers_and_spellings() -> None:
    type_ = b"Content-Type: application/vscode-jsonrpc; charset=utf-8\r\n"
    for header in (b"content-length: 2\r\n" + type_, type_ + b"Content-Length:2\r\n"):
        assert read_all(header + b"\r\n{}" + framed(b"{2}"))[0] == [b"{}", b"{2}"]


def test_a_message_that_breaks_off() -> None:
    assert read_all(b"Content-Length: 10\r\n\r\n{}")[0] == []


def test_a_message_may_hold_what_looks_like_a_header() -> None:
    body = b'{"a": "Content-Length: 3\r\n\r\n"}'
    assert read_all(framed(body) + framed(b"{2}"), 3)[0] == [body, b"{2}"]


def test_anything_ends_in_time() -> None:
    draw = random.Random(1)  # noqa: S311
    parts = [framed(b"{}"), b"Content-Length: ", b"\r\n", b"9" * 30, b":", b"Content-Type: a\r\n"]
    for _ in range(200):
        read_all(b"".join(draw.choices(parts, k=40)), draw.choice((1, 5, 1000)))


def test_a_server_goes_on(tmp_path: Path) -> None:
    with Editor(tmp_path) as editor:
        assert editor.process.stdin is not None
        for bad in (b"999999999999", b"-1", b"1e9", b"9" * 5000):
            editor.process.stdin.write(b"Content-Length: " + bad + b"\r\n\r\n")
            editor.process.stdin.flush()
        uri = editor.open("plan.xml", "<Plan/>")
        assert [each["code"] for each in editor.diagnostics(uri)] == ["GP109"]
        assert editor.end() == 0


def test_a_length_alone_costs_no_memory_and_no_server(tmp_path: Path) -> None:
    with Editor(tmp_path) as editor:
        assert editor.process.stdin is not None
        editor.process.stdin.write(b"Content-Length: 999999999999\r\n\r\n{")
        editor.process.stdin.close()
        assert editor.process.wait(60) == 0
        assert editor.process.stderr is not None
        assert b"999,999,999,999 bytes is passed over" in editor.process.stderr.read()
