"""Edits of a text: what a fix is made of, and how edits are applied."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

__all__ = ["Applied", "Edit", "Fix", "Safety", "apply_edits", "apply_to", "came_from", "compatible"]


class Safety(StrEnum):
    """``safe``: a plan that is read as it was meant means the same afterwards; else ``unsafe``."""

    SAFE = "safe"
    UNSAFE = "unsafe"


@dataclass(frozen=True, slots=True)
class Edit:
    """Replace ``text[start:end]`` by ``text``; offsets are code points of the decoded text."""

    start: int
    end: int
    text: str = ""


@dataclass(frozen=True, slots=True)
class Fix:
    """A proposal: ``edits`` that belong together and are meant to remove a finding of ``rule``.

    ``at`` is the offset of that finding, ``title`` says in one line what is done.
    """

    rule: str
    title: str
    at: int
    edits: tuple[Edit, ...]
    safety: Safety = Safety.SAFE


@dataclass(frozen=True, slots=True)
class Applied:
    """A fix that was applied; ``line`` is that of the text as it was given."""

    rule: str
    title: str
    line: int
    safety: Safety


def apply_edits(text: str, edits: Iterable[Edit]) -> str:
    """``text`` after the edits, which must not overlap; their order does not matter.

    >>> apply_edits("one two", [Edit(4, 7, "2"), Edit(0, 3, "1")])
    '1 2'
    """
    parts: list[str] = []
    position = 0
    for edit in sorted(edits, key=_place):
        if edit.start < position:
            raise ValueError("edits overlap")
        parts += (text[position : edit.start], edit.text)
        position = edit.end
    return "".join([*parts, text[position:]])


def apply_to(offset: int, edits: Sequence[Edit]) -> int:
    """Where an offset of the old text is afterwards; ``edits`` are sorted and do not overlap.

    An offset that an edit replaces moves to the end of what replaces it; an insertion at the
    offset itself stays before it.
    """
    shift = 0
    for edit in edits[: bisect_right(edits, offset, key=lambda edit: edit.start)]:
        if offset < edit.end:
            # A tag whose first characters are rewritten still begins where the edit begins.
            return edit.start + shift + (0 if offset == edit.start else len(edit.text))
        shift += len(edit.text) - (edit.end - edit.start)
    return offset + shift


def came_from(offset: int, edits: Sequence[Edit]) -> int:
    """The offset of the old text that is at ``offset`` afterwards: the opposite of ``apply_to``."""
    shift = 0
    for edit in edits:
        start = edit.start + shift
        if offset < start:
            break
        if offset < start + len(edit.text):
            return edit.start
        shift += len(edit.text) - (edit.end - edit.start)
    return offset - shift


def compatible(fixes: Iterable[Fix]) -> list[Fix]:
    """The fixes that can be applied together.

    Of two that overlap the first in the text is taken, at one place the one proposed first. Two
    insertions at one place overlap too, for their order would decide what they mean. A fix whose
    own edits overlap is left out: it was made for a text that is spelt otherwise.
    """
    kept: list[Fix] = []
    taken: list[tuple[int, int]] = []
    for fix in sorted(fixes, key=lambda fix: (fix.at, fix.rule)):
        ordered = sorted(fix.edits, key=_place)
        if any(one.end > other.start for one, other in pairwise(ordered)):
            continue
        spans = [(edit.start, max(edit.end, edit.start + 1)) for edit in fix.edits]
        starts = [start for start, _ in taken]
        if any(_touches(span, taken, bisect_right(starts, span[1])) for span in spans):
            continue
        kept.append(fix)
        taken = sorted([*taken, *spans])
    return kept


def _touches(span: tuple[int, int], taken: list[tuple[int, int]], until: int) -> bool:
    start, end = span
    # Spans that are taken do not overlap, so only the last ones before ``end`` can reach here.
    return any(
        start < other_end and other_start < end
        for other_start, other_end in taken[max(0, until - 2) : until + 1]
    )


def _place(edit: Edit) -> tuple[int, int]:
    return edit.start, edit.end
