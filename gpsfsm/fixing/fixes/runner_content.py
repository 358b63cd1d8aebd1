"""GP114: what stands inside a runner."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.fixing.fixer import Edit, Fix, Fixer, Safety
from gpsfsm.fixing.layout import indentation, whole_lines
from gpsfsm.syntax.tokens import TextRun

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft, Node


def propose(draft: Draft) -> Iterator[Fix]:
    """One fix per runner: close it, so that what is inside stands behind it."""
    for finding in draft.findings("GP114"):
        at = draft.offset(finding)
        node = next(
            (
                each
                for each in draft.outline.nodes.values()
                if each.name == "Runner" and each.tag.end <= at < each.stop and _innermost(each, at)
            ),
            None,
        )
        if node is None or node.closing is None:
            continue
        yield _closed(draft, node, at)


def _innermost(node: Node, at: int) -> bool:
    return not any(c.name == "Runner" and c.tag.end <= at < c.stop for c in node.children)


def _closed(draft: Draft, node: Node, at: int) -> Fix:
    text, closing = draft.text, node.closing
    assert closing is not None
    end = node.tag.end - 1
    edits = [Edit(end, end, "/")]
    inside = [each for each in draft.tokens if node.tag.end <= each.start < closing.start]
    if not node.children and all(isinstance(each, TextRun) for each in inside):
        edits = [Edit(end, closing.end, "/>")]
        title = "text inside a runner removed"
        return Fix("GP114", title, at, tuple(edits), Safety.UNSAFE)
    edits.append(Edit(*whole_lines(text, closing.start, closing.end)))
    outer = indentation(text, node.start)
    for child in node.children:
        before = indentation(text, child.start)
        if outer is not None and before is not None and len(before) > len(outer):
            edits.append(Edit(child.start - len(before), child.start, outer))
    title = "runner closed, so that what was inside stands behind it"
    return Fix("GP114", title, at, tuple(edits), Safety.UNSAFE)


FIXER = Fixer(
    name="runner-content",
    rules=("GP114",),
    propose=propose,
    unsafe=(
        "closes the runner, so that the elements inside stand behind it, and removes text inside: "
        "what never ran before runs then"
    ),
)
