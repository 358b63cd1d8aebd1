"""GP503: a plan that can take more energy than there is."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.rules.base import Rule, plan, wait
from gpsfsm.analysis.rules.limits import Limit, excess, thirsty_claim
from gpsfsm.analysis.timing.amounts import energies
from gpsfsm.model.finding import Finding, Scenario, Severity
from gpsfsm.model.story import Sentence, Statement

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context
    from gpsfsm.analysis.timing.amounts import Amounts

_HINT = "give the runners that take energy a greatest energy in a capability file"


def find(context: Context) -> Iterator[Finding]:
    """At most one, and only if a limit is given."""
    if context.options.energy_limit_j is None:
        return
    limit = Limit(
        most=context.options.energy_limit_j,
        unit="J",
        name="energy limit",
        beyond="more energy than the limit",
        how="how much",
        hint=_HINT,
    )
    amounts = energies(context.compiled)
    yield from excess(
        RULE,
        context,
        limit,
        amounts,
        context.answers["energy"],
        unknown=lambda: _unknown(context, amounts, limit),
        scenario=lambda declared: _scenario(context, declared, limit.most),
    )


def _unknown(context: Context, amounts: Amounts | None, limit: Limit) -> str:
    """The reason for no answer; "" if it was not decided, or if no runner is ever triggered."""
    reached = [context.reached[unit] for unit in context.unit_of_runner]
    if amounts is not None and any(reached[number] for number in amounts.declared):
        return ""  # z3 reached its limit, which is told as GP904
    if not any(reached):
        return ""
    return (
        f"{limit.unguaranteed}: no capability tells how much energy the runners of this "
        f"{context.terms.whole} take"
    )


def _scenario(context: Context, amounts: Amounts, limit: float) -> Scenario | None:
    greedy = thirsty_claim(context, amounts, limit)
    if greedy is None:
        return None
    claim, taken = greedy
    most = amounts.amount(taken)
    if most is None:
        return context.scenario(RULE.code, claim, Statement.TAKES_ANY_ENERGY)
    closing = Sentence(Statement.TAKES_ENERGY, arguments=(f"{most:.6g}",))
    return context.scenario(RULE.code, claim, closing)


RULE = Rule(
    code="GP503",
    name="energy-exceeded",
    severity=Severity.ERROR,
    summary="The plan can take more energy than the limit that was given.",
    why=(
        "With `--energy-limit` every run has to make do with that much. All runners count that a "
        "run triggers, also those that it leaves behind. How much they take is declared in "
        "capability files; what declares nothing counts as taking nothing, but if no runner of "
        "the plan declares anything, nothing is guaranteed."
    ),
    fix="leave steps out, or allow for more energy",
    bad=plan(wait(40)),
    good="<Plan/>\n",
    options=("--energy-limit", "100"),
    find=find,
)
