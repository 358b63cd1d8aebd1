"""GP210: runners of which nothing is known."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.rules.base import Rule, go, plan
from gpsfsm.analysis.rules.names import Names, Status, quoted, survey
from gpsfsm.analysis.words import listed
from gpsfsm.model.finding import Severity

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context
    from gpsfsm.model.finding import Finding

_MAX_RELATED = 5


def find(context: Context) -> Iterator[Finding]:
    """One finding for the whole plan, at the first such runner."""
    first: dict[str, int] = {}
    for (interface, _), numbers in survey(context)[Status.UNDESCRIBED].items():
        first.setdefault(interface, numbers[0])
    if not first:
        return
    (interface, number), *rest = first.items()
    meant = Names(context.capabilities.library).namesakes(interface)
    other = f"; if {quoted(meant[0])} is meant, write that" if meant else ""
    names = listed([quoted(name) for name in first])
    yield RULE.finding(
        f"no file tells what {names} {'need' if rest else 'needs'}, "
        f"{'give and do' if rest else 'gives and does'}, so none of that is checked",
        context.plan.location(context.runner(number)),
        hint=RULE.fix + other,
        related=tuple(
            context.related(context.runner(number), quoted(name))
            for name, number in rest[:_MAX_RELATED]
        ),
    )


RULE = Rule(
    code="GP210",
    name="undescribed-runner",
    severity=Severity.INFO,
    summary="No capability file describes a runner.",
    why=(
        "What a runner needs, gives and occupies is not in the plan. Of a runner that no file "
        "describes nothing is assumed, and the rules about parameters, data flow, resources and "
        "time say nothing about it."
    ),
    fix="name the folder of the robot's capability files with --capabilities DIR",
    bad=plan(
        go(2.0, -0.5), '<Runner interface="lift_bot/LiftRunner" provider="lift_bot/LiftRunner"/>'
    ),
    good=plan(go(2.0, -0.5)),
    find=find,
)
