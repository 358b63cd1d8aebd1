"""Runs that end badly, or not at all: GP311, GP313, GP314 and GP315.

GP311: runners that are still active at completion. GP315: plans that complete without what they are
for. GP313 and GP314: loops that do not end; ``machines/findings.py`` finds them, here is what is
said of them. GP316: recoveries that are written before the step of
which their name speaks. GP317: parallel controls of one unit.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from gpsfsm.analysis.decisions.orphans import orphan_claim
from gpsfsm.analysis.decisions.swallowed import Goals, swallowed_claim
from gpsfsm.analysis.rules.base import Rule, control, go, machine, plan, runner
from gpsfsm.analysis.words import count, listed
from gpsfsm.compile import UnitKind
from gpsfsm.model.finding import Confidence, Finding, Severity
from gpsfsm.model.plan import Kind
from gpsfsm.model.story import Sentence, Statement

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from gpsfsm.analysis.context import Context
    from gpsfsm.model.finding import Scenario
    from gpsfsm.model.plan import Element

_HINT_ALL = (
    "let the recovery undo what is still running, or run the units one after the other if the "
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
        "A parallel_any continues as soon as one unit has succeeded, a guarded parallel_all "
        "as soon as one has failed; nothing stops the others. The robot may still be driving "
        "when the plan is reported as completed and the next one starts."
    ),
    fix="use a recovery if the second unit is only an alternative, or parallel_all if both matter",
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
            f"this {element.control_type} has only one unit, so nothing runs in parallel with "
            f"{inside}",
            context.plan.location(element),
        )


_SINGLE_UNIT = Rule(
    code="GP317",
    name="single-unit-parallel",
    severity=Severity.INFO,
    summary="A parallel control has only one unit.",
    why=(
        "A single unit has nothing to run in parallel with, so the control behaves like a "
        "sequential. Perhaps a second unit is missing, or the control was meant for a step with "
        "its recovery, which needs none. Engines treat parallel controls in their own ways, so a "
        "plan is safer without it."
    ),
    fix='write type="sequential", remove the control, or add the missing unit',
    bad=plan(control("parallel_any", go(1.0, 3.0)), go(0.0, 0.0)),
    good=plan(go(1.0, 3.0), go(0.0, 0.0)),
    find=_find_single_unit,
)

_JOINT = r"[^0-9A-Za-z]*(?:(?:and|x|y)[^0-9A-Za-z]*)?"
_MINUS_SIGN = r"(?:-|\u2212|(?:minus|neg|negative|m)[_ ]?)"
_MAX_LABEL = 200
_FAR = 1e9
_VAGUE = frozenset(
    ("recovery", "recover", "step", "plan", "move", "main", "task", "sequence", "alternative")
)


def _find_misplaced_recovery(context: Context) -> Iterator[Finding]:
    """One finding per recovery that is named after the step behind it, and not after its own.

    That it speaks of the step behind must be clear to the sign; that it may speak of a step that
    the recovery guards or holds is enough to say nothing.
    """
    units = context.units
    guards = [unit for unit, kind in enumerate(units.kinds) if kind is UnitKind.GUARD]
    for guard in sorted(guards, key=lambda unit: units.elements[unit]):
        recovery = context.plan.elements[units.elements[guard]]
        label = (recovery.text("name") or "")[:_MAX_LABEL].lower()
        after = _step_behind(context, guard) if label else -1
        if after < 0:
            continue
        following = _first_step(context, after)
        if not _names(label, [context.element_of(after), following], strictly=True):
            continue
        guarded = context.element_of(guard)
        held = [context.runner(number) for number in context.runners_in(guard)]
        if _names(label, [guarded, *held], strictly=False):
            continue
        before = context.place(guarded)
        yield MISPLACED_RECOVERY.finding(
            f"the recovery '{label[:40]}' is named after {context.place(following)}, which follows "
            f"it, but it runs only after {before} has failed",
            context.plan.location(recovery),
            related=(
                context.related(following, "the step that it is named after"),
                context.related(guarded, "the step whose failure it handles"),
            ),
        )


def _step_behind(context: Context, guard: int) -> int:
    """The unit that comes next in a sequence around a guard; -1 if there is none."""
    units, unit = context.units, guard
    for around in context.around(guard):
        siblings = units.children[around]
        position = units.positions[unit]
        if units.kinds[around] is UnitKind.SEQUENCE and position + 1 < len(siblings):
            return siblings[position + 1]
        first = units.kinds[around] is UnitKind.GUARD and position == 0
        if not first and units.kinds[around] is not UnitKind.SEQUENCE:
            return -1
        unit = around
    return -1


def _first_step(context: Context, unit: int) -> Element:
    """The runner with which a unit begins, or else the unit's own element."""
    numbers = context.runners_in(unit)
    return context.runner(numbers[0]) if numbers else context.element_of(unit)


def _names(label: str, elements: Iterable[Element], *, strictly: bool) -> bool:
    """True if a name speaks of one of these elements, by its coordinates or by its name."""
    return any(
        _says_place(label, element, strictly=strictly) or _says_name(label, element)
        for element in elements
    )


