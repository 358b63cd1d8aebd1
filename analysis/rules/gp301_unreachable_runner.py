"""GP301: a runner instance that no run triggers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.rules.base import Rule, control, go, plan, say
from gpsfsm.compile import UnitKind
from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.story import Vocabulary

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context


def find(context: Context) -> Iterator[Finding]:
    """One finding per place where the plan is cut off, with all runners behind it."""
    units = context.units
    for unit in context.unreached_roots:
        parent = units.parents[unit]
        if parent < 0 or units.kinds[parent] is UnitKind.GUARD:
            continue  # GP307 and GP308 name the cause
        cut_off = [unit]
        cause = "what comes before it never succeeds"
        if units.kinds[parent] is UnitKind.SEQUENCE and units.positions[unit]:
            before = units.children[parent][units.positions[unit] - 1]
            if not context.reached[before]:
                continue  # told already, with the unit before
            cause = f"{context.place(context.element_of(before))} never succeeds"
            cut_off = list(units.children[parent][units.positions[unit] :])
        runners = [number for other in cut_off for number in context.runners_in(other)]
        if runners:
            yield _finding(context, runners, cause)


def _finding(context: Context, runners: list[int], cause: str) -> Finding:
    first, *others = map(context.runner, runners)
    trees = context.plan.vocabulary is Vocabulary.TREE
    behind = f"; nor is what follows ({len(others)} more)" if others else ""
    return RULE.finding(
        f"{context.place(first)} is never reached: {cause}{behind}",
        context.plan.location(first),
        hint=RULE.fix.replace("the runner", "the node") if trees else "",
        related=tuple(context.related(runner, "never reached") for runner in others),
    )


RULE = Rule(
    code="GP301",
    name="unreachable-runner",
    severity=Severity.ERROR,
    summary="No run of the plan triggers this runner.",
    why=(
        "The plan says that the robot does something, but there is no scenario in which it does. "
        "Under the options of the check something before it never succeeds."
    ),
    fix="remove the runner, or change what comes before it so that it can succeed",
    bad=plan(go(9.0, 9.0), say("Delivered.")),
    good=plan(go(9.0, 9.0), control("recovery", go(8.0, 8.0)), say("Delivered.")),
    options=("--assume", "WaypointRunner(x=9.0) never succeeds"),
    find=find,
)
