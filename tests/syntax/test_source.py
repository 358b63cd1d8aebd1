"""Decoding: which encodings are read, and what is said of the others."""

from __future__ import annotations

import codecs

import pytest

from gpsfsm.syntax import Limits, parse
from tests.syntax.support import GO

TEXT = f'<Plan name="caf\u00e9">{GO}</Plan>'


def declared(name: str) -> str:
    return f'<?xml version="1.0" encoding="{name}"?>\n{TEXT}'


@pytest.mark.parametrize(
    "data",
    [
        TEXT.encode(),
        codecs.BOM_UTF8 + TEXT.encode(),
        codecs.BOM_UTF16_LE + TEXT.encode("utf-16-le"),
        codecs.BOM_UTF16_BE + TEXT.encode("utf-16-be"),
        TEXT.encode("utf-16-le"),
        TEXT.encode("utf-16-be"),
        codecs.BOM_UTF16_LE + declared("UTF-16").encode("utf-16-le"),
        declared("utf-8").encode(),
        declared("ISO-8859-1").encode("latin-1"),
        declared("iso-8859-15").encode("iso-8859-15"),
        declared("Windows-1252").encode("cp1252"),
    ],
)
def test_encodings_that_are_read(data):
    parsed = parse(data)
    assert not parsed.problems
    assert parsed.text.endswith(TEXT)
    assert parsed.plan is not None
    assert parsed.plan.elements[0].text("name") == "caf\u00e9"


def test_a_text_is_decoded_already_whatever_it_declares():
    assert not parse(declared("UTF-16")).problems
    assert not parse(declared("klingon")).problems
    assert parse("\ufeff" + TEXT).text == TEXT


@pytest.mark.parametrize(
    ("data", "message", "place"),
    [
        (
            b'<Plan>\n<Runner interface="caf\xe9"/></Plan>',
            "the byte 0xE9 (byte 30 of the text) is not valid UTF-8",
            (2, 23),
        ),
        (
            b'<?xml version="1.0" encoding="us-ascii"?><Plan name="\xc3"/>',
            "the byte 0xC3 (byte 54 of the text) is not valid ASCII",
            (1, 54),
        ),
        (b"<Plan/>\xff\xfe", "the byte 0xFF (byte 8 of the text) is not valid UTF-8", (1, 8)),
        (codecs.BOM_UTF16_LE + b"<", "the byte 0x3C (byte 3 of the text)", (1, 1)),
        (
            b'<?xml version="1.0" encoding="utf-7"?><Plan/>',
            "the text declares the encoding 'utf-7', which gpsfsm cannot read",
            (1, 31),
        ),
        ("<Plan/>".encode("utf-32"), "the text is UTF-32, which gpsfsm cannot read", (1, 1)),
        (b"\x89PNG\r\n\x1a\n\0\0", "the byte 0x89 (byte 1 of the text) is not valid UTF-8", (1, 1)),
    ],
)
def test_what_is_not_read(data, message, place):
    parsed = parse(data)
    (problem,) = parsed.problems
    assert problem.rule == "GP116"
    assert problem.message.startswith(message)
    assert (problem.location.line, problem.location.column) == place
    assert problem.hint.startswith("save the file as UTF-8")
    assert parsed.plan is None
    assert not parsed.text
    assert not parsed.over_limit


def test_a_wrong_declaration_of_utf_16_has_one_repair():
    parsed = parse(declared("UTF-16").encode())
    (problem,) = parsed.problems
    assert problem.rule == "GP116"
    assert "'UTF-16', but is not encoded in it" in problem.message
    assert (problem.location.line, problem.location.column, problem.length) == (1, 31, 6)
    assert parsed.plan is not None


@pytest.mark.parametrize("text", ["x" * 101, "é" * 51, b"x" * 101, b"\xff" * 101])
def test_bytes_are_limited_before_they_are_decoded(text):
    parsed = parse(text, limits=Limits(max_bytes=100))
    (problem,) = parsed.problems
    assert problem.rule == "GP103"
    assert problem.message == "the text is longer than 100 bytes"
    assert parsed.over_limit
    assert parsed.plan is None
