"""The types of attribute values, as Fabric reads them."""

from __future__ import annotations

import re
from functools import lru_cache
from math import isinf
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gpsfsm.model.plan import Value

__all__ = ["typed"]

_BLANKS = " \\t\\n\\r\\v\\f"  # what C's isspace skips before a number
_INTEGER = re.compile(rf"[{_BLANKS}]*+([+-]?+)0*+([0-9]*+)")
_FLOAT = re.compile(
    rf"[{_BLANKS}]*+[+-]?+(?:"
    r"(?P<hex>0[xX](?:[0-9a-fA-F]++(?:\.[0-9a-fA-F]*+)?+|\.[0-9a-fA-F]++)(?:[pP][+-]?+[0-9]++)?+)"
    r"|(?:[0-9]++(?:\.[0-9]*+)?+|\.[0-9]++)(?:[eE][+-]?+[0-9]++)?+"
    r"|(?P<infinite>(?i:inf(?:inity)?+))|(?P<nan>(?i:nan)(?:\([0-9A-Za-z_]*+\))?+))"
)
_INT64 = 2**63
_CACHED_LENGTH = 80


def typed(text: str) -> Value:
    """The typed reading of an attribute value; never fails.

    Exactly ``true`` or ``false`` is a Boolean; what C's ``strtoll`` reads entirely and within 64
    bits is an integer; what ``strtod`` reads entirely and without overflow is a float; everything
    else is text.

    >>> typed("true"), typed("007"), typed("1e3"), typed("0x1F"), typed("1_000"), typed("")
    (True, 7, 1000.0, 31.0, '1_000', '')
    """
    return _cached(text) if len(text) <= _CACHED_LENGTH else _typed(text)


def _typed(text: str) -> Value:
    if text in ("true", "false"):
        return text == "true"
    if not text or text[-1] not in "0123456789abcdefABCDEF.nNyY)":
        return text  # most text values end here, cheaply
    number = _INTEGER.fullmatch(text)
    # Nineteen digits fit every 64-bit integer, and keep clear of Python's limit on int().
    if number and text[-1] in "0123456789" and len(number[2]) <= 19:
        value = int(number[1] + (number[2] or "0"))
        if -_INT64 <= value < _INT64:
            return value
    match = _FLOAT.fullmatch(text)
    if match is None:
        return text
    if match["nan"]:
        return float("nan")
    return _float(text, match)


def _float(text: str, match: re.Match[str]) -> Value:
    try:
        result = float.fromhex(text.strip()) if match["hex"] else float(text)
    except OverflowError:
        return text
    return text if isinf(result) and not match["infinite"] else result


_cached = lru_cache(maxsize=4096)(_typed)
