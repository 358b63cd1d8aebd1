"""Rules on what no run reaches: runners, completion, any end but giving up; and on stuck runs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.claims import Claim
from gpsfsm.analysis.decisions.completion import give_up_claim
from gpsfsm.analysis.decisions.stuck import stuck_claim
from gpsfsm.analysis.rules.base import Rule, control, go, look, plan, say
from gpsfsm.compile import UnitKind
from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.report import Frequency
from gpsfsm.model.story import Statement, Vocabulary

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context


def _find_unreachable(context: Context) -> Iterator[Finding]:
    """One finding per place where the plan is cut off, with all runners behind it."""
    units = context.units
    trees = context.plan.vocabulary is Vocabulary.TREE
    for unit in context.unreached_roots:
        parent = units.parents[unit]
        guard = parent >= 0 and units.kinds[parent] is UnitKind.GUARD
        if parent < 0 or (guard and not trees):
            continue  # GP307 and GP308 name the cause
        cut_off = [unit]
        verb = "fails" if guard else "succeeds"
        cause = f"what comes before it never {verb}"
        if (guard or units.kinds[parent] is UnitKind.SEQUENCE) and units.positions[unit]:
            before = units.children[parent][units.positions[unit] - 1]
            if not context.reached[before]:
                continue  # told already, with the unit before
            cause = f"{context.place(context.element_of(before))} never {verb}"
            cut_off = list(units.children[parent][units.positions[unit] :])
        runners = [number for other in cut_off for number in context.runners_in(other)]
        if runners:
            yield _unreachable(context, runners, cause)


def _unreachable(context: Context, runners: list[int], cause: str) -> Finding:
    first, *others = map(context.runner, runners)
    trees = context.plan.vocabulary is Vocabulary.TREE
    more = f" and {len(others)} more after it are" if others else " is"
    return UNREACHABLE.finding(
        f"{context.place(first)}{more} never reached: {cause}",
        context.plan.location(first),
        hint=UNREACHABLE.fix.replace("the runner", "the node") if trees else "",
        related=tuple(context.related(runner, "never reached") for runner in others),
    )


UNREACHABLE = Rule(
    code="GP301",
    name="unreachable-runner",
    severity=Severity.ERROR,
    summary="No run of the plan triggers this runner.",
    why=(
        "The plan contains this step, but the robot executes it in no scenario. Under the "
        "options of the check, something before it never succeeds."
    ),
    fix="remove the runner, or change what comes before it so that it can succeed",
    bad=plan(go(9.0, 9.0), say("Delivered.")),
    good=plan(go(9.0, 9.0), control("recovery", go(8.0, 8.0)), say("Delivered.")),
    options=("--assume", "WaypointRunner(x=9.0) never succeeds"),
    find=_find_unreachable,
)


def _find_never_completes(context: Context) -> Iterator[Finding]:
    """At most one; a plan that always gives up is GP305's."""
    completes, gives_up = context.answers["completion"] or (None, None)
    if completes is Frequency.NEVER and gives_up is not Frequency.ALWAYS:
        claim = Claim(absent=(context.automaton.complete,))
        yield NEVER_COMPLETES.finding(
            f"this {context.terms.whole} never completes, whatever happens: "
            f"every run {context.terms.gives_up} or gets stuck",
            context.plan.location(0),
            scenario=context.scenario(NEVER_COMPLETES.code, claim, Statement.NOT_COMPLETED),
        )


NEVER_COMPLETES = Rule(
    code="GP304",
    name="never-completes",
    severity=Severity.ERROR,
    summary="No run of the plan completes.",
    why="A plan that cannot complete cannot do its task; dispatching it only wastes time.",
    fix=(
        "guard the runner that never succeeds in the scenario with a recovery, or drop the "
        "assumption that it never succeeds"
    ),
    bad=plan(look("Is somebody there?"), go(1.0, 1.0), say("Hello.")),
    good=plan(
        look("Is somebody there?"),
        control("recovery", go(1.0, 1.0)),
        say("Hello."),
    ),
    options=("--faults", "hang", "--assume", "ImageAnalysisRunner never succeeds"),
    find=_find_never_completes,
)


_TREE_HINT = (
    "put a Fallback around the node that fails in the scenario, or change the node that prevents "
    "every success, such as ForceFailure or Inverter"
)


def _find_always_gives_up(context: Context) -> Iterator[Finding]:
    """At most one."""
    _, gives_up = context.answers["completion"] or (None, None)
    if gives_up is Frequency.ALWAYS:
        yield ALWAYS_GIVES_UP.finding(
            f"this {context.terms.whole} {context.terms.gives_up} in every scenario, "
            "so it can never do its task",
            context.plan.location(0),
            hint=_TREE_HINT if context.plan.vocabulary is Vocabulary.TREE else "",
            scenario=context.scenario(
                ALWAYS_GIVES_UP.code, give_up_claim(), Statement.UNHANDLED_FAILURE
            ),
        )


ALWAYS_GIVES_UP = Rule(
    code="GP305",
    name="always-gives-up",
    severity=Severity.ERROR,
    summary="Every run of the plan gives up.",
    why=(
        "Under the options of the check, an unhandled failure is certain, so the plan never "
        "completes and a new one always has to be generated."
    ),
    fix="add a recovery after the runner that must fail, or drop the assumption that makes it fail",
    bad=plan(go(9.0, 9.0), say("Delivered.")),
    good=plan(go(9.0, 9.0), control("recovery", go(8.0, 8.0)), say("Delivered.")),
    options=("--assume", "WaypointRunner(x=9.0) always fails"),
    find=_find_always_gives_up,
)


def _find_stuck(context: Context) -> Iterator[Finding]:
    """At most one, unless waiting joins (GP303) are the only reason."""
    stuck, _, _ = context.answers["stuck"] or (Frequency.UNKNOWN,) * 3
    if stuck not in (Frequency.SOMETIMES, Frequency.ALWAYS):
        return
    blocks = [waiting.deadlock.block for waiting in context.waiting]
    claim = stuck_claim(tuple(context.automaton.blocks[block] for block in blocks))
    if blocks and not context.possible(claim):
        return
    how = "gets stuck in every scenario" if stuck is Frequency.ALWAYS else "can get stuck"
    yield STUCK.finding(
        f"this {context.terms.whole} {how}: it neither completes nor {context.terms.gives_up}, "
        "and nothing more can happen",
        context.plan.location(0),
        scenario=context.scenario(STUCK.code, claim, Statement.STUCK),
    )


STUCK = Rule(
    code="GP306",
    name="stuck",
    severity=Severity.ERROR,
    summary="Some run neither completes nor gives up.",
    why=(
        "A stuck robot does nothing and reports nothing. No plan can get stuck without faults; "
        "it can if runners hang or do not start."
    ),
    fix=(
        "make whatever hangs fail after some time (gpsfsm run --timeout, or a time limit in the "
        "runner itself), then check without that fault"
    ),
    bad=plan(go(1.0, 2.0), look("Is the shelf full?")),
    good=plan(go(1.0, 2.0), go(3.0, 2.0)),
    options=("--faults", "hang", "--assume", "WaypointRunner never hangs"),
    find=_find_stuck,
)


RULES = (
    UNREACHABLE,
    NEVER_COMPLETES,
    ALWAYS_GIVES_UP,
    STUCK,
)
