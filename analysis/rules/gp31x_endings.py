"""GP311: runners that are still active at completion; GP313 and GP314: loops that do not end.

GP317 tells of parallel controls that have nothing beside their one unit.

The loops are found by ``machines/findings.py``; here is what is said of them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.decisions.orphans import orphan_claim
from gpsfsm.analysis.rules.base import Rule, control, go, machine, plan
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
        yield _ORPHAN.finding(
            f"nothing stops the other units when one unit of this {what}: the plan can complete "
            f"while these are still active: {names}",
            context.plan.location(units.elements[block]),
            hint=_HINT_ALL if failed else "",
            related=tuple(
                context.related(context.runner(number), "can be active at completion")
                for number in numbers
            ),
            scenario=context.scenario(
                _ORPHAN.code,
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


_ORPHAN = Rule(
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

_PARALLEL = (UnitKind.ALL, UnitKind.ANY)


def _find_single_unit(context: Context) -> Iterator[Finding]:
    """One finding per parallel control of one unit; recoveries belong to the unit before them."""
    units = context.units
    for unit, kind in enumerate(units.kinds):
        if kind not in _PARALLEL or len(units.children[unit]) != 1:
            continue
        element = context.plan.elements[units.elements[unit]]
        inside = context.place(context.element_of(units.children[unit][0]))
        yield _SINGLE_UNIT.finding(
            f"nothing runs beside {inside}: this {element.control_type} has only this one unit, so "
            "it does what a sequential does",
            context.plan.location(element),
        )


_SINGLE_UNIT = Rule(
    code="GP317",
    name="single-unit-parallel",
    severity=Severity.INFO,
    summary="A parallel control holds one unit only.",
    why=(
        "One unit has nothing to run beside. What was meant may be a second unit that is missing, "
        "a step with its recovery, which needs no control around it, or a sequential. Engines "
        "treat parallel controls in ways of their own, so a plan is the safer without it."
    ),
    fix='write type="sequential", leave the control out, or add the unit that is missing',
    bad=plan(control("parallel_any", go(1.0, 3.0)), go(0.0, 0.0)),
    good=plan(go(1.0, 3.0), go(0.0, 0.0)),
    find=_find_single_unit,
)

RULES = (
    _ORPHAN,
    _SINGLE_UNIT,
    Rule(
        code="GP313",
        name="inescapable-loop",
        severity=Severity.ERROR,
        summary="The machine can get into a loop that no outcomes lead out of.",
        why=(
            "From there on the robot repeats the same actions until somebody switches it off: "
            "neither completion nor give-up nor a standstill can be reached any more, whatever "
            "succeeds or fails."
        ),
        fix="connect an event of the loop to what leads out of it, such as its success to complete",
        bad=machine(
            "drive SUCCEEDED look",
            "look SUCCEEDED drive",
            "look FAILED drive",
            "drive FAILED drive",
        ),
        good=machine(
            "drive SUCCEEDED look", "look SUCCEEDED end", "look FAILED drive", "drive FAILED drive"
        ),
    ),
    Rule(
        code="GP314",
        name="endless-loop",
        severity=Severity.INFO,
        summary="The machine runs for ever if the same outcomes repeat.",
        why=(
            "A loop that only a success leads out of goes on as long as there is none. That is "
            "often what was wanted; a robot that tries without end may still not be. The scenario "
            "shows the shortest loop."
        ),
        fix="nothing, if that is wanted; else count the attempts, by one instance for each",
        bad=machine("drive SUCCEEDED end", "drive FAILED drive"),
        good=machine("drive SUCCEEDED end", "drive FAILED lost"),
    ),
)
