"""GP307, GP310: a recovery that holds the goal together with its alternatives."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.compile.units import is_recovery
from gpsfsm.fixing.fixer import Fix, Fixer, Safety
from gpsfsm.fixing.layout import moved_before, nodes_of, units_of, unwrapped

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft
    from gpsfsm.model.plan import Element


def propose(draft: Draft) -> Iterator[Fix]:
    """One fix per recovery: its first unit goes before it."""
    plan = draft.plan
    if plan is None:
        return
    for finding in draft.findings("GP307", "GP310"):
        recovery = draft.element(finding)
        if recovery is None:
            continue
        if not is_recovery(recovery):
            recovery = plan.elements[recovery.parent]
        if not is_recovery(recovery):
            continue
        yield from _moved(draft, recovery, finding.rule, draft.offset(finding))


def _moved(draft: Draft, recovery: Element, rule: str, at: int) -> Iterator[Fix]:
    units = list(units_of(draft, recovery))
    target = draft.node(recovery)
    if target is None or not units or is_recovery(units[0][0]):
        return
    if len(units) == 1:
        if rule == "GP307" and _alone(draft, recovery):
            title = "goal taken out of a recovery that guards nothing"
            yield Fix(rule, title, at, unwrapped(draft, target), Safety.UNSAFE)
        return
    unit = nodes_of(draft, units[0])
    if unit is None:
        return
    title = "goal taken out of its recovery"
    yield Fix(rule, title, at, moved_before(draft, unit, target), Safety.UNSAFE)


def _alone(draft: Draft, recovery: Element) -> bool:
    """True if no unit follows that the recovery could be meant for."""
    assert draft.plan is not None
    siblings = list(draft.plan.children(draft.plan.elements[recovery.parent]))
    following = siblings[siblings.index(recovery) + 1 :][:1]
    return not following or is_recovery(following[0])


FIXER = Fixer(
    name="recovery-goal",
    rules=("GP307", "GP310"),
    propose=propose,
    unsafe=(
        "puts the first step of a recovery before it, so that it is tried in any case: from its "
        "shape alone nobody can tell a goal from an alternative"
    ),
    # The recovery now guards its own goal and not the step before it, and more steps run: what
    # they lack was hidden as long as they did not.
    reveals=frozenset({"GP301", "GP302"}),
)
