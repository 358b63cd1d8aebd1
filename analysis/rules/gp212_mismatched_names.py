"""GP212: an interface that no file describes, with a provider of another interface."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.rules.base import Rule, go, plan
from gpsfsm.analysis.rules.names import (
    Names,
    Status,
    at,
    more_runners,
    others,
    quoted,
    survey,
)
from gpsfsm.model.finding import Severity

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context
    from gpsfsm.model.finding import Finding

_LENGTH = len("interface")


def find(context: Context) -> Iterator[Finding]:
    """One finding per pair of interface and provider, at the first runner that names it."""
    names = Names(context.capabilities.library)
    for (interface, provider), numbers in survey(context)[Status.FOREIGN].items():
        implemented = quoted(names.implements(provider))
        yield RULE.finding(
            f"no file describes the interface {quoted(interface)}, and its provider "
            f"{quoted(provider)} implements {implemented}{more_runners(numbers)}",
            at(context, context.runner(numbers[0]), "interface"),
            hint=f"write {implemented}, or name a provider of {quoted(interface)}",
            related=others(context, numbers, "interface"),
            length=_LENGTH,
        )


RULE = Rule(
    code="GP212",
    name="mismatched-names",
    severity=Severity.ERROR,
    summary="A runner names a provider with an interface that is unknown, and not the provider's.",
    why=(
        "The provider is what would be started, and the interface says what it is checked as. If "
        "the two do not belong together the robot would drive where the plan says that it speaks, "
        "and nothing about the drive would have been checked. A wrong letter, a blank or a letter "
        "of another alphabet is enough."
    ),
    fix="write the interface that the provider implements, or a provider of the interface",
    bad=plan(
        go(2.0, -0.5).replace('interface="nav2_capabilities/WaypointRunner"', 'interface="a/Say"')
    ),
    good=plan(go(2.0, -0.5)),
    find=find,
)
