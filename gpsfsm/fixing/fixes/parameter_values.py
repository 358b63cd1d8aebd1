"""GP205: values that are spelt otherwise than their type is."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.fixing.fixer import Fix, Fixer
from gpsfsm.fixing.layout import attribute_edit
from gpsfsm.model.capability import ValueType
from gpsfsm.syntax.text import strip
from gpsfsm.syntax.values import typed

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft

_MINUS = "\u2212\u2010\u2011\u2012\u2013\ufe63\uff0d"
_BOOLEANS = {"true": "true", "false": "false"}
_LONGEST = 60


def propose(draft: Draft) -> Iterator[Fix]:
    """One fix per value."""
    for at, raw, value, binding in draft.attributes("GP205"):
        declared = binding.provider.parameter(raw.name)
        if declared is None or len(value) > _LONGEST:
            continue
        wanted = _spelt(value, declared.type)
        if wanted and wanted != value:
            title = f"{raw.name[:40]} written '{wanted}'"
            edit = attribute_edit(draft, raw, raw.name, wanted)
            yield Fix("GP205", title, at, (edit,))


def _spelt(value: str, wanted: ValueType) -> str:
    """The value as its type is written; "" if nobody can tell."""
    word = strip(value).strip("\u00a0")
    if wanted is ValueType.BOOL:
        return _BOOLEANS.get(word.lower(), "")
    if wanted in (ValueType.INT, ValueType.DOUBLE):
        number = "".join("-" if character in _MINUS else character for character in word)
        read = typed(number)
        whole = isinstance(read, int) and not isinstance(read, bool)
        return number if whole or (isinstance(read, float) and wanted is ValueType.DOUBLE) else ""
    return ""


FIXER = Fixer(
    name="parameter-values",
    rules=("GP205",),
    propose=propose,
    safe=(
        "writes `True` as `true`, and a number with blanks around it or a typographic minus as a "
        "number: the value is the same"
    ),
)
