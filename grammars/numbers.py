"""Numbers between bounds as expressions, digit by digit.

A grammar cannot compare numbers, but it can compare digits: 12 to 345 is ``1[2-9]``, ``[2-9]`` and
a digit, ``[12]`` and two digits, and so on. Every number that these expressions allow lies within
the bounds, and every number of up to ``WHOLE`` digits before and ``FRACTION`` digits behind the
point does that is written without exponent, plus sign and needless zeros in front.
"""

from __future__ import annotations

from collections.abc import Callable
from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal, localcontext

from gpsfsm.grammars.expressions import Chars, Expression, Literal, Repeat, Sequence, choice, opt

__all__ = ["FRACTION", "GREATEST", "WHOLE", "decimals", "integers"]

WHOLE = 15
"""Digits before the point: such integers are exact as floats, and far within 64 bits."""
FRACTION = 17
"""Digits behind the point: enough for every float that a robot reports."""

GREATEST = 10**WHOLE - 1
"""The greatest number without a fraction."""

_SCALE = 10**FRACTION
_MINUS = Literal("-")
_DIGIT = Chars("0-9")
_Make = Callable[[int, int], Expression | None]


def integers(low: float | None, high: float | None) -> Expression | None:
    """The integers from ``low`` to ``high`` (None: unbounded); None if there is none."""
    if low is None and high is None:
        return Sequence((opt(_MINUS), _whole(0, GREATEST)))
    least = -GREATEST if low is None else _rounded(low, 1, ROUND_CEILING)
    most = GREATEST if high is None else _rounded(high, 1, ROUND_FLOOR)
    return _signed(least, most, _integer)


def decimals(low: float | None, high: float | None) -> Expression | None:
    """The decimal numbers from ``low`` to ``high`` (None: unbounded); None if there is none."""
    if low is None and high is None:
        return Sequence((opt(_MINUS), _decimal(0, GREATEST * _SCALE + _SCALE - 1)))
    top = GREATEST * _SCALE + _SCALE - 1
    least = -top if low is None else max(-top, _rounded(low, _SCALE, ROUND_CEILING))
    most = top if high is None else min(top, _rounded(high, _SCALE, ROUND_FLOOR))
    return _signed(least, most, _decimal)


def _rounded(bound: float, scale: int, rounding: str) -> int:
    """A bound in units of 1/scale, rounded into the range.

    The decimal form is what counts: reading decimals as floats keeps their order, so what is not
    less than the shortest form of a float is not less than the float.
    """
    with localcontext() as context:
        context.prec = 400  # the greatest float has 309 digits
        return int((Decimal(repr(bound)) * scale).to_integral_value(rounding=rounding))


def _signed(least: int, most: int, make: _Make) -> Expression | None:
    parts: list[Expression] = []
    if least > most:
        return None
    if least < 0:
        below = make(max(1, -most), -least)
        if below is not None:
            parts.append(Sequence((_MINUS, below)))
    if most >= 0:
        above = make(max(0, least), most)
        if above is not None:
            parts.append(above)
    return choice(parts) if parts else None


def _integer(least: int, most: int) -> Expression | None:
    most = min(most, GREATEST)
    return _whole(least, most) if least <= most else None


def _decimal(least: int, most: int) -> Expression:
    """Numbers in units of 1/_SCALE, both within reach and not negative."""
    first, low = divmod(least, _SCALE)
    last, high = divmod(most, _SCALE)
    if first == last:
        return Sequence((Literal(str(first)), *_behind(low, high)))
    parts: list[Expression] = []
    if low:
        parts.append(Sequence((Literal(str(first)), *_behind(low, _SCALE - 1))))
        first += 1
    end = None
    if high != _SCALE - 1:
        end = Sequence((Literal(str(last)), *_behind(0, high)))
        last -= 1
    if first <= last:
        parts.append(Sequence((_whole(first, last), *_behind(0, _SCALE - 1))))
    return choice([*parts, *([end] if end else [])])


def _behind(low: int, high: int) -> tuple[Expression, ...]:
    """The point and what follows it; optional where nothing need follow."""
    digits = _fraction(f"{low:0{FRACTION}}", f"{high:0{FRACTION}}", first=True)
    assert digits is not None
    part = Sequence((Literal("."), digits))
    return (part if low else opt(part),)


def _fraction(low: str, high: str, *, first: bool = False) -> Expression | None:
    """Digits that may end early, as if zeros followed; None for no digit at all.

    Ending early is allowed where ``low`` holds nothing but zeros, unless this is the ``first``
    digit, which a point demands.
    """
    room = len(low)
    if not room:
        return None
    ends = not low.strip("0") and not first
    if not low.strip("0") and not high.strip("9"):
        return Repeat(_DIGIT, 1 if first else 0, room)
    if not high.strip("0"):
        return Repeat(Literal("0"), 1 if first else 0, room)
    parts = []
    for digits, lower, upper in _spans(low, high):
        rest = _fraction(lower, upper)
        parts.append(Sequence((digits, rest)) if rest is not None else digits)
    body = choice(parts)
    return opt(body) if ends else body


def _whole(least: int, most: int) -> Expression:
    """The integers of a range that is not empty and has no negative number in it."""
    parts: list[Expression] = []
    size = len(str(least))
    while size <= len(str(most)):
        low, high = max(least, 10 ** (size - 1) if size > 1 else 0), min(most, 10**size - 1)
        if low == 10 ** (size - 1) and high == 10**size - 1:
            # as many lengths as are allowed as a whole
            end = size
            while most >= 10 ** (end + 1) - 1:
                end += 1
            some = Repeat(_DIGIT, size - 1, end - 1)
            parts.append(Sequence((Chars("1-9"), some)) if end > 1 else Chars("1-9"))
            size = end + 1
            continue
        if size == 1 and low == 0 and high == 9 and most > 9:
            parts.append(Literal("0"))
            least = 1
            continue
        parts.append(_same_length(str(low), str(high)))
        size += 1
    return choice(parts)


def _same_length(low: str, high: str) -> Expression:
    if low == high:
        return Literal(low)
    if not low.strip("0") and not high.strip("9"):
        return _DIGIT if len(low) == 1 else Repeat(_DIGIT, len(low), len(low))
    parts = []
    for digits, lower, upper in _spans(low, high):
        parts.append(Sequence((digits, _same_length(lower, upper))) if lower else digits)
    return choice(parts)


def _spans(low: str, high: str) -> list[tuple[Expression, str, str]]:
    """The first digit, and the bounds of the rest that go with it."""
    start, end = int(low[0]), int(high[0])
    zeros, nines = "0" * (len(low) - 1), "9" * (len(low) - 1)
    if start == end:
        return [(Literal(low[0]), low[1:], high[1:])]
    found: list[tuple[Expression, str, str]] = []
    if low[1:] != zeros:
        found.append((Literal(low[0]), low[1:], nines))
        start += 1
    last = []
    if high[1:] != nines:
        last = [(_digits(end, end), zeros, high[1:])]
        end -= 1
    if start <= end:
        found.append((_digits(start, end), zeros, nines))
    return found + last


def _digits(start: int, end: int) -> Expression:
    if start == end:
        return Literal(str(start))
    return Chars(f"{start}-{end}")
