"""GP101, GP102: XML declarations, DOCTYPEs, comments."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from gpsfsm.fixing.fixer import Edit, Fix, Fixer
from gpsfsm.fixing.layout import whole_lines
from gpsfsm.syntax.text import WHITE
from gpsfsm.syntax.tokens import Comment, Markup

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft

_DECLARATION = re.compile(r"<[?!]xml\b", re.IGNORECASE)
_GOOD = re.compile(r"<\?xml\s+version\s*=\s*(?:\"1\.\d+\"|'1\.\d+')[^<>]*\?>")
_DASHES = re.compile(r"-(?=-)")


def propose(draft: Draft) -> Iterator[Fix]:
    """Fixes of what is neither tag nor text."""
    text = draft.text
    for token in draft.tokens:
        if isinstance(token, Markup) and token.faults and not token.swallowed:
            yield from _markup(draft, token)
        elif isinstance(token, Comment) and token.faults and token.end > token.body_end:
            body = text[token.start + 4 : token.body_end]
            words = _DASHES.sub("- ", body)
            words += " " if words.endswith("-") else ""
            words = " " + words if words.startswith("-") or words.startswith(">") else words
            edit = Edit(token.start + 4, token.body_end, words)
            yield Fix("GP101", "dashes in a comment parted", token.faults[0].start, (edit,))


def _markup(draft: Draft, token: Markup) -> Iterator[Fix]:
    text, fault = draft.text, token.faults[0]
    removed = Edit(*whole_lines(text, token.start, token.end))
    if fault.rule == "GP102":
        yield Fix("GP102", "DOCTYPE removed", fault.start, (removed,))
    elif _DECLARATION.match(text, token.start):
        blank_before = token.start > 0 and not text[: token.start].strip(WHITE)
        if blank_before and _GOOD.fullmatch(text, token.start, token.end):
            edit, title = Edit(0, token.start), "blanks before the XML declaration removed"
        else:
            edit, title = removed, "XML declaration removed"
        yield Fix("GP101", title, fault.start, (edit,))
    elif text.startswith(">", token.end - 1):
        yield Fix("GP101", "what is not XML removed", fault.start, (removed,))


FIXER = Fixer(
    name="markup",
    rules=("GP101", "GP102"),
    propose=propose,
    safe=(
        "removes a DOCTYPE, and an XML declaration that is malformed or not at the start, and "
        "parts double dashes in comments: none of these says anything about the plan"
    ),
)
