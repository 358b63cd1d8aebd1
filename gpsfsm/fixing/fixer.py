"""Fixers, the fixes that they propose, and the edits of a text that these consist of.

A module of ``gpsfsm.fixing.fixes`` lists its fixers as ``FIXERS``; a new one may be a new file.
Some rules have no fixer, with reasons (``WITHOUT``). ``table_markdown`` writes the table of
docs/fix.md.
"""

from __future__ import annotations

import importlib
import os
import pkgutil
from bisect import bisect_right
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from itertools import islice, pairwise
from typing import TYPE_CHECKING

from gpsfsm.analysis.rules import all_rules
from gpsfsm.errors import DEBUG_VARIABLE, is_out_of_memory
from gpsfsm.fixing import fixes

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from gpsfsm.fixing.draft import Draft


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
    """A fix that was applied; ``line`` is a line of the original text.

    ``also`` lists the rules of other findings that the fix removed, one entry for each finding.
    """

    rule: str
    title: str
    line: int
    safety: Safety
    also: tuple[str, ...] = ()


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
    """The offset in the new text of an offset of the old one; ``edits`` are sorted and disjoint.

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


@dataclass(frozen=True, slots=True)
class Fixer:
    """One kind of repair.

    ``rules`` are those whose findings it removes. ``safe`` and ``unsafe`` say in one sentence
    what it does of each kind, and why it is of that kind ("": it proposes none of that kind).
    ``reveals`` are rules whose findings may come to light by it, which were hidden before.
    ``first``: it comes before all others, whatever its rule. ``plans`` and ``trees``: the texts
    that it is for.
    """

    name: str
    rules: tuple[str, ...]
    propose: Callable[[Draft], Iterable[Fix]]
    safe: str = ""
    unsafe: str = ""
    reveals: frozenset[str] = frozenset()
    first: bool = False
    plans: bool = True
    trees: bool = False

    def fits(self, *, trees: bool) -> bool:
        """True if the fixer is for behaviour trees, or for plans."""
        return self.trees if trees else self.plans


@cache
def all_fixers() -> tuple[Fixer, ...]:
    """All fixers, by name."""
    names = (each.name for each in pkgutil.iter_modules(fixes.__path__))
    modules = [importlib.import_module(f"{fixes.__name__}.{name}") for name in names]
    listed = (fixer for module in modules for fixer in module.FIXERS)
    return tuple(sorted(listed, key=lambda fixer: fixer.name))


def proposals_of(
    fixer: Fixer, draft: Draft, *, most: int, failed: dict[str, str] | None = None
) -> list[Fix]:
    """The first ``most`` proposals; those before the defect, should the fixer have one.

    The defect goes into ``failed`` by the name of the fixer. It is raised if the environment says
    that defects are to be shown.
    """
    proposals: list[Fix] = []
    try:
        proposals.extend(islice(fixer.propose(draft), most))
    except Exception as error:
        if is_out_of_memory(error):
            raise MemoryError from error
        if os.environ.get(DEBUG_VARIABLE):
            raise
        if failed is not None:
            failed[fixer.name] = f"{type(error).__name__}: {error}"
    return proposals


_NOT_TEXT = "the finding explains why there is no verdict; it reports no fault of the plan"
WITHOUT: Mapping[str, str] = {
    "GP103": "a text over a limit is not read",
    "GP117": "only the author knows what the machine is to do",
    "GP119": "nothing is wrong, unless the author meant something else",
    "GP204": "only the author knows the value",
    "GP206": "only the author knows the value",
    "GP207": "only the author knows the value",
    "GP209": "no capability file names a replacement",
    "GP210": "a capability file is missing; the plan may be right",
    "GP213": "only the operator can give the permission",
    "GP214": "only the operator knows which runner the leaf stands for",
    "GP211": "the capability file is wrong, not the plan",
    "GP301": "other rules report and fix what keeps the runner from running",
    "GP302": "only the author knows what else to try; a step that only logs would hide the failure",
    "GP303": "a recovery may belong inside the units or around them",
    "GP304": "other rules report and fix what keeps the plan from completing",
    "GP305": "other rules report and fix what makes the plan give up",
    "GP306": "only the author knows which unit should let the plan continue",
    "GP311": "the runner may be left active on purpose",
    "GP313": "only the author knows what should lead out of the loop",
    "GP314": "the loop may be meant to run as long as it takes",
    "GP315": "only the author knows another way to reach the goal",
    "GP316": "only the name indicates where the recovery belongs, and the name may be wrong",
    "GP317": "a second unit may be missing",
    "GP401": "only the author knows which runner should provide the value",
    "GP402": "the steps would have to be reordered, or the value passed through the prompt buffer",
    "GP403": "either the literal or the value that arrives may be meant",
    "GP404": "the plan may not need the output",
    "GP405": "only the author knows which value should arrive instead",
    "GP412": "the plan does not contain the question to ask",
    "GP413": "only the author knows which buffer is meant",
    "GP502": "only the author knows which steps to leave out",
    "GP503": "only the author knows which steps to leave out",
    **dict.fromkeys(
        [f"GP6{number:02}" for number in range(1, 11)],
        "the task is known, but not which plan its author would write",
    ),
    **dict.fromkeys(
        [f"GP7{number:02}" for number in (1, 2, 3, 4, 5, 6, 7, 9)],
        "by the paper's semantics the plan is right; `gpsfsm port` rewrites it for the engine",
    ),
    "GP710": "only the author knows whether to write the value or to hand it over",
    "GP804": "only the author can choose another name",
    "GP806": "either of the two may be meant",
    "GP807": "only the author knows the name",
    "GP809": "only the author knows what should stop the recursion",
    "GP813": "only the author has the missing part",
    "GP816": "nothing is wrong with the tree",
    "GP818": "only the author knows what the script should do",
    "GP819": "the children can be rearranged in several ways",
    "GP821": "only the author knows how often to retry, or which recovery to use",
    "GP822": "more retries or a Fallback may be meant",
    "GP825": "the node may also be put into another one",
    "GP826": "only the author can choose another name",
    "GP827": "either the key or a SubTreePlus may be meant",
    "GP901": "there is no text to fix",
    "GP902": _NOT_TEXT,
    "GP903": _NOT_TEXT,
    "GP904": _NOT_TEXT,
    "GP905": "under other options the comment may suppress something",
    "GP906": "the assumption is not in the plan",
    "GP907": "the assumption is not in the plan",
    "GP908": "the option is not in the plan",
}
"""Rules without fixes, and why."""


def table_markdown() -> str:
    """Two tables: what each fixer does, and why some rules have none."""
    return "\n".join([*_fixers(), "", *_without()]) + "\n"


def _fixers() -> Iterator[str]:
    yield "| Fix | Rules | Safe | Unsafe |"
    yield "|---|---|---|---|"
    ordered = sorted(all_fixers(), key=lambda fixer: (min(fixer.rules), fixer.name))
    for fixer in ordered:
        rules = ", ".join(f"[{code}](rules/{code}.md)" for code in sorted(fixer.rules))
        yield f"| {fixer.name} | {rules} | {fixer.safe or '-'} | {fixer.unsafe or '-'} |"


def _without() -> Iterator[str]:
    names = {rule.code: rule.name for rule in all_rules()}
    yield "| No fix | Why |"
    yield "|---|---|"
    for code, why in WITHOUT.items():
        yield f"| [{code}](rules/{code}.md) {names[code]} | {why} |"
