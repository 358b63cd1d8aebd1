"""Runs that end badly, or not at all: GP311, GP313, GP314 and GP315.

GP311: runners that are still active at completion. GP315: plans that complete without what they are
for. GP313 and GP314: loops that do not end; ``machines/findings.py`` finds them, here is what is
said of them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.decisions.orphans import orphan_claim
from gpsfsm.analysis.decisions.swallowed import Goals, swallowed_claim
from gpsfsm.analysis.rules.base import Rule, control, go, machine, plan, runner
from gpsfsm.analysis.words import listed
from gpsfsm.compile import UnitKind
from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.plan import Kind
from gpsfsm.model.story import Sentence, Statement

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context
    from gpsfsm.model.finding import Scenario
    from gpsfsm.model.plan import Element

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
        verb = "is" if len(numbers) == 1 else "are"
        what = "parallel_all when one fails" if failed else "parallel_any when one succeeds"
        yield _ORPHAN.finding(
            f"the plan can complete while {names} {verb} still active: nothing stops the other "
            f"units of this {what}",
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

_ONE_BY_ONE = 3
"""Goals that have a finding each; more of them share one."""


def find_swallowed(context: Context) -> Iterator[Finding]:
    """One finding per goal that a completed run may miss, or one for all of many."""
    missed = context.answers["swallowed"] or ()
    shown = missed if len(missed) <= _ONE_BY_ONE else missed[:1]
    goals = Goals(context.compiled)
    for goal in shown:
        element = context.plan.elements[goals.first_element(goal)]
        scenario = context.scenario(
            _SWALLOWED.code,
            swallowed_claim(context.compiled, goal),
            Sentence(Statement.SWALLOWED),
        )
        steps = [] if scenario is None else _in_its_place(context, goal, scenario)
        others = [goals.first_element(each) for each in missed if each not in shown]
        alternatives = any(goals.achieves[unit] for unit in _alternatives(context, goal))
        if element.kind is Kind.RUNNER:
            failed = "and all its alternatives fail" if alternatives else "fails"
        else:
            failed = "does not reach its goal" + (", nor its alternatives" if alternatives else "")
        verb = "succeeds" if len(steps) == 1 else "succeed"
        instead = f": only {listed(list(map(context.place, steps)))} {verb} then" if steps else ""
        more = f"; so it is with {len(others)} more goals" if others else ""
        yield _SWALLOWED.finding(
            f"the plan completes even if {context.place(element)} {failed}{instead}{more}",
            context.plan.location(element),
            hint=_HINT_SWALLOWED.format(_these(context, steps)),
            related=(
                *(context.related(step, "hides the failure") for step in steps),
                *(
                    context.related(context.plan.elements[other], "may be missed as well")
                    for other in others
                ),
            ),
            scenario=scenario,
        )


_HINT_SWALLOWED = (
    "remove {}, so that the plan gives up and a new one can be made, or put another way to reach "
    "the goal in its place"
)


def _these(context: Context, steps: list[Element]) -> str:
    """The steps of a hint."""
    return context.place(steps[0]) if len(steps) == 1 else "what hides the failure"


def _alternatives(context: Context, goal: int) -> Iterator[int]:
    """The units of the recoveries that guard a goal."""
    while context.units.kinds[goal] is UnitKind.GUARD:
        yield from context.units.children[goal][1:]
        goal = context.units.children[goal][0]


def _in_its_place(context: Context, goal: int, scenario: Scenario) -> list[Element]:
    """The runners by whose success the plan goes on without the goal.

    They are in the unit that succeeds in the innermost guard or parallel control around it.
    """
    decisions = dict(scenario.outcomes)
    outcomes = {
        number: decisions[path]
        for number, runner in enumerate(context.plan.runners)
        if (path := context.plan.path(runner)) in decisions
    }
    run = context.deciders.evaluator.surely(outcomes)

    def succeeds(unit: int) -> bool:
        success = context.compiled.outlets[unit][0]
        return success is not None and run.happens(success)

    unit = goal
    while unit > 0 and not succeeds(unit):
        unit = context.units.parents[unit]
    while context.units.kinds[unit] in (UnitKind.GUARD, UnitKind.ANY):
        unit = next((each for each in context.units.children[unit] if succeeds(each)), 0)
    return [
        context.runner(number)
        for number in context.runners_in(unit)
        if unit and succeeds(context.unit_of_runner[number])
    ]


_LOG = runner("generic_capabilities/LogRunner", text="not there")

_SWALLOWED = Rule(
    code="GP315",
    name="swallowed-failure",
    severity=Severity.WARNING,
    summary="The plan can complete although a goal and all its alternatives have failed.",
    why=(
        "Completed is what is reported of such a run, and nobody makes a new plan. A recovery is "
        "for another way to reach the goal; a step behind it that always succeeds, such as a "
        "LogRunner, takes the failure away from those who could do something about it. What is a "
        "goal is said by `achieves` in capability files: of the built-in library driving and "
        "speaking are."
    ),
    fix=(
        "remove the step that hides the failure, so that the plan gives up, or put another way to "
        "reach the goal in its place"
    ),
    bad=plan(go(1.0, 3.0), control("recovery", go(0.0, 2.0), _LOG)),
    good=plan(go(1.0, 3.0), control("recovery", go(0.0, 2.0))),
    find=find_swallowed,
)

RULES = (
    _ORPHAN,
    _SWALLOWED,
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
        fix=(
            "nothing, if that is intended; else write one runner for each attempt, so that they "
            "are counted"
        ),
        bad=machine("drive SUCCEEDED end", "drive FAILED drive"),
        good=machine("drive SUCCEEDED end", "drive FAILED lost"),
    ),
)
