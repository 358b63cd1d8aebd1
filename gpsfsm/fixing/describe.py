"""Which rules have fixes, and why the others have none: the table of docs/fix.md."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.rules import all_rules
from gpsfsm.fixing.registry import all_fixers

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

__all__ = ["WITHOUT", "table_markdown"]

_NOT_TEXT = "it says why there is no verdict, not what is wrong with a plan"
WITHOUT: Mapping[str, str] = {
    "GP103": "a text over a limit is not read",
    "GP204": "only the author knows the value",
    "GP206": "only the author knows the value",
    "GP207": "only the author knows what shall stand there",
    "GP209": "no file names what to use instead",
    "GP210": "the capability file is what is missing",
    "GP211": "the capability file is what is wrong",
    "GP301": "what keeps a runner from running is told and fixed by other rules",
    "GP303": "a recovery inside of the units or around them: both make sense",
    "GP304": "what keeps a plan from completing is told and fixed by other rules",
    "GP305": "what makes a plan give up is told and fixed by other rules",
    "GP306": "which unit should let the plan go on is a decision",
    "GP311": "the plan may well be meant to leave a runner behind",
    "GP312": "what was asked has to be asked in another way",
    "GP401": "who should give the value is a decision",
    "GP402": "steps would have to change places, or values go by the prompt buffer",
    "GP403": "either the literal or what arrives is meant",
    "GP404": "the output may be of no interest",
    "GP405": "what should arrive instead is a decision",
    "GP412": "what should be asked is not in the plan",
    "GP413": "which of the buffers is meant is a decision",
    "GP502": "which steps to leave out is a decision",
    "GP503": "which steps to leave out is a decision",
    **dict.fromkeys(
        [f"GP6{number:02}" for number in range(1, 10)],
        "what the task asks for is known, but not which plan its author would write",
    ),
    **dict.fromkeys(
        [f"GP7{number:02}" for number in range(1, 10)],
        "`gpsfsm port` rewrites plans for an engine; the paper's semantics finds nothing wrong",
    ),
    **dict.fromkeys(
        [f"GP8{number:02}" for number in range(1, 16)],
        "the fixes know plans; a behaviour tree stays as it is",
    ),
    "GP901": "there is nothing to fix in",
    "GP902": _NOT_TEXT,
    "GP903": _NOT_TEXT,
    "GP904": _NOT_TEXT,
    "GP905": "under other options the comment may suppress something",
    "GP906": "the assumption is not in the plan",
    "GP907": "the assumption is not in the plan",
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
