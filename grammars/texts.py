"""Texts as attribute values: how they are written, and an expression for all that are harmless.

A harmless text says what it says: it holds no control character, and nothing that reads as a
placeholder (GP207) beyond doubt. So ``$`` stands before a digit only, and ``{`` only where JSON has
it; it begins with neither blank, ``&`` nor ``<``. The empty text is left out: it says nothing.
"""

from __future__ import annotations

import re

from gpsfsm.grammars.expressions import Chars, Choice, Expression, Literal, Repeat, Sequence
from gpsfsm.syntax.chars import ILLEGAL

__all__ = [
    "HARMLESS",
    "PLAIN",
    "WRITTEN",
    "attribute_text",
    "is_harmless_choice",
    "is_plain",
    "unwritable",
]

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


def is_plain(text: str) -> bool:
    """Whether a text can stand in a grammar as it is: all of it is plain to see."""
    return text.translate(_BREAKS).isprintable()


def unwritable(text: str) -> str:
    """The first character that no XML can hold, "" if all is well."""
    found = ILLEGAL.search(text)
    return found[0] if found else ""


def attribute_text(text: str) -> str:
    """A text as it stands between the quotation marks of an attribute; it must be writable.

    >>> attribute_text('say "a < b"')
    'say &quot;a &lt; b&quot;'
    """
    return _SPECIAL.sub(lambda match: _ESCAPES[match[0]], text)


def is_harmless_choice(text: str) -> bool:
    """Whether a text can be written and is no placeholder, whatever else it is."""
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

PLAIN: Expression = Chars(rf'^{_CONTROLS}${{&<"\\')
"""A character that stands for itself everywhere: in JSON inside of an attribute, too."""
