"""GP503: a plan that can take more energy than there is."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.excess import thirsty_claim
from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import plan, wait
from gpsfsm.analysis.timing.amounts import UNBOUNDED, Amounts, energies
from gpsfsm.analysis.words import listed
from gpsfsm.model.finding import Finding, Scenario, Severity

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context

__all__ = ["RULE"]

_HINT = "give the runners that take energy a greatest energy in a capability file"


def find(context: Context) -> Iterator[Finding]:
    """At most one, and only if a limit is given."""
    limit = context.options.energy_limit_j
    if limit is None:
        return
    amounts = energies(context.compiled)
    found = context.answers["energy"]
    if found is None:
        message = _unknown(context, amounts, limit)
    else:
        message = _message(context, amounts, found, limit)
    if message:
        unbounded = found is None or found[1] is None
        yield RULE.finding(
            message,
            context.plan.location(0),
            hint=_HINT if unbounded else "",
            scenario=None if found is None else _scenario(context, amounts, limit),
        )


def _message(
    context: Context, amounts: Amounts | None, found: tuple[float, float | None], limit: float
) -> str:
    """What is wrong, "" if nothing is."""
    least, most = found
    if least > limit:
        range_ = f"at least {least:.6g} J" if most is None else f"{least:.6g} J to {most:.6g} J"
        return f"every run of this plan takes more energy than the limit of {limit:.6g} J: {range_}"
    if most is None:
        names = [
            context.place(context.runner(number))
            for number in (() if amounts is None else amounts.declared)
            if amounts is not None
            and amounts.ranges[number][1] == UNBOUNDED
            and context.reached[context.unit_of_runner[number]]
        ]
        return (
            f"nothing guarantees the energy limit of {limit:.6g} J: this plan takes at least "
            f"{least:.6g} J, and no capability tells how much these take at most: {listed(names)}"
        )
    if most > limit:
        return (
            f"this plan can take more energy than the limit of {limit:.6g} J: "
            f"{least:.6g} J to {most:.6g} J"
        )
    return ""


def _unknown(context: Context, amounts: Amounts | None, limit: float) -> str:
    """Why there is no answer; "" if it was not decided, or if no runner is ever triggered."""
    reached = [context.reached[unit] for unit in context.unit_of_runner]
    if amounts is not None and any(reached[number] for number in amounts.declared):
        return ""  # z3 reached its limit, which is told as GP904
    if not any(reached):
        return ""
    return (
        f"nothing guarantees the energy limit of {limit:.6g} J: no capability tells how much "
        "energy the runners of this plan take"
    )


def _scenario(context: Context, amounts: Amounts | None, limit: float) -> Scenario | None:
    found = None if amounts is None else thirsty_claim(context, amounts, limit)
    if amounts is None or found is None:
        return None
    claim, taken = found
    most = amounts.amount(taken)
    closing = (
        "nobody knows how much energy that takes"
        if most is None
        else f"that takes up to {most:.6g} J"
    )
    return context.scenario(RULE.code, claim, (closing,))


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
