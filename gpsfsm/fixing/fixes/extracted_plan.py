"""GP101, GP104, GP108, GP115: the plan is taken out of a language model's answer."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from gpsfsm.fixing.fixer import Edit, Fix, Fixer, Safety
from gpsfsm.fixing.layout import indentation, line_end
from gpsfsm.syntax.response import extract_plan
from gpsfsm.syntax.text import WHITE
from gpsfsm.syntax.tokens import Comment, Markup

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft

_COMPLETE = re.compile(rf"(?:</Plan[{WHITE}]*+|/)>\Z")
_STEPS = {"runner", "control"}
_RULES = ("GP115", "GP101", "GP104", "GP108")


def propose(draft: Draft) -> Iterator[Fix]:
    """Leave out what is around the plan, but for comments and a declaration right before it."""
    text = draft.readable
    extract = extract_plan(text, draft.options.limits.max_markup)
    if extract is None or not extract.note or _alone(draft, extract.start, extract.end):
        return
    rule = next((rule for rule in _RULES if draft.wants(rule)), "")
    if not rule:
        return
    start, end = _with_comments(draft, extract.start, extract.end)
    others = text.count("<Plan", 0, extract.start) + text.count("<Plan", extract.end)
    alone = draft.options.from_response or not (others or _steps_outside(draft, start, end))
    sure = alone and _COMPLETE.search(text[extract.start : extract.end].rstrip(WHITE)) is not None
    base = indentation(text, start) or ""
    edits = [*_left_out(draft, start, end)]
    for token in draft.tokens if base else ():
        before = indentation(text, token.start) if start < token.start < end else None
        if before is not None and before.startswith(base):
            edits.append(Edit(token.start - len(before), token.start - len(before) + len(base)))
    at = next((draft.offset(finding) for finding in draft.findings(rule)), extract.start)
    safety = Safety.SAFE if sure else Safety.UNSAFE
    yield Fix(rule, "plan taken out of the text around it", at, tuple(edits), safety)


def _left_out(draft: Draft, start: int, end: int) -> Iterator[Edit]:
    """Edits that leave nothing around ``text[start:end]`` but comments, on lines of their own.

    Those of another plan go with it.
    """
    text, line = draft.text, line_end(draft.text)
    others = [
        (node.start, node.stop)
        for node in draft.outline.nodes.values()
        if node.name == "Plan" and not start <= node.start < end
    ]
    comments = [
        token
        for token in draft.tokens
        if isinstance(token, Comment)
        and token.end > token.body_end
        and not any(first < token.start < last for first, last in others)
    ]
    before = [text[each.start : each.end] + line for each in comments if each.end <= start]
    after = [text[each.start : each.end] + line for each in comments if each.start >= end]
    declared = [
        token.end
        for token in draft.tokens
        if isinstance(token, Markup) and token.start == start and before
    ]
    if declared:  # a declaration comes first
        yield Edit(0, start)
        yield Edit(declared[0], declared[0], line + "".join(before).removesuffix(line))
    else:
        yield Edit(0, start, "".join(before))
    # What is left is a text of its own, so it ends like one.
    yield Edit(end, len(text), (line if end < len(text) else "") + "".join(after))


def _steps_outside(draft: Draft, start: int, end: int) -> bool:
    """True if runners or controls stand outside of the plan: they may have been meant to run."""
    return any(
        node.name.casefold() in _STEPS and not start <= node.start < end
        for node in draft.outline.nodes.values()
    )


def _alone(draft: Draft, start: int, end: int) -> bool:
    """True if a plan has nothing around it but comments and markup, which other fixes mend."""
    return all(
        start <= token.start < end
        or (isinstance(token, Markup) and not token.swallowed)
        or (isinstance(token, Comment) and token.end > token.body_end)
        for token in draft.tokens
    )


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
        "they say nothing to an executor; comments stay, but for those of other plans"
    ),
    unsafe=(
        "takes the last of several plans (safe with `--from-response`, which asks for that), or "
        "one that is cut off or that has runners beside it: something else may be meant"
    ),
)
