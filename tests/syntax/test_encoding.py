"""A fixed text is written as its file was."""

from __future__ import annotations

import codecs

import pytest

from gpsfsm.errors import InputError
from gpsfsm.syntax.source import encoded
from tests.fixing.support import fixed, go, say

_PLAN = f"<Plan>\r\n  {say('Grüße, Café')}\r\n  {go(1, 2)}\r\n</Plan>"
_DAMAGED = _PLAN.replace('"2"', "2")


@pytest.mark.parametrize(
    ("mark", "codec", "declared"),
    [
        (b"", "utf-8", ""),
        (codecs.BOM_UTF8, "utf-8", ""),
        (codecs.BOM_UTF16_LE, "utf-16-le", ""),
        (codecs.BOM_UTF16_BE, "utf-16-be", "UTF-16"),
        (b"", "utf-16-le", ""),
        (b"", "latin-1", "ISO-8859-1"),
        (b"", "cp1252", "windows-1252"),
    ],
)
def test_encoding_mark_and_line_ends_stay(mark: bytes, codec: str, declared: str) -> None:
    head = f'<?xml version="1.0" encoding="{declared}"?>' if declared else ""
    original = mark + (head + _DAMAGED).encode(codec)
    result = fixed(original)
    assert result.text == head + _PLAN
    assert encoded(result.text, original, result.original) == mark + (head + _PLAN).encode(codec)


def test_what_the_encoding_cannot_say_is_not_written() -> None:
    original = b'<?xml version="1.0" encoding="us-ascii"?><Plan/>'
    text = original.decode()
    assert encoded(text.replace("<Plan/>", "<Plan></Plan>"), original, text).endswith(b"</Plan>")
    with pytest.raises(InputError):
        encoded(text.replace("<Plan/>", "<Plan name='\u20ac'/>"), original, text)


def test_a_false_declaration_is_corrected() -> None:
    original = b'<?xml version="1.0" encoding="UTF-16"?>\n' + _PLAN.encode()
    result = fixed(original)
    assert result.text == '<?xml version="1.0" encoding="UTF-8"?>\n' + _PLAN
    assert encoded(result.text, original, result.original) == result.text.encode()


def test_bytes_that_are_no_text_are_left_alone() -> None:
    result = fixed(b"<Plan>\xff\xfe\xfa</Plan>")
    assert (result.text, result.applied) == ("", ())
    assert [finding.rule for finding in result.report.findings] == ["GP116"]
