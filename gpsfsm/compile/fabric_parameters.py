"""The parameters of a runner, as the engines type them, and numbers as C reads them.

Numbers are those of ``strtol`` and ``strtod`` of glibc, with their errors of range.
"""

from __future__ import annotations

import math
import re
from decimal import Decimal, localcontext
from typing import TYPE_CHECKING

from gpsfsm.model.engine import OptionType, Parameter

if TYPE_CHECKING:
    from gpsfsm.model.engine import EngineElement

# ---- The parameters of a runner, as the engines type them, and numbers as C reads them -----------
# Numbers are those of ``strtol`` and ``strtod`` of glibc, with their errors of range.


NOT_TYPED = ("interface", "provider")
"""The attributes of a runner that are no parameters to any engine."""

_BLANKS = " \\t\\n\\v\\f\\r"
_INTEGER = re.compile(rf"[{_BLANKS}]*+([+-]?+)0*+([0-9]*+)", re.ASCII)
_DOUBLE = re.compile(
    rf"[{_BLANKS}]*+(?P<sign>[+-]?+)(?:"
    r"0[xX](?=\.?[0-9a-fA-F])(?P<hex>[0-9a-fA-F]*+)(?:\.(?P<part>[0-9a-fA-F]*+))?+"
    r"(?:[pP](?P<power>[+-]?+[0-9]++))?+"
    r"|(?P<decimal>(?:[0-9]++(?:\.[0-9]*+)?+|\.[0-9]++)(?:[eE][+-]?+[0-9]++)?+)"
    r"|(?P<infinite>(?i:inf(?:inity)?+))|(?P<nan>(?i:nan)(?:\([0-9A-Za-z_]*+\))?+))",
    re.ASCII,
)
_LONG = 2**63
_LONG_DIGITS = 19
_INT = 2**32
_SMALLEST_NORMAL = 2.0**-1022
_SMALLEST_EXPONENT = -1074  # of the last bit of the smallest subnormal number
_LARGEST_EXPONENT = 1024
_EXPONENT_DIGITS = 18  # no text is long enough to make up for a larger exponent


def typed(name: str, text: str) -> Parameter:
    """A parameter as the second version types it: exactly true or false, integer, number, text.

    >>> typed("x", "1e3").text, typed("x", "2147483648").text, typed("x", "True").type.name
    ('1000.000000', '-2147483648', 'STRING')
    """
    if text in ("true", "false"):
        return Parameter(name, OptionType.BOOL, text == "true", text)
    number = read_int(text)
    if number is not None:
        return integer(name, number)
    real = read_double(text)
    if real is not None:
        return Parameter(name, OptionType.DOUBLE, real, _six_decimals(real))
    return string(name, text)


def integer(name: str, value: int) -> Parameter:
    """A parameter that the engine itself sets to a number."""
    return Parameter(name, OptionType.INT, value, str(value))


def string(name: str, text: str) -> Parameter:
    """A parameter that is text."""
    return Parameter(name, OptionType.STRING, text, text)


def typed_parameters(element: EngineElement) -> tuple[Parameter, ...]:
    """All parameters of a runner, typed, in the order of its attributes."""
    return tuple(
        typed(attribute.name, attribute.value)
        for attribute in element.attributes
        if attribute.name not in NOT_TYPED
    )


def raw_parameters(element: EngineElement, instance: int) -> tuple[Parameter, ...]:
    """All parameters of a runner as the first version keeps them: as they are written.

    It writes the instance into the attribute ``id``, over what the plan says there.
    """
    texts = {
        attribute.name: attribute.value
        for attribute in element.attributes
        if attribute.name not in NOT_TYPED
    }
    texts["id"] = str(instance)
    return tuple(
        Parameter(name, OptionType.UNCONVERTED, text, text) for name, text in texts.items()
    )


def _six_decimals(value: float) -> str:
    """A number as C++'s ``std::to_string`` writes it; C, unlike Python, writes the sign of nan."""
    if math.isnan(value):
        return "-nan" if math.copysign(1.0, value) < 0 else "nan"
    return f"{value:f}"


with localcontext(prec=1100):
    # 2**-1022 - 2**-1076, exactly. What is smaller is subnormal even after rounding to 53 bits.
    _TINY = Decimal((1 << 54) - 1) / (1 << 1076)


def read_int(text: str) -> int | None:
    """The integer that ``strtol`` reads to the end of ``text``, cut to 32 bits; None for none.

    An empty text is 0: nothing was read, and nothing is left. An integer of more than 64 bits is
    out of range, and none.

    >>> read_int(" 007"), read_int("2147483648"), read_int("1 "), read_int("")
    (7, -2147483648, None, 0)
    """
    if not text:
        return 0
    match = _INTEGER.fullmatch(text)
    if match is None or text[-1] not in "0123456789" or len(match[2]) > _LONG_DIGITS:
        return None
    value = int(match[1] + (match[2] or "0"))
    if not -_LONG <= value < _LONG:
        return None
    return (value + _INT // 2) % _INT - _INT // 2


def read_double(text: str) -> float | None:
    """The number that ``strtod`` reads to the end of ``text`` without an error of range.

    Out of range is what is too large, and what is so small that digits are lost. The sign of a nan
    is kept.

    >>> read_double("0x1p3"), read_double("1e400"), read_double("1."), read_double("1e-310")
    (8.0, None, 1.0, None)
    """
    match = _DOUBLE.fullmatch(text)
    if match is None:
        return None
    if match["infinite"]:
        value: float | None = math.inf
    elif match["nan"]:
        value = math.nan
    elif match["decimal"]:
        value = _decimal(match["decimal"])
    else:
        value = _hexadecimal(match["hex"], match["part"] or "", match["power"] or "0")
    if value is None:
        return None
    return math.copysign(value, -1.0 if match["sign"] == "-" else 1.0)


def _decimal(text: str) -> float | None:
    value = float(text)
    if math.isinf(value):
        return None
    if value > _SMALLEST_NORMAL:
        return value
    if not value:
        mantissa = text.lower().partition("e")[0]
        return None if mantissa.strip("0.") else value
    exact = Decimal(text)
    # Tininess is judged after rounding to 53 bits: what rounds up to the smallest normal number
    # there is not tiny, although it is smaller.
    lost = exact < _TINY if value == _SMALLEST_NORMAL else exact != Decimal(value)
    return None if lost else value


def _hexadecimal(whole: str, part: str, power: str) -> float | None:
    number = int(whole + part, 16)
    if not number:
        return 0.0
    if len(power.lstrip("+-0")) > _EXPONENT_DIGITS:
        return None
    zeros = (number & -number).bit_length() - 1
    number >>= zeros
    lowest = int(power) - 4 * len(part) + zeros
    highest = number.bit_length() + lowest  # the number is less than 2**highest
    if highest > _LARGEST_EXPONENT or highest < _SMALLEST_EXPONENT:
        return None
    try:
        value = float.fromhex(f"0x{number:x}p{lowest}")
    except OverflowError:
        return None
    if value > _SMALLEST_NORMAL:
        return value
    if value == _SMALLEST_NORMAL:
        bits = max(1076, -lowest)
        tiny = number << (lowest + bits) < ((1 << 54) - 1) << (bits - 1076)
        return None if tiny else value
    return value if lowest >= _SMALLEST_EXPONENT else None
