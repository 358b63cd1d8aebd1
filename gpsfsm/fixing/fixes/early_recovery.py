"""GP307: a recovery that stands before the step that it is meant for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.compile.units import is_recovery
from gpsfsm.fixing.fixer import Fix, Fixer, Safety
from gpsfsm.fixing.layout import moved_before, nodes_of, units_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft


def propose(draft: Draft) -> Iterator[Fix]:
    """One fix per recovery of one unit that a step follows: the step goes before it."""
    plan = draft.plan
    if plan is None:
        return
    for finding in draft.findings("GP307"):
        recovery = draft.element(finding)
        if recovery is None or len(list(units_of(draft, recovery))) != 1:
            continue
        siblings = list(plan.children(plan.elements[recovery.parent]))
        following = siblings[siblings.index(recovery) + 1 :]
        target = draft.node(recovery)
        if not following or is_recovery(following[0]) or target is None:
            continue
        unit = nodes_of(draft, following[:1])
        if unit is not None:
            edits = moved_before(draft, unit, target)
            title = "recovery put behind the step that follows it"
            yield Fix("GP307", title, draft.offset(finding), edits, Safety.UNSAFE)


FIXER = Fixer(
    name="early-recovery",
    rules=("GP307",),
    propose=propose,
    unsafe=(
        "puts a recovery of one step behind the step that follows it: it may be meant for "
        "something that the plan has left out"
    ),
    reveals=frozenset({"GP302"}),  # its steps run now, and the last of them can fail
)
