"""GP308, GP309: recoveries and steps of them that are of no use."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.compile.units import is_recovery
from gpsfsm.fixing.fixer import Fix, Fixer, Safety
from gpsfsm.fixing.layout import removed, units_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.plan import Element


def propose(draft: Draft) -> Iterator[Fix]:
    """One fix per recovery that never runs, and per try that is bound to fail again."""
    plan = draft.plan
    if plan is None:
        return
    for finding in draft.findings("GP308", "GP309"):
        element = draft.element(finding)
        if element is None:
            continue
        if finding.rule == "GP308":
            if not is_recovery(element) or not _never_runs(draft, element, finding):
                continue
            title = "recovery removed that never runs"
        else:
            if finding.severity.rank == 0:  # a second try can be right: worlds change
                continue
            recovery = plan.elements[element.parent]
            if not is_recovery(recovery):
                continue
            title = "second try removed that fails like the first"
            if len(list(units_of(draft, recovery))) == 1:
                element = recovery
        node = draft.node(element)
        if node is not None:
            edits = (removed(draft, node),)
            yield Fix(finding.rule, title, draft.offset(finding), edits, Safety.UNSAFE)


def _never_runs(draft: Draft, recovery: Element, finding: Finding) -> bool:
    """True if all runners of the recovery are among those that the finding lists."""
    assert draft.plan is not None
    path = draft.plan.path(recovery)
    inside = {
        draft.plan.path(runner)
        for runner in draft.plan.runners
        if draft.plan.path(runner).startswith(path + "/")
    }
    return inside <= {each.location.element for each in finding.related}


FIXER = Fixer(
    name="needless-recovery",
    rules=("GP308", "GP309"),
    propose=propose,
    unsafe=(
        "removes a recovery that never runs, and under `--consistent` a try that fails like the "
        "first: it may have been meant for another step"
    ),
    reveals=frozenset({"GP302"}),  # the failure of the only try is the last one now
)
