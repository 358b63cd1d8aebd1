"""What the rules about limits on a whole plan share: how a plan that keeps none is told."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.analysis.timing.amounts import UNBOUNDED
from gpsfsm.analysis.words import listed

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from gpsfsm.analysis.context import Context
    from gpsfsm.analysis.rules.base import Rule
    from gpsfsm.analysis.timing.amounts import Amounts
    from gpsfsm.model.finding import Finding, Scenario

__all__ = ["Limit", "endless", "excess"]


@dataclass(frozen=True, slots=True)
class Limit:
    """What a run may take at most, and how that is said.

    ``name`` is what users call it, ``beyond`` what takes more, such as ``longer than the
    deadline``; ``how`` asks for an amount: ``how long``. ``hint`` says what to declare where
    nothing bounds the plan. ``allowance`` is what comes on top of the greatest amount, and
    ``reason`` what it is for.
    """

    most: float
    unit: str
    name: str
    beyond: str
    how: str
    hint: str
    allowance: float = 0.0
    reason: str = ""

    def said(self, amount: float) -> str:
        """An amount with its unit."""
        return f"{amount:.6g} {self.unit}"

    @property
    def unguaranteed(self) -> str:
        """How a message begins where nothing bounds what the plan takes."""
        return f"nothing guarantees the {self.name} of {self.said(self.most)}"


def excess(
    rule: Rule,
    context: Context,
    limit: Limit,
    amounts: Amounts | None,
    found: tuple[float, float | None] | None,
    *,
    unknown: Callable[[], str],
    scenario: Callable[[Amounts], Scenario | None],
) -> Iterator[Finding]:
    """At most one finding: that a run can take more than the limit.

    ``found`` is what the plan takes at least and at most. Where that is not known, ``unknown``
    says why, "" if there is nothing to say.
    """
    message = unknown() if found is None else _message(context, limit, amounts, found)
    if message:
        unbounded = found is None or found[1] is None
        yield rule.finding(
            message,
            context.plan.location(0),
            hint=limit.hint if unbounded else "",
            scenario=None if found is None or amounts is None else scenario(amounts),
        )


def _message(
    context: Context, limit: Limit, amounts: Amounts | None, found: tuple[float, float | None]
) -> str:
    """What is wrong, "" if nothing is."""
    least, most = found
    at_least, over = limit.said(least), f"{limit.beyond} of {limit.said(limit.most)}"
    if least > limit.most:
        range_ = f"at least {at_least}" if most is None else f"{at_least} to {limit.said(most)}"
        return f"every run of this plan takes {over}: {range_}"
    if most is None:
        return (
            f"{limit.unguaranteed}: this plan takes at least {at_least}, and "
            f"{endless(context, limit, amounts)}"
        )
    if most > limit.most:
        return f"this plan can take {over}: {at_least} to {limit.said(most)}"
    if most > limit.most - limit.allowance:
        return (
            f"this plan can take {over}: {at_least} to {limit.said(most)} as declared, and "
            f"{limit.said(limit.allowance)} {limit.reason}"
        )
    return ""


def endless(context: Context, limit: Limit, amounts: Amounts | None) -> str:
    """Which runners may take any amount."""
    unit_of = context.unit_of_runner
    names = [
        context.place(runner)
        for number, runner in enumerate(context.plan.runners)
        if (amounts is None or amounts.ranges[number][1] == UNBOUNDED)
        and context.reached[unit_of[number]]
    ]
    return f"no capability tells {limit.how} these take at most: {listed(names)}"