def _says_place(label: str, element: Element, *, strictly: bool) -> bool:
    """True if a name holds x and y of a runner, as in ``2.0_-0.5`` or ``minus3_minus1``.

    Not strictly, a sign may be a hyphen between words, and one that is missing is no matter.
    """
    place = _place(element)
    if place is None:
        return False
    first, second = (_spelt(value, strictly=strictly) for value in place)
    before = r"(?<![0-9.])(?<![0-9]_)" if strictly else r"(?<![0-9.])"
    if strictly and place[0] >= 0:
        before += r"(?<!-)(?<!minus)(?<!minus_)(?<!neg)(?<!neg_)"
    joint = _JOINT if not strictly or place[1] < 0 else rf"(?!.{{0,3}}-[0-9]){_JOINT}"
    pattern = rf"{before}{first}{joint}{second}(?![0-9.]*[1-9])(?!_[0-9]*[1-9])"
    return re.search(pattern, label) is not None


def _place(element: Element) -> tuple[float, float] | None:
    """The coordinates x and y of a runner, where it is given both as numbers."""
    values = [element.parameters.get(name) for name in ("x", "y")]
    numbers = [
        float(value)
        for value in values
        if isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < _FAR
    ]
    return (numbers[0], numbers[1]) if len(numbers) == len(values) else None


def _spelt(value: float, *, strictly: bool) -> str:
    """The pattern of a number in a name: 2 is ``2``, ``2.0`` or ``2_0``; -0.5 ``-0_5``."""
    whole, _, rest = f"{abs(value):.6f}".rstrip("0").partition(".")
    digits = rf"{whole}[._p]{rest}0*" if rest else rf"{whole}(?:[._p]0+(?![0-9]))?"
    if value >= 0:
        return digits if strictly else rf"{_MINUS_SIGN}?{digits}"
    return f"{_MINUS_SIGN}{digits}" if strictly else rf"{_MINUS_SIGN}?{digits}"


def _says_name(label: str, element: Element) -> bool:
    """True if the name of a control stands in another name, word by word."""
    name = (element.text("name") or "")[:_MAX_LABEL].lower()
    words = re.findall(r"[a-z]+|[0-9]+", name)
    if not [word for word in words if len(word) > 2 and word not in _VAGUE]:
        return False
    mine = re.findall(r"[a-z]+|[0-9]+", label)
    spans = range(len(mine) - len(words) + 1)
    return any(mine[start : start + len(words)] == words for start in spans)


MISPLACED_RECOVERY = Rule(
    code="GP316",
    name="misplaced-recovery",
    severity=Severity.WARNING,
    summary="A recovery is named after the step that follows it, not after the one it guards.",
    why=(
        "A recovery handles the failure of the sibling right before it. If it is written "
        "before its step instead of after it, it runs when another step fails, and its own "
        "step is left without a recovery."
    ),
    fix="put the recovery right after the step that it is named after, or correct its name",
    bad=plan(
        go(2.0, -0.5),
        control("recovery", go(0.0, 2.0), name="recover_if_1_3_unreachable"),
        go(1.0, 3.0),
    ),
    good=plan(
        go(2.0, -0.5),
        go(1.0, 3.0),
        control("recovery", go(0.0, 2.0), name="recover_if_1_3_unreachable"),
    ),
    confidence=Confidence.HEURISTIC,
    find=_find_misplaced_recovery,
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
        failed = context.place(element)
        if element.kind is Kind.RUNNER:
            failed += " and all its alternatives fail" if alternatives else " fails"
        elif alternatives:
            failed = f"neither {failed} nor its alternatives reach the goal"
        else:
            failed += " does not reach its goal"
        verb = "succeeds" if len(steps) == 1 else "succeed"
        instead = f": only {listed(list(map(context.place, steps)))} {verb} then" if steps else ""
        more = f"; the same holds for {count(len(others), 'more goal')}" if others else ""
        yield _SWALLOWED.finding(
            f"the plan completes even if {failed}{instead}{more}",
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
    "remove {} so that the plan gives up and a new one can be generated, or replace it with "
    "another way to reach the goal"
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
        "Such a run is reported as completed, so no new plan is generated. A recovery should be "
        "another way to reach the goal; a step that always succeeds, such as a "
        "LogRunner, hides the failure from everything that could react to it. `achieves` in "
        "capability files declares what counts as a goal: driving and speaking do in the built-in "
        "library."
    ),
    fix=(
        "remove the step that hides the failure so that the plan gives up, or replace it with "
        "another way to reach the goal"
    ),
    bad=plan(go(1.0, 3.0), control("recovery", go(0.0, 2.0), _LOG)),
    good=plan(go(1.0, 3.0), control("recovery", go(0.0, 2.0))),
    find=find_swallowed,
)

RULES = (
    _ORPHAN,
    _SINGLE_UNIT,
    MISPLACED_RECOVERY,
    _SWALLOWED,
    Rule(
        code="GP313",
        name="inescapable-loop",
        severity=Severity.ERROR,
        summary="The machine can enter a loop that no outcome leaves.",
        why=(
            "From then on the robot repeats the same actions until somebody switches it off: "
            "whatever succeeds or fails, it can no longer complete, give up or stop."
        ),
        fix="connect an event of the loop to a node outside it, such as a success to complete",
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
            "A loop that ends only with a success continues until there is one. That is often "
            "intended, but endless attempts may not be. The scenario shows the shortest loop."
        ),
        fix=(
            "nothing if that is intended; otherwise write one runner per attempt, so that the "
            "number of attempts is limited"
        ),
        bad=machine("drive SUCCEEDED end", "drive FAILED drive"),
        good=machine("drive SUCCEEDED end", "drive FAILED lost"),
    ),
)
