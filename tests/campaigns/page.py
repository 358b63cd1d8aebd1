"""The counts of a campaign as a table, and docs/reliability.md, which shows it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.campaigns.marks import PAGE, replaced
from tests.campaigns.registry import all_pairs

if TYPE_CHECKING:
    from tests.campaigns.counts import Counts

__all__ = ["table", "write_page"]


def table(counts: Counts) -> str:
    """What was compared, how often, and what came of it, as Markdown."""
    lines = [
        "| what | cases | disagreements | no answer | seconds |",
        "|---|---:|---:|---:|---:|",
    ]
    pairs = all_pairs()
    for name, each in sorted(counts.of.items()):
        about = pairs[name].about if name in pairs else ""
        lines.append(
            f"| `{name}`: {about} | {each.cases:,} | {each.disagreements} | {each.unknown} "
            f"| {each.seconds:,.0f} |"
        )
    return "\n".join(lines)


def labels(counts: Counts) -> str:
    """What occurred in the cases, so that one sees that no answer is missing."""
    lines = ["| what | what occurred, in how many cases or answers |", "|---|---|"]
    for name, each in sorted(counts.of.items()):
        said = ", ".join(f"{label} {count:,}" for label, count in sorted(each.labels.items()))
        lines.append(f"| `{name}` | {said} |")
    return "\n".join(lines)


def write_page(counts: Counts, *, attacks: bool) -> None:
    """Put the counts into docs/reliability.md."""
    text = PAGE.read_text(encoding="utf-8")
    mark = "attacks" if attacks else "campaign"
    text = replaced(text, mark, f"{table(counts)}\n\n{labels(counts)}")
    PAGE.write_text(text, encoding="utf-8")
