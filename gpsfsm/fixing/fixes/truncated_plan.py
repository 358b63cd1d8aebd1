"""GP101: a text that ends too early."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.fixing.fixer import Edit, Fix, Fixer, Safety
from gpsfsm.fixing.layout import indentation, line_end
from gpsfsm.syntax.text import WHITE
from gpsfsm.syntax.tokens import StartTag

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft


def propose(draft: Draft) -> Iterator[Fix]:
    """Close what is open; a tag that is cut off is left out."""
    nodes = [node for node in draft.outline.nodes.values() if node.unfinished]
    last = draft.tokens[-1] if draft.tokens else None
    cut = isinstance(last, StartTag) and not last.closed
    if cut and last is not None:
        nodes = [node for node in nodes if node.start != last.start]
        inside = draft.outline.nodes[last.start].parent
        if inside is None:
            return
    if not nodes:
        return
    text = draft.text
    end = len(text.rstrip(WHITE)) if not cut or last is None else last.start
    while end > 0 and text[end - 1] in WHITE:
        end -= 1
    written = ""
    for node in reversed(nodes):
        before = indentation(text, node.start)
        written += (
            f"</{node.name}>" if before is None else f"{line_end(text)}{before}</{node.name}>"
        )
    tail = "" if cut else text[end:]
    edit = Edit(end, len(text) if cut else end, written + (line_end(text) if cut else ""))
    title = "closed what was left open" + (" and left out a tag that is cut off" if cut else "")
    del tail
    yield Fix("GP101", title, end, (edit,), Safety.UNSAFE)


FIXER = Fixer(
    name="truncated-plan",
    rules=("GP101",),
    propose=propose,
    unsafe=(
        "closes the open elements of a text that ends too early and leaves out a tag that is cut "
        "off: what the rest would have said is lost"
    ),
)
