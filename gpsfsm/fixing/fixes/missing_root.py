"""GP104: controls and runners without a ``<Plan>`` around them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.fixing.fixer import Edit, Fix, Fixer
from gpsfsm.fixing.layout import indentation, line_end

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft


def propose(draft: Draft) -> Iterator[Fix]:
    """One fix, if every outermost element is a control or a runner."""
    roots = draft.outline.roots
    if not roots or any(root.name not in ("Control", "Runner") for root in roots):
        return
    if any(root.unfinished or not root.tag.closed for root in roots):
        return
    text = draft.text
    start, stop = roots[0].start, roots[-1].stop
    before = indentation(text, start)
    end = line_end(text) if before is not None else ""
    edits = (
        Edit(start, start, f"<Plan>{end}{before or ''}"),
        Edit(stop, stop, f"{end}{before or ''}</Plan>"),
    )
    yield Fix("GP104", "<Plan> put around the plan", start, edits)


FIXER = Fixer(
    name="missing-root",
    rules=("GP104",),
    propose=propose,
    safe=(
        "puts `<Plan>` around controls and runners that stand alone: nothing else can be around "
        "them, and it has them one after the other"
    ),
)
