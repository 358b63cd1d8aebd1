"""The values that a parameter may have, as a grammar can say them, and how they are written.

A grammar cannot compare numbers, but it can compare digits: 12 to 345 is ``1[2-9]``, ``[2-9]`` and
a digit, ``[12]`` and two digits, and so on. Every number that these expressions allow lies within
the bounds, and every number of up to ``WHOLE`` digits before and ``FRACTION`` digits behind the
point does that is written without exponent, plus sign and needless zeros in front.

A harmless text says what it says: it holds no control character, and nothing that reads as a
placeholder (GP207) beyond doubt. So ``$`` stands before a digit only, and ``{`` only where JSON has
it; it begins with neither blank, ``&`` nor ``<``. The empty text is left out: it says nothing.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal, localcontext
from enum import StrEnum
from typing import TYPE_CHECKING

from gpsfsm.grammars.expressions import (
    Chars,
    Choice,
    Expression,
    Literal,
    Repeat,
    Sequence,
    choice,
    opt,
)
from gpsfsm.model.capability import ValueType
from gpsfsm.syntax.text import ILLEGAL
from gpsfsm.syntax.values import typed

if TYPE_CHECKING:
    from gpsfsm.model.capability import Input, Parameter, Provider
    from gpsfsm.model.plan import Value

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
    spans: list[tuple[Expression, str, str]] = []
    if low[1:] != zeros:
        spans.append((Literal(low[0]), low[1:], nines))
        start += 1
    last = []
    if high[1:] != nines:
        last = [(_digits(end, end), zeros, high[1:])]
        end -= 1
    if start <= end:
        spans.append((_digits(start, end), zeros, nines))
    return spans + last


def _digits(start: int, end: int) -> Expression:
    if start == end:
        return Literal(str(start))
    return Chars(f"{start}-{end}")


_LISTS = {
    ValueType.STRINGS: ValueType.STRING,
    ValueType.BOOLS: ValueType.BOOL,
    ValueType.INTS: ValueType.INT,
    ValueType.DOUBLES: ValueType.DOUBLE,
}
_MAX_ITEMS = 64
_ESCAPES = {
    "&": "&amp;",
    "<": "&lt;",
    ">": "&gt;",
    '"': "&quot;",
    "\t": "&#9;",
    "\n": "&#10;",
    "\r": "&#13;",
}
_BREAKS = str.maketrans("\t\n\r", "   ")
_SPECIAL = re.compile('[&<>"\t\n\r]')
_CONTROLS = r"\x00-\x1f\x7f-\x9f\ufffe\uffff"
# What str.strip removes, which is done before a placeholder is looked for.
_BLANKS = r"\x20\xa0\u1680\u2000-\u200a\u2028\u2029\u202f\u205f\u3000"
PLAIN: Expression = Chars(rf'^{_CONTROLS}${{&<"\\')
"""A character that stands for itself everywhere: in JSON inside of an attribute, too."""


class FormKind(StrEnum):
    """The kind of a value; CHOICE: one of some texts."""

    TEXT = "text"
    INTEGER = "integer"
    DECIMAL = "decimal"
    CHOICE = "choice"
    LIST = "list"


@dataclass(frozen=True, slots=True)
class Form:
    """The allowed values: ``low`` and ``high`` bound numbers, ``choices`` are all there are.

    ``item`` is the form of the members of a list.
    """

    kind: FormKind
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    item: Form | None = None

    @property
    def bounded(self) -> bool:
        """True if there are bounds."""
        return self.low is not None or self.high is not None

    @property
    def is_boolean(self) -> bool:
        """True if the values are true and false."""
        return self.choices == _BOOLEAN.choices


_TEXT = Form(FormKind.TEXT)
_BOOLEAN = Form(FormKind.CHOICE, choices=("true", "false"))


def form_of(parameter: Parameter | Input, provider: Provider) -> Form | None:
    """The form of what a plan writes for a parameter; None if no value is allowed.

    Every value of that form is free of the findings GP205, GP206 and GP207 that are errors.
    """
    kind = parameter.type
    if kind is ValueType.ANY:  # as the check does: the input of this name may say more
        expected = provider.input(parameter.name)
        kind = ValueType.ANY if expected is None else expected.type
    low, high = _bounds(parameter)
    choices: tuple[str, ...] = getattr(parameter, "choices", ())
    if choices:
        allowed = tuple(text for text in choices if _is_allowed(text, kind, low, high))
        return Form(FormKind.CHOICE, choices=allowed) if allowed else None
    form = _plain(kind, low, high)
    return None if expression(form) is None else form


def _bounds(parameter: Parameter | Input) -> tuple[float | None, float | None]:
    low: float | None = getattr(parameter, "minimum", None)
    high: float | None = getattr(parameter, "maximum", None)
    return (
        None if low is None or math.isnan(low) or low == -math.inf else low,
        None if high is None or math.isnan(high) or high == math.inf else high,
    )


def _plain(kind: ValueType, low: float | None, high: float | None) -> Form:
    if kind is ValueType.BOOL:
        return _BOOLEAN
    if kind is ValueType.INT:
        return Form(FormKind.INTEGER, low, high)
    if kind is ValueType.DOUBLE:
        return Form(FormKind.DECIMAL, low, high)
    if kind in _LISTS:
        return Form(FormKind.LIST, item=_plain(_LISTS[kind], None, None))
    if low is not None or high is not None:
        return Form(FormKind.DECIMAL, low, high)  # other texts are allowed too, but hardly meant
    return _TEXT


def _is_allowed(text: str, kind: ValueType, low: float | None, high: float | None) -> bool:
    if not is_harmless_choice(text):
        return False
    value = typed(text)
    if kind is ValueType.BOOL:
        return isinstance(value, bool)
    if isinstance(value, bool | str):
        return kind not in (ValueType.INT, ValueType.DOUBLE)
    if kind is ValueType.INT and not isinstance(value, int):
        return False
    if kind is ValueType.DOUBLE and not math.isfinite(value):
        return False
    return _within(value, low, high)


def _within(value: Value, low: float | None, high: float | None) -> bool:
    assert not isinstance(value, str)
    return not (low is not None and value < low) and not (high is not None and value > high)


def expression(form: Form) -> Expression | None:
    """The spelling of values of this form in an attribute, up to and with the quotation mark.

    None if there is none. With the mark at its end no value is the beginning of another one.
    """
    if form.kind is FormKind.CHOICE:
        return choice([Literal(attribute_text(text) + '"') for text in form.choices])
    unquoted = _unquoted(form)
    return None if unquoted is None else Sequence((unquoted, Literal('"')))


def _unquoted(form: Form) -> Expression | None:
    if any(bound is not None and math.isinf(bound) for bound in (form.low, form.high)):
        return None
    if form.kind is FormKind.INTEGER:
        return integers(form.low, form.high)
    if form.kind is FormKind.DECIMAL:
        return decimals(form.low, form.high)
    if form.kind is FormKind.LIST:
        return _list(form.item or _TEXT)
    if form.kind is FormKind.CHOICE:
        return choice([Literal(attribute_text(text)) for text in form.choices])
    return WRITTEN


def _list(of: Form) -> Expression:
    """A JSON list, which is how attributes hold lists."""
    item = _unquoted(of)
    assert item is not None
    if of.kind is FormKind.TEXT:
        quote = Literal("&quot;")
        item = Sequence((quote, Repeat(PLAIN), quote))
    more = Repeat(Sequence((Literal(", "), item)), 0, _MAX_ITEMS - 1)
    return Sequence((Literal("["), opt(Sequence((item, more))), Literal("]")))


def is_plain(text: str) -> bool:
    """True if a text can stand in a grammar as it is: all of it is plain to see."""
    return text.translate(_BREAKS).isprintable()


def unwritable(text: str) -> str:
    """The first character that no XML can hold, "" if all is well."""
    illegal = ILLEGAL.search(text)
    return illegal[0] if illegal else ""


def attribute_text(text: str) -> str:
    """A text as it stands between the quotation marks of an attribute; it must be writable.

    >>> attribute_text('say "a < b"')
    'say &quot;a &lt; b&quot;'
    """
    return _SPECIAL.sub(lambda match: _ESCAPES[match[0]], text)


def is_harmless_choice(text: str) -> bool:
    """True if a text can be written and is no placeholder, whatever else it is."""
    return is_plain(text) and "${" not in text and text.strip()[:1] not in {*"$&{<"}


def _expression(quote: Expression, first: list[Expression], more: list[Expression]) -> Expression:
    """``first`` and ``more`` are references, at the beginning and later; none in plain texts.

    ``quote`` is how a quotation mark is written, which may follow a brace.
    """
    braced = Choice((Chars("0-9}"), Literal("["), Literal("-"), quote))
    held = [Sequence((Literal("$"), Chars("0-9"))), Sequence((Literal("{"), braced))]
    lead = Chars(f"^{_CONTROLS}{_BLANKS}${{&<" + ('"' if first else ""))
    rest = Chars(f"^{_CONTROLS}${{" + ('&<"' if more else ""))
    return Sequence(
        (Choice((lead, *first, *held)), Repeat(Choice((rest, *more, *held)))),
    )


def _references(*names: str) -> Expression:
    return Sequence((Literal("&"), Choice(tuple(map(Literal, names))), Literal(";")))


WRITTEN: Expression = _expression(
    Literal("&quot;"),
    [_references("quot", "apos", "gt")],
    [_references("quot", "apos", "gt", "lt", "amp")],
)
"""Harmless texts as attributes hold them, without the quotation marks."""

HARMLESS: Expression = _expression(Literal('"'), [], [])
"""Harmless texts themselves."""
