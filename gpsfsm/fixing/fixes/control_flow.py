"""The arrangement of steps: recoveries, parallel goals, the completion runner."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.compile.units import is_recovery
from gpsfsm.fixing.fixer import Fix, Fixer, Safety
from gpsfsm.fixing.layout import (
    attribute_edit,
    moved_before,
    nodes_of,
    removed,
    units_of,
    unwrapped,
    wrapped,
)
from gpsfsm.model.plan import ControlType

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.plan import Element


def _early_recovery(draft: Draft) -> Iterator[Fix]:
    """One fix per recovery of one unit that a step follows: the step goes before it."""
    for finding, recovery in draft.elements("GP307"):
        if len(list(units_of(draft, recovery))) != 1:
            continue
        following = _following(draft, recovery)
        target = draft.node(recovery)
        if not following or is_recovery(following[0]) or target is None:
            continue
        unit = nodes_of(draft, following[:1])
        if unit is not None:
            edits = moved_before(draft, unit, target)
            title = "recovery moved behind the step that follows it"
            yield Fix("GP307", title, draft.offset(finding), edits, Safety.UNSAFE)


def _recovery_goal(draft: Draft) -> Iterator[Fix]:
    """One fix per recovery that holds the goal with its alternatives: the goal goes before it."""
    for finding, element in draft.elements("GP307", "GP310"):
        recovery = element if is_recovery(element) else _parent(draft, element)
        if is_recovery(recovery):
            yield from _moved(draft, recovery, finding.rule, draft.offset(finding))


def _moved(draft: Draft, recovery: Element, rule: str, at: int) -> Iterator[Fix]:
    units = list(units_of(draft, recovery))
    target = draft.node(recovery)
    if target is None or not units or is_recovery(units[0][0]):
        return
    if len(units) == 1:
        if rule == "GP307" and _alone(draft, recovery):
            title = "goal moved out of a recovery that guards nothing"
            yield Fix(rule, title, at, unwrapped(draft, target), Safety.UNSAFE)
        return
    unit = nodes_of(draft, units[0])
    if unit is None:
        return
    title = "goal moved out of its recovery"
    yield Fix(rule, title, at, moved_before(draft, unit, target), Safety.UNSAFE)


def _alone(draft: Draft, recovery: Element) -> bool:
    """True if no unit follows that the recovery could be meant for."""
    following = _following(draft, recovery)
    return not following or is_recovery(following[0])


def _parent(draft: Draft, element: Element) -> Element:
    assert draft.plan is not None, "the elements of findings are those of a plan"
    return draft.plan.elements[element.parent]


def _following(draft: Draft, element: Element) -> list[Element]:
    """The elements behind one, under the same parent."""
    assert draft.plan is not None, "the elements of findings are those of a plan"
    siblings = list(draft.plan.children(_parent(draft, element)))
    return siblings[siblings.index(element) + 1 :]


def _needless_recovery(draft: Draft) -> Iterator[Fix]:
    """One fix per recovery that never runs, and per try that is bound to fail again."""
    for finding, element in draft.elements("GP308", "GP309"):
        useless = element
        if finding.rule == "GP308":
            if not is_recovery(element) or not _never_runs(draft, element, finding):
                continue
            title = "recovery that never runs removed"
        else:
            if finding.severity.rank == 0:  # a second try can be right: worlds change
                continue
            recovery = _parent(draft, element)
            if not is_recovery(recovery):
                continue
            title = "second try that fails like the first removed"
            if len(list(units_of(draft, recovery))) == 1:
                useless = recovery
        node = draft.node(useless)
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


def _parallel_goals(draft: Draft) -> Iterator[Fix]:
    """One fix per parallel control whose units disturb each other.

    Where a unit only disturbs what comes later, the units may well have to run side by side.
    """
    for finding, control in draft.elements("GP501"):
        if all(
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
        title = "parallel_all changed to sequential"
        yield Fix("GP501", title, at, (edit,), Safety.UNSAFE)
    elif control.control_type is ControlType.PARALLEL_ANY:
        others = nodes_of(draft, [element for unit in units[1:] for element in unit])
        if others is not None:
            title = "parallel_any changed to a step with a recovery"
            edits = (edit, *wrapped(draft, others, '<Control type="recovery">'))
            yield Fix("GP501", title, at, edits, Safety.UNSAFE)


def _completion_runner(draft: Draft) -> Iterator[Fix]:
    """The completion runner that a plan names as its last element: one fix."""
    for finding in draft.findings("GP113"):
        node = draft.node(draft.offset(finding))
        if node is not None:
            edits = (removed(draft, node),)
            yield Fix("GP113", "completion runner removed", node.start, edits)


FIXERS = (
    Fixer(
        name="early-recovery",
        rules=("GP307",),
        propose=_early_recovery,
        unsafe=(
            "moves a recovery of one step behind the step that follows it: it may be meant for a "
            "step that the plan has left out"
        ),
        reveals=frozenset({"GP302"}),  # its steps run now, and the last of them can fail
    ),
    Fixer(
        name="recovery-goal",
        rules=("GP307", "GP310"),
        propose=_recovery_goal,
        unsafe=(
            "moves the first step of a recovery in front of it, so that it is always tried: the "
            "shape alone does not tell a goal from an alternative"
        ),
        # The recovery now guards its own goal and not the step before it, and more steps run: what
        # they lack was hidden as long as they did not.
        reveals=frozenset({"GP301", "GP302"}),
    ),
    Fixer(
        name="needless-recovery",
        rules=("GP308", "GP309"),
        propose=_needless_recovery,
        unsafe=(
            "removes a recovery that never runs and, with `--consistent`, a second try that fails "
            "like the first: it may have been meant for another step"
        ),
        reveals=frozenset({"GP302"}),  # the failure of the only try is the last one now
    ),
    Fixer(
        name="parallel-goals",
        rules=("GP501",),
        propose=_parallel_goals,
        unsafe=(
            "runs the units of a parallel control one after the other; those of a parallel_any "
            "only until one succeeds: the plan may need them at the same time"
        ),
        # What was told of the parallel control as a whole is told of its last unit.
        reveals=frozenset({"GP302"}),
    ),
    Fixer(
        name="completion-runner",
        rules=("GP113",),
        propose=_completion_runner,
        safe="removes the completion runner at the end: the plan completes there without it",
    ),
)
