"""The view document: everything that the page shows, as one object of JSON (docs/view.md)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.version import VERSION
from gpsfsm.viewing.comparing import compared
from gpsfsm.viewing.findings import rules_of
from gpsfsm.viewing.plans import Viewed, plan_data, seen_of
from gpsfsm.viewing.scenarios import Budget

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.checking import CheckOptions

__all__ = ["FORMAT", "FORMAT_VERSION", "Viewed", "document"]

FORMAT = "gpsfsm-view"
FORMAT_VERSION = 1


def document(
    viewed: Sequence[Viewed],
    options: CheckOptions,
    *,
    title: str = "",
    diff: bool = False,
) -> dict[str, Any]:
    """The document of some plans, which were checked with these options.

    If these hold a task, each plan is graded. ``diff``: the first two are compared.
    """
    budget = Budget()
    texts = [seen_of(each, options) for each in viewed]
    plans = [
        plan_data(each, seen, options, budget) for each, seen in zip(viewed, texts, strict=True)
    ]
    codes = {finding["rule"] for plan in plans for finding in plan["findings"]}
    paths = [each.report.path for each in viewed]
    return {
        "format": FORMAT,
        "version": FORMAT_VERSION,
        "tool": f"gpsfsm {VERSION}",
        "title": title or (paths[0] if len(paths) == 1 else f"{len(paths)} plans"),
        "rules": rules_of(codes),
        "plans": plans,
        "diff": compared((texts[0], texts[1]), options) if diff else None,
    }
