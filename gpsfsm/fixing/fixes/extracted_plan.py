"""GP101, GP104, GP108, GP115: the plan is taken out of a language model's answer."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from gpsfsm.fixing.edit import Edit, Fix
from gpsfsm.fixing.fixer import Fixer, Safety
from gpsfsm.fixing.layout import indentation, line_end
from gpsfsm.syntax.chars import WHITE
from gpsfsm.syntax.response import extract_plan
from gpsfsm.syntax.tokens import Comment, Markup

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft

__all__ = ["FIXER"]

_COMPLETE = re.compile(rf"(?:</Plan[{WHITE}]*+|/)>\Z")
_RULES = ("GP115", "GP101", "GP104", "GP108")


def propose(draft: Draft) -> Iterator[Fix]:
    """Leave out what is around the plan, but for comments and a declaration right before it."""
    text = draft.readable
    extract = extract_plan(text, draft.options.limits.max_markup)
    if extract is None or not extract.note:
        return
    rule = next((rule for rule in _RULES if draft.wants(rule)), "")
    if not rule:
        return
    start, end = _with_comments(draft, extract.start, extract.end)
    others = text.count("<Plan", 0, extract.start) + text.count("<Plan", extract.end)
    alone = draft.options.from_response or not others
    sure = alone and _COMPLETE.search(text[extract.start : extract.end].rstrip(WHITE)) is not None
    # What is left is a text of its own, so it ends like one.
    ending = line_end(draft.text) if end < len(text) else ""
    base = indentation(text, start) or ""
    edits = [Edit(0, start), Edit(end, len(text), ending)]
    for token in draft.tokens if base else ():
        before = indentation(text, token.start) if start < token.start < end else None
        if before is not None and before.startswith(base):
            edits.append(Edit(token.start - len(before), token.start - len(before) + len(base)))
    at = next((draft.offset(finding) for finding in draft.findings(rule)), extract.start)
    safety = Safety.SAFE if sure else Safety.UNSAFE
    yield Fix(rule, "plan taken out of the text around it", at, tuple(edits), safety)


def _with_comments(draft: Draft, start: int, end: int) -> tuple[int, int]:
    """The plan with the comments, and the XML declaration, that stand right beside it."""
    text = draft.readable
    for token in reversed([each for each in draft.tokens if each.end <= start]):
        declaration = isinstance(token, Markup) and text.startswith("<?xml ", token.start)
        kept = isinstance(token, Comment) or declaration
        if not kept or text[token.end : start].strip(WHITE):
            break
        start = token.start
        if declaration:
            break
    for token in (each for each in draft.tokens if each.start >= end):
        if not isinstance(token, Comment) or text[end : token.start].strip(WHITE):
            break
        end = token.end
    return start, end


FIXER = Fixer(
    name="extracted-plan",
    rules=_RULES,
    propose=propose,
    first=True,
    safe=(
        "leaves out prose, Markdown fences and foreign elements around the one plan of the text: "
        "they say nothing to an executor"
    ),
    unsafe=(
        "takes the last of several plans (safe with `--from-response`, which asks for that), or "
        "one that is cut off: another one may be meant"
    ),
)
