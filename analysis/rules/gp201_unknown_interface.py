"""GP201: an interface that does not exist."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.rules.base import Rule, go, plan
from gpsfsm.analysis.rules.names import (
    Names,
    Status,
    at,
    either,
    more_runners,
    others,
    quoted,
    survey,
)
from gpsfsm.capabilities.library import namespace
from gpsfsm.model.finding import Severity

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context
    from gpsfsm.capabilities.library import Library
    from gpsfsm.model.finding import Finding

_LENGTH = len("interface")


def find(context: Context) -> Iterator[Finding]:
    """One finding per interface, at the first runner that names it."""
    pairs = survey(context)
    groups: dict[tuple[Status, str], list[int]] = {}
    for status in (Status.NO_INTERFACE, Status.NEAR_INTERFACE):
        for (interface, _), numbers in pairs[status].items():
            groups.setdefault((status, interface), []).extend(numbers)
    names = Names(context.capabilities.library)
    for (status, interface), numbers in groups.items():
        numbers.sort()
        yield _finding(context, names, status, interface, numbers)


def _finding(
    context: Context, names: Names, status: Status, interface: str, numbers: list[int]
) -> Finding:
    implemented = names.implements(interface)
    nearest = [quoted(implemented)] if implemented else _near(names, interface)
    meant = f"; did you mean {either(nearest)}?" if nearest else ""
    if implemented:
        meant = f"; that is a provider of {quoted(implemented)}"
    more = more_runners(numbers)
    if status is Status.NO_INTERFACE:
        message = f"there is no interface {quoted(interface)}{more}{meant}"
        severity = Severity.ERROR
    else:
        message = f"no file describes the interface {quoted(interface)}{more}{meant}"
        severity = Severity.WARNING
    return RULE.finding(
        message,
        at(context, context.runner(numbers[0]), "interface"),
        severity=severity,
        hint=f"write {nearest[0]}" if nearest else _packages(names.library, interface),
        related=others(context, numbers, "interface"),
        length=_LENGTH,
    )


def _near(names: Names, interface: str) -> list[str]:
    return [quoted(name) for name in names.interfaces_near(interface)]


def _packages(library: Library, interface: str) -> str:
    """The names that there are instead."""
    package = namespace(interface)
    same = [name for name in library.interface_names if namespace(name) == package]
    if package and same:
        return f"{quoted(package)} has {', '.join(same[:5])}{', …' if len(same) > 5 else ''}"
    return "'gpsfsm capabilities list' shows the interfaces that there are"


RULE = Rule(
    code="GP201",
    name="unknown-interface",
    severity=Severity.ERROR,
    summary="A runner names an interface that does not exist.",
    why=(
        "The executor looks the interface up before the first step and finds nothing, so the plan "
        "does not even start. Language models often put the right runner into the wrong package."
    ),
    fix="write the interface as the capability files name it",
    bad=plan(go(2.0, -0.5).replace("nav2_capabilities/", "perception_capabilities/")),
    good=plan(go(2.0, -0.5)),
    severities=(
        "error if the name is misspelt or in the wrong package, or if the capability files are "
        "known to be complete; warning if they describe the package but not this runner, or if "
        "the package's name is nearly that of one that has such a runner"
    ),
    find=find,
)
