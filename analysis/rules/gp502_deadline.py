"""GP502: a plan that can take longer than the deadline."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.rules.base import Rule, control, plan, wait
from gpsfsm.analysis.rules.limits import Limit, endless, excess, late_claim
from gpsfsm.analysis.timing.amounts import durations
from gpsfsm.model.event import End, Outcome
from gpsfsm.model.finding import Finding, Scenario, Severity
from gpsfsm.model.report import Frequency
from gpsfsm.model.story import Sentence, Statement

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context
    from gpsfsm.analysis.timing.amounts import Amounts


def find(context: Context) -> Iterator[Finding]:
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
        how="how long",
        hint=(
            "give these runners a greatest duration in a capability file, or let them run beside a "
            f"WaitRunner in a {terms.parallel_any} if the {terms.whole} may go on without them"
        ),
        allowance=context.options.allowance_s * (1 + actions),
        reason=(
            f"are allowed for what a real run of up to {actions:,} "
            f"action{'' if actions == 1 else 's'} adds (a deadline holds for declared durations, "
            "not for a loaded machine)"
        ),
    )
    amounts = durations(context.compiled)
    yield from excess(
        RULE,
        context,
        limit,
        amounts,
        context.answers["makespan"],
        unknown=lambda: _unknown(context, amounts, limit),
        scenario=lambda declared: _scenario(
            context, declared, max(0.0, limit.most - limit.allowance)
        ),
    )


def _unknown(context: Context, amounts: Amounts | None, limit: Limit) -> str:
    """The reason for no makespan; "" if it was not decided, or if the plan takes no time."""
    completion = context.answers["completion"]
    if completion is not None and completion[0] is completion[1] is Frequency.NEVER:
        this = f"this {context.terms.whole}"
        return f"no run of {this} ends, so none keeps the deadline of {limit.said(limit.most)}"
    unit_of = context.unit_of_runner
    if amounts is not None and any(context.reached[unit_of[n]] for n in amounts.declared):
        return ""  # z3 reached its limit, which is told as GP904
    everything = range(len(context.plan.runners))
    at_once = context.deciders.evaluator.run(lambda _: Outcome.SUCCEEDED, withheld=everything)
    if at_once.ends is not End.STUCK:
        return ""
    return f"{limit.unguaranteed}: {endless(context, limit, amounts)}"


def _scenario(context: Context, amounts: Amounts, deadline: float) -> Scenario | None:
    late = late_claim(context, amounts, deadline)
    if late is None:
        return None
    claim, end = late
    most = amounts.amount(end)
    completes = claim.ends is End.COMPLETED
    if most is None:
        closing = Statement.COMPLETES_SOMETIME if completes else Statement.GIVES_UP_SOMETIME
        return context.scenario(RULE.code, claim, closing)
    closing = Statement.COMPLETES_BY if completes else Statement.GIVES_UP_BY
    return context.scenario(RULE.code, claim, Sentence(closing, arguments=(f"{most:.6g}",)))


RULE = Rule(
    code="GP502",
    name="deadline-exceeded",
    severity=Severity.ERROR,
    summary="The plan can take longer than the deadline that was given.",
    why=(
        "With `--deadline` the plan has to complete or give up in time in every run. How long its "
        "runners take is declared in capability files; whoever declares no greatest duration may "
        "take as long as it likes. A run that is stuck never ends; it is told by GP306, not here, "
        "unless no run ends at all. `gpsfsm check` takes the declared durations as they are; "
        "`gpsfsm gate` adds ten milliseconds for the beginning of the run and for each action, "
        "which a real run takes longer. A deadline holds for declared durations, not for a loaded "
        "machine."
    ),
    fix="shorten the plan, or allow for more time",
    bad=plan(wait(40), control("parallel_all", wait(30), wait(20))),
    good=plan(wait(30), control("parallel_all", wait(30), wait(20))),
    options=("--deadline", "60"),
    find=find,
)
