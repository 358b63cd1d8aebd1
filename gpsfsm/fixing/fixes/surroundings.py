"""Text, comments and markup between the elements of a plan and around it."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from gpsfsm.fixing.fixer import Edit, Fix, Fixer, Safety
from gpsfsm.fixing.layout import indentation, line_end, whole_lines
from gpsfsm.syntax.response import extract_plan
from gpsfsm.syntax.text import ILLEGAL, WHITE
from gpsfsm.syntax.tokens import Comment, Markup, TextRun

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft


_COMPLETE = re.compile(rf"(?:</Plan[{WHITE}]*+|/)>\Z")
_STEPS = {"runner", "control"}
_RULES = ("GP115", "GP101", "GP104", "GP108")


def _extracted_plan(draft: Draft) -> Iterator[Fix]:
    """The plan taken out of a language model's answer.

    Comments stay, and so does a declaration right before it.
    """
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
    edits += (Edit(*prefix) for prefix in extract.prefixes)
    for token in draft.tokens if base else ():
        before = indentation(text, token.start) if start < token.start < end else None
        if before is not None and before.startswith(base):
            edits.append(Edit(token.start - len(before), token.start - len(before) + len(base)))
    at = next((draft.offset(finding) for finding in draft.findings(rule)), extract.start)
    safety = Safety.SAFE if sure else Safety.UNSAFE
    yield Fix(rule, "plan extracted from the text around it", at, tuple(edits), safety)


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


_DECLARATION = re.compile(r"<[?!]xml\b", re.IGNORECASE)
_GOOD = re.compile(r"<\?xml\s+version\s*=\s*(?:\"1\.\d+\"|'1\.\d+')[^<>]*\?>")
_DASHES = re.compile(r"-(?=-)")


def _markup(draft: Draft) -> Iterator[Fix]:
    """XML declarations, DOCTYPEs and comments that are no XML: one fix each."""
    text = draft.text
    for token in draft.tokens:
        if isinstance(token, Markup) and token.faults and not token.swallowed:
            yield from _mended_markup(draft, token)
        elif isinstance(token, Comment) and token.faults and token.end > token.body_end:
            body = text[token.start + 4 : token.body_end]
            words = _DASHES.sub("- ", body)
            words += " " if words.endswith("-") else ""
            words = " " + words if words.startswith("-") or words.startswith(">") else words
            edit = Edit(token.start + 4, token.body_end, words)
            yield Fix("GP101", "dashes in a comment separated", token.faults[0].start, (edit,))


def _mended_markup(draft: Draft, token: Markup) -> Iterator[Fix]:
    text, fault = draft.text, token.faults[0]
    removed = Edit(*whole_lines(text, token.start, token.end))
    if fault.rule == "GP102":
        yield Fix("GP102", "DOCTYPE removed", fault.start, (removed,))
    elif _DECLARATION.match(text, token.start):
        blank_before = token.start > 0 and not text[: token.start].strip(WHITE)
        if blank_before and _GOOD.fullmatch(text, token.start, token.end):
            edit, title = Edit(0, token.start), "white space before the XML declaration removed"
        else:
            edit, title = removed, "XML declaration removed"
        yield Fix("GP101", title, fault.start, (edit,))
    elif text.startswith(">", token.end - 1):
        yield Fix("GP101", "markup that is not XML removed", fault.start, (removed,))


_RUN = re.compile(f"(?:{ILLEGAL.pattern})++")
_UTF16 = re.compile(
    r"\s*<\?xml[^<>]*?\sencoding\s*=\s*[\"'](utf-?16(?:le|be)?)[\"']", re.IGNORECASE
)
_MOST = 100_000


def _illegal_characters(draft: Draft) -> Iterator[Fix]:
    """Characters that XML forbids: one fix for all, and one for a wrong encoding."""
    edits: list[Edit] = []
    for match in _RUN.finditer(draft.text):
        edits.append(Edit(match.start(), match.end()))
        if len(edits) > _MOST:
            return
    if edits:
        title = "characters that XML forbids removed"
        yield Fix("GP116", title, edits[0].start, tuple(edits))
    declared = _UTF16.match(draft.text)
    if declared:
        edit = Edit(declared.start(1), declared.end(1), "UTF-8")
        yield Fix("GP116", "declared encoding changed to UTF-8", declared.start(1), (edit,))


def _stray_text(draft: Draft) -> Iterator[Fix]:
    """Text inside a plan: one fix each, which makes it a comment."""
    texts = {run.start: run for run in draft.tokens if isinstance(run, TextRun)}
    for finding in draft.findings("GP108"):
        run = texts.get(draft.offset(finding))
        if run is None:
            continue
        end = run.start + len(draft.text[run.start : run.end].rstrip(WHITE))
        words = _DASHES.sub("- ", draft.text[run.start : end])
        if words.strip("`'\" ") in ("", "/>", ">", "/", "xml"):
            edit, title = Edit(run.start, end), "text removed"
        else:
            # A comment that looks like an instruction to gpsfsm would become one.
            edit, title = Edit(run.start, end, f"<!-- text: {words} -->"), "text commented out"
        yield Fix("GP108", title, run.start, (edit,))


FIXERS = (
    Fixer(
        name="extracted-plan",
        rules=_RULES,
        propose=_extracted_plan,
        first=True,
        safe=(
            "removes prose, Markdown fences and foreign elements around the only plan in the text: "
            "they mean nothing to an executor; comments stay, except those in other plans"
        ),
        unsafe=(
            "takes the last of several plans (safe with `--from-response`, which asks for it), or "
            "a plan that is cut off or has runners next to it: something else may be meant"
        ),
    ),
    Fixer(
        name="markup",
        trees=True,
        rules=("GP101", "GP102"),
        propose=_markup,
        safe=(
            "removes a DOCTYPE, removes an XML declaration that is malformed or not at the start, "
            "and separates double dashes in comments: none of these says anything about the plan"
        ),
    ),
    Fixer(
        name="illegal-characters",
        trees=True,
        rules=("GP116",),
        propose=_illegal_characters,
        safe=(
            "removes control characters, and declares UTF-8 if a text declares UTF-16 but is not "
            "encoded in it: no plan needs either"
        ),
    ),
    Fixer(
        name="stray-text",
        trees=True,
        rules=("GP108",),
        propose=_stray_text,
        safe="turns text between elements into a comment: nothing reads either of them",
    ),
)
