"""GP113: the completion runner that a plan names as its last element."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.fixing.fixer import Fix, Fixer
from gpsfsm.fixing.layout import removed

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft


def propose(draft: Draft) -> Iterator[Fix]:
    """One fix, for there is one last element."""
    for finding in draft.findings("GP113"):
        node = draft.node(draft.offset(finding))
        if node is not None:
            edits = (removed(draft, node),)
            yield Fix("GP113", "completion runner removed", node.start, edits)


FIXER = Fixer(
    name="completion-runner",
    rules=("GP113",),
    propose=propose,
    safe="removes the completion runner at the end: the plan completes there without it",
)
