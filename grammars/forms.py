"""The values that a parameter may have, as a grammar can say them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

from gpsfsm.grammars.expressions import Expression, Literal, Repeat, Sequence, choice, opt
from gpsfsm.grammars.numbers import decimals, integers
from gpsfsm.grammars.texts import PLAIN, WRITTEN, attribute_text, is_harmless_choice
from gpsfsm.model.capability import ValueType
from gpsfsm.syntax.values import typed

if TYPE_CHECKING:
    from gpsfsm.model.capability import Input, Parameter, Provider
    from gpsfsm.model.plan import Value

__all__ = ["Form", "FormKind", "expression", "form_of"]

_LISTS = {
    ValueType.STRINGS: ValueType.STRING,
    ValueType.BOOLS: ValueType.BOOL,
    ValueType.INTS: ValueType.INT,
    ValueType.DOUBLES: ValueType.DOUBLE,
}
_MAX_ITEMS = 64


class FormKind(StrEnum):
    """What a value is; CHOICE: one of some texts."""

    TEXT = "text"
    INTEGER = "integer"
    DECIMAL = "decimal"
    CHOICE = "choice"
    LIST = "list"


@dataclass(frozen=True, slots=True)
class Form:
    """Which values are allowed: ``low`` and ``high`` bound numbers, ``choices`` are all there are.

    ``item`` is the form of the members of a list.
    """

    kind: FormKind
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    item: Form | None = None

    @property
    def bounded(self) -> bool:
        """Whether there are bounds."""
        return self.low is not None or self.high is not None

    @property
    def is_boolean(self) -> bool:
        """Whether the values are true and false."""
        return self.choices == _BOOLEAN.choices


_TEXT = Form(FormKind.TEXT)
_BOOLEAN = Form(FormKind.CHOICE, choices=("true", "false"))


def form_of(known: Parameter | Input, provider: Provider) -> Form | None:
    """The form of what a plan writes for a parameter; None if no value is allowed.

    Every value of that form is free of the findings GP205, GP206 and GP207 that are errors.
    """
    kind = known.type
    if kind is ValueType.ANY:  # as the check does: the input of this name may say more
        expected = provider.input(known.name)
        kind = ValueType.ANY if expected is None else expected.type
    low, high = _bounds(known)
    choices: tuple[str, ...] = getattr(known, "choices", ())
    if choices:
        allowed = tuple(text for text in choices if _is_allowed(text, kind, low, high))
        return Form(FormKind.CHOICE, choices=allowed) if allowed else None
    found = _plain(kind, low, high)
    return None if expression(found) is None else found


def _bounds(known: Parameter | Input) -> tuple[float | None, float | None]:
    low: float | None = getattr(known, "minimum", None)
    high: float | None = getattr(known, "maximum", None)
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
    """How values of this form are written in an attribute, up to and with the quotation mark.

    None if there is none. With the mark at its end no value is the beginning of another one.
    """
    if form.kind is FormKind.CHOICE:
        return choice([Literal(attribute_text(text) + '"') for text in form.choices])
    found = _unquoted(form)
    return None if found is None else Sequence((found, Literal('"')))


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
