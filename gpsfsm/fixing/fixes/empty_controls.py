"""GP109: controls that hold nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.fixing.fixer import Fix, Fixer, Safety
from gpsfsm.fixing.layout import removed
from gpsfsm.model.plan import ControlType

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft, Node


def propose(draft: Draft) -> Iterator[Fix]:
    """One fix per control, with those around it that hold nothing else."""
    for finding in draft.findings("GP109"):
        node = draft.node(draft.offset(finding))
        if node is None or node.name != "Control":
            continue
        start = node.start
        while node.parent is not None and node.parent.parent and len(node.parent.children) == 1:
            node = node.parent
        if not _inside(draft, node):
            yield Fix("GP109", "empty control removed", start, (removed(draft, node),), _UNSAFE)


_UNSAFE = Safety.UNSAFE


def _inside(draft: Draft, node: Node) -> bool:
    """True if a recovery behind the control would guard something else without it."""
    parent = node.parent
    if parent is None:
        return True
    place = parent.children.index(node)
    if _type(draft, node) == ControlType.RECOVERY:
        return False
    return any(
        _type(draft, each) == ControlType.RECOVERY for each in parent.children[place + 1 :][:1]
    )


def _type(draft: Draft, node: Node) -> str:
    raw = node.attribute("type")
    return draft.text[raw.value_start : raw.value_end] if raw else ""


FIXER = Fixer(
    name="empty-controls",
    rules=("GP109",),
    propose=propose,
    unsafe=(
        "removes a control that holds nothing: steps may have been forgotten, and in a "
        "parallel_any an empty unit succeeds at once"
    ),
)
