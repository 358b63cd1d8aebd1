"""Rules on resources, time and energy."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.decisions.overlaps import overlap_claim
from gpsfsm.analysis.rules.base import Rule, control, go, look, plan, wait
from gpsfsm.analysis.rules.limits import Limit, endless, excess, late_claim, thirsty_claim
from gpsfsm.analysis.timing.amounts import durations, energies
from gpsfsm.compile import UnitKind
from gpsfsm.model.event import End, Outcome
from gpsfsm.model.finding import Finding, Scenario, Severity
from gpsfsm.model.printable import clip
from gpsfsm.model.report import Frequency
from gpsfsm.model.story import Sentence, Statement

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context
    from gpsfsm.analysis.timing.amounts import Amounts


_MAX_NAME = 60
_LEFT_ALL = (
    "give each unit a recovery of its own, or let the recovery wait until the others are done: "
    "nothing stops the units beside one that has failed"
)
_LEFT = (
    "use a recovery if the second unit is only an alternative, or parallel_all if the plan has to "
    "wait for all: nothing stops the units that a parallel control leaves behind"
)


def _find_resource_overlap(context: Context) -> Iterator[Finding]:
    """One finding per parallel control and resource, with the first pair."""
    units = context.units
    for overlap in context.answers["overlaps"] or ():
        first, second = context.runner(overlap.first), context.runner(overlap.second)
        inside = overlap.second in context.runners_in(overlap.block)
        block = context.plan.elements[units.elements[overlap.block]]
        resource = clip(overlap.resource, _MAX_NAME)
        if inside:
            message = (
                f"{context.place(first)} and {context.place(second)} can be active at the same "
                f"time, but both need exclusive use of the {resource}"
            )
        else:
            message = (
                f"{context.place(first)} can still be active when {context.place(second)} starts, "
                f"but both need exclusive use of the {resource}"
            )
        yield RESOURCE_OVERLAP.finding(
            message,
            context.plan.location(block),
            hint=""
            if inside
            else _LEFT
            if units.kinds[overlap.block] is UnitKind.ANY
            else _LEFT_ALL,
            related=(
                context.related(first, f"uses the {resource}"),
                context.related(second, f"uses the {resource}"),
            ),
            scenario=context.scenario(
                RESOURCE_OVERLAP.code,
                overlap_claim(context.clock, overlap.first, overlap.second),
                Sentence(Statement.HELD_TWICE, arguments=(resource,)),
            ),
        )


RESOURCE_OVERLAP = Rule(
    code="GP501",
    name="resource-overlap",
    severity=Severity.ERROR,
    summary="Two runners can use the same exclusive resource at the same time.",
    why=(
        "A robot has one base, one speaker, one microphone. A second goal cancels the first "
        "one, which then fails; two speeches at once are noise. Runners that a parallel_any "
        "leaves active count too: nothing stops them."
    ),
    fix="run the two one after the other",
    bad=plan(control("parallel_all", go(1.0, 2.0), go(3.0, 4.0))),
    good=plan(go(1.0, 2.0), control("parallel_all", go(3.0, 4.0), look("Is the door open?"))),
    find=_find_resource_overlap,
)


def _find_deadline(context: Context) -> Iterator[Finding]:
    """At most one, and only if a deadline is given."""
    if context.options.deadline_s is None:
        return
    terms = context.terms
    actions = sum(context.reached[unit] for unit in context.unit_of_runner)
    limit = Limit(
        most=context.options.deadline_s,
        unit="s",
        name="deadline",
        beyond="longer than the deadline",
        bound="maximum duration",
        hint=(
            "declare a maximum duration for these runners in a capability file, or run them beside "
            f"a WaitRunner in a {terms.parallel_any} if the {terms.whole} may continue without them"
        ),
        allowance=context.options.allowance_s * (1 + actions),
        reason=(
            f"for the overhead of a real run of up to {actions:,} "
            f"action{'' if actions == 1 else 's'} (a deadline applies to declared durations, not "
            "to a loaded machine)"
        ),
    )
    amounts = durations(context.compiled)
    yield from excess(
        DEADLINE,
        context,
        limit,
        amounts,
        context.answers["makespan"],
        unknown=lambda: _deadline_unknown(context, amounts, limit),
        scenario=lambda declared: _deadline_scenario(
            context, declared, max(0.0, limit.most - limit.allowance)
        ),
    )


def _deadline_unknown(context: Context, amounts: Amounts | None, limit: Limit) -> str:
    """The reason for no makespan; "" if it was not decided, or if the plan takes no time."""
    completion = context.answers["completion"]
    if completion is not None and completion[0] is completion[1] is Frequency.NEVER:
        this = f"this {context.terms.whole}"
        return f"no run of {this} ends, so none meets the deadline of {limit.said(limit.most)}"
    unit_of = context.unit_of_runner
    if amounts is not None and any(context.reached[unit_of[n]] for n in amounts.declared):
        return ""  # z3 reached its limit, which is told as GP904
    everything = range(len(context.plan.runners))
    at_once = context.deciders.evaluator.run(lambda _: Outcome.SUCCEEDED, withheld=everything)
    if at_once.ends is not End.STUCK:
        return ""
    return f"{limit.unguaranteed}: {endless(context, limit, amounts)}"


def _deadline_scenario(context: Context, amounts: Amounts, deadline: float) -> Scenario | None:
    late = late_claim(context, amounts, deadline)
    if late is None:
        return None
    claim, end = late
    most = amounts.amount(end)
    completes = claim.ends is End.COMPLETED
    if most is None:
        closing = Statement.COMPLETES_SOMETIME if completes else Statement.GIVES_UP_SOMETIME
        return context.scenario(DEADLINE.code, claim, closing)
    closing = Statement.COMPLETES_BY if completes else Statement.GIVES_UP_BY
    return context.scenario(DEADLINE.code, claim, Sentence(closing, arguments=(f"{most:.6g}",)))


DEADLINE = Rule(
    code="GP502",
    name="deadline-exceeded",
    severity=Severity.ERROR,
    summary="The plan can exceed its deadline.",
    why=(
        "With `--deadline` every run must complete or give up in time. Capability files "
        "declare how long runners take; a runner without a declared maximum may take any "
        "amount of time. GP306 reports runs that get stuck and never end; this rule does so only "
        "if no run ends at all. `gpsfsm check` uses the declared durations as they are; `gpsfsm "
        "gate` adds ten milliseconds for the start of the run and for each action, the overhead "
        "of a real run. A deadline applies to declared durations, not to a loaded machine."
    ),
    fix="shorten the plan, or allow more time",
    bad=plan(wait(40), control("parallel_all", wait(30), wait(20))),
    good=plan(wait(30), control("parallel_all", wait(30), wait(20))),
    options=("--deadline", "60"),
    find=_find_deadline,
)


_HINT = "declare the maximum energy of these runners in a capability file (energy: {max: …})"


def _find_energy_limit(context: Context) -> Iterator[Finding]:
    """At most one, and only if a limit is given."""
    if context.options.energy_limit_j is None:
        return
    limit = Limit(
        most=context.options.energy_limit_j,
        unit="J",
        name="energy limit",
        beyond="more energy than the limit",
        bound="maximum energy",
        hint=_HINT,
    )
    amounts = energies(context.compiled)
    yield from excess(
        ENERGY_LIMIT,
        context,
        limit,
        amounts,
        context.answers["energy"],
        unknown=lambda: _energy_limit_unknown(context, amounts, limit),
        scenario=lambda declared: _energy_limit_scenario(context, declared, limit.most),
    )


def _energy_limit_unknown(context: Context, amounts: Amounts | None, limit: Limit) -> str:
    """The reason for no answer; "" if it was not decided, or if no runner is ever triggered."""
    reached = [context.reached[unit] for unit in context.unit_of_runner]
    if amounts is not None and any(reached[number] for number in amounts.declared):
        return ""  # z3 reached its limit, which is told as GP904
    if not any(reached):
        return ""
    return (
        f"{limit.unguaranteed}: no capability file declares how much energy the runners of this "
        f"{context.terms.whole} take"
    )


def _energy_limit_scenario(context: Context, amounts: Amounts, limit: float) -> Scenario | None:
    greedy = thirsty_claim(context, amounts, limit)
    if greedy is None:
        return None
    claim, taken = greedy
    most = amounts.amount(taken)
    if most is None:
        return context.scenario(ENERGY_LIMIT.code, claim, Statement.TAKES_ANY_ENERGY)
    closing = Sentence(Statement.TAKES_ENERGY, arguments=(f"{most:.6g}",))
    return context.scenario(ENERGY_LIMIT.code, claim, closing)


ENERGY_LIMIT = Rule(
    code="GP503",
    name="energy-exceeded",
    severity=Severity.ERROR,
    summary="The plan can exceed its energy limit.",
    why=(
        "With `--energy-limit` no run may take more energy than that. All runners that a run "
        "triggers count, including those that it leaves active. Capability files declare how "
        "much they take; a runner without a declaration counts as zero, but if no runner of "
        "the plan has one, nothing is guaranteed."
    ),
    fix="remove steps, or allow more energy",
    bad=plan(wait(40)),
    good="<Plan/>\n",
    options=("--energy-limit", "100"),
    find=_find_energy_limit,
)


RULES = (
    RESOURCE_OVERLAP,
    DEADLINE,
    ENERGY_LIMIT,
)
