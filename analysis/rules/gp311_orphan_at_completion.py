"""GP311: runner instances that are still active when the plan completes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.decisions.orphans import orphan_claim
from gpsfsm.analysis.rules.base import Rule, control, go, plan
from gpsfsm.analysis.words import listed
from gpsfsm.compile import UnitKind
from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.story import Sentence, Statement

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context

_HINT_ALL = (
    "let the recovery undo what is still going on, or run the units one after the other if the "
    "robot must be at rest when the plan completes"
)


def find(context: Context) -> Iterator[Finding]:
    """One finding per parallel control that leaves runners behind."""
    units = context.units
    groups: dict[int, list[int]] = {}
    for number in context.answers["orphans"] or ():
        groups.setdefault(_block(context, context.unit_of_runner[number]), []).append(number)
    for block in sorted(groups, key=lambda unit: units.elements[unit]):
        numbers = groups[block]
        first = context.runner(numbers[0])
        names = listed([context.place(context.runner(number)) for number in numbers])
        failed = units.kinds[block] is UnitKind.ALL
        what = "parallel_all has failed" if failed else "parallel_any has succeeded"
        yield RULE.finding(
            f"nothing stops the other units when one unit of this {what}: the plan can complete "
            f"while these are still active: {names}",
            context.plan.location(units.elements[block]),
            hint=_HINT_ALL if failed else "",
            related=tuple(
                context.related(context.runner(number), "can be active at completion")
                for number in numbers
            ),
            scenario=context.scenario(
                RULE.code,
                orphan_claim(context.clock, numbers[0]),
                Sentence(Statement.LEFT_RUNNING, arguments=(context.place(first),)),
            ),
        )


def _block(context: Context, unit: int) -> int:
    """The innermost parallel_any around a unit, or else the innermost parallel_all."""
    units = context.units
    around = [block for block in context.around(unit) if len(units.children[block]) > 1]
    for kind in (UnitKind.ANY, UnitKind.ALL):
        for block in around:
            if units.kinds[block] is kind:
                return block
    return 0


RULE = Rule(
    code="GP311",
    name="orphan-at-completion",
    severity=Severity.WARNING,
    summary="A runner can still be active when the plan completes.",
    why=(
        "A parallel_any goes on as soon as one unit has succeeded, a guarded parallel_all as soon "
        "as one has failed; nothing stops the others. The robot may still be driving when the "
        "plan is reported as completed and the next one starts."
    ),
    fix="use a recovery if the second unit is only the alternative, or parallel_all if both matter",
    bad=plan(control("parallel_any", go(1.0, 3.0), go(0.0, 2.0))),
    good=plan(go(1.0, 3.0), control("recovery", go(0.0, 2.0))),
    find=find,
)
