"""A repaired text in the bytes of its file: same encoding, same byte order mark."""

from __future__ import annotations

import codecs

from gpsfsm.errors import InputError
from gpsfsm.syntax.limits import Limits
from gpsfsm.syntax.source import read_source

__all__ = ["encoded"]

_UTF8 = ("utf-8", codecs.BOM_UTF8)
_CANDIDATES = (
    ("utf-8", b""),
    _UTF8,
    ("utf-16-le", codecs.BOM_UTF16_LE),
    ("utf-16-be", codecs.BOM_UTF16_BE),
    ("utf-16-le", b""),
    ("utf-16-be", b""),
    ("latin-1", b""),
    ("iso-8859-15", b""),
    ("cp1252", b""),
)


def encoded(text: str, original: bytes, was: str) -> bytes:
    """``text`` as bytes, in the encoding in which ``was`` is the text of ``original``.

    Raises InputError where the bytes would not be read as ``text`` again.
    """
    limits = Limits(max_bytes=max(4 * len(text) + 4, 1))
    for codec, mark in _CANDIDATES:
        if not original.startswith(mark) or not _same(was, original[len(mark) :], codec):
            continue
        try:
            data = mark + text.encode(codec)
        except UnicodeEncodeError:
            continue
        if read_source(data, limits).text == text:
            return data
    raise InputError("the fixed text cannot be written in the encoding of the file")


def _same(text: str, data: bytes, codec: str) -> bool:
    try:
        return text.encode(codec) == data
    except UnicodeEncodeError:
        return False
