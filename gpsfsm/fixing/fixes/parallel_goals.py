"""GP501: goals side by side that need the same thing for themselves."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.compile.units import is_recovery
from gpsfsm.fixing.fixer import Fix, Fixer, Safety
from gpsfsm.fixing.layout import attribute_edit, nodes_of, units_of, wrapped
from gpsfsm.model.plan import ControlType

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft
    from gpsfsm.model.plan import Element


def propose(draft: Draft) -> Iterator[Fix]:
    """One fix per parallel control whose units disturb each other.

    Where a unit only disturbs what comes later, the units may well have to run side by side.
    """
    if draft.plan is None:
        return
    for finding in draft.findings("GP501"):
        control = draft.element(finding)
        if control is not None and all(
            other.location.element.startswith(finding.location.element + "/")
            for other in finding.related
        ):
            yield from _one_by_one(draft, control, draft.offset(finding))


def _one_by_one(draft: Draft, control: Element, at: int) -> Iterator[Fix]:
    node = draft.node(control)
    raw = node.attribute("type") if node else None
    units = list(units_of(draft, control))
    if raw is None or len(units) < 2 or is_recovery(units[0][0]):
        return
    edit = attribute_edit(draft, raw, "type", ControlType.SEQUENTIAL)
    if control.control_type is ControlType.PARALLEL_ALL:
        title = "parallel_all made sequential"
        yield Fix("GP501", title, at, (edit,), Safety.UNSAFE)
    elif control.control_type is ControlType.PARALLEL_ANY:
        others = nodes_of(draft, [element for unit in units[1:] for element in unit])
        if others is not None:
            title = "parallel_any made a step with a recovery"
            edits = (edit, *wrapped(draft, others, '<Control type="recovery">'))
            yield Fix("GP501", title, at, edits, Safety.UNSAFE)


FIXER = Fixer(
    name="parallel-goals",
    rules=("GP501",),
    propose=propose,
    unsafe=(
        "has the units of a parallel control one after the other: all of a parallel_all, and of a "
        "parallel_any the next one only if those before it have failed, so that one success "
        "still suffices"
    ),
    # What was told of the parallel control as a whole is told of its last unit.
    reveals=frozenset({"GP302"}),
)
