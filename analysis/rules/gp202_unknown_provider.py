"""GP202: a provider that does not exist, or that provides something else."""

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
    short,
    survey,
)
from gpsfsm.model.finding import Severity

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from gpsfsm.analysis.context import Context
    from gpsfsm.model.capability import Binding
    from gpsfsm.model.finding import Finding

_LENGTH = len("provider")


def find(context: Context) -> Iterator[Finding]:
    """One finding per pair of interface and provider, at the first runner that names it."""
    pairs = survey(context)
    names = Names(context.capabilities.library)
    for status in (Status.NO_PROVIDER, Status.NEAR_PROVIDER):
        for (interface, provider), numbers in pairs[status].items():
            yield _unknown(context, names, status, (interface, provider), numbers)
    yield from _mixed(context, pairs[Status.BOUND])


def _unknown(
    context: Context, names: Names, status: Status, pair: tuple[str, str], numbers: list[int]
) -> Finding:
    library = names.library
    interface, provider = pair
    here = library.translation(interface) or interface
    implementing = [quoted(each.name) for each in library.providers_of(here)]
    implemented = names.implements(provider)
    remark = f"; {either(implementing)} does" if implementing else ""
    severity = Severity.ERROR
    if implemented:
        what = f"{quoted(provider)} implements {quoted(implemented)}, not {quoted(here)}"
    elif status is Status.NO_PROVIDER:
        what = f"there is no provider {quoted(provider)}"
        remark = f"; {either(implementing)} implements {quoted(here)}" if implementing else ""
    else:
        severity = Severity.WARNING
        what = f"no file describes the provider {quoted(provider)}"
        remark = f"; did you mean {either(implementing)}?"
    return RULE.finding(
        f"{what}{remark}{more_runners(numbers)}",
        at(context, context.runner(numbers[0]), "provider"),
        severity=severity,
        hint=f"write {implementing[0]}" if implementing else _NOBODY,
        related=others(context, numbers, "provider"),
        length=_LENGTH,
    )


def _mixed(context: Context, bound: Mapping[tuple[str, str], list[int]]) -> Iterator[Finding]:
    """Interface and provider in two spellings of the same thing."""
    for (interface, provider), numbers in bound.items():
        binding = context.bindings[numbers[0]]
        if binding is None or not _two_spellings(binding, interface, provider):
            continue
        name, wanted = binding.interface.name, binding.provider.name
        yield RULE.finding(
            f"the interface is {quoted(interface)} and the provider {quoted(provider)}: these "
            f"are spellings of different dialects{more_runners(numbers)}",
            at(context, context.runner(numbers[0]), "provider"),
            severity=Severity.WARNING,
            hint=f"write {quoted(wanted)}" + (f" for {quoted(name)}" if name != wanted else ""),
            related=others(context, numbers, "provider"),
            length=_LENGTH,
        )


def _two_spellings(binding: Binding, interface: str, provider: str) -> bool:
    if interface == provider or short(interface) != short(provider):
        return False
    described = binding.interface
    spellings = {described.name, *described.formerly}
    return interface in spellings and provider in spellings


_NOBODY = "no provider of this interface is described; name one that is"

RULE = Rule(
    code="GP202",
    name="unknown-provider",
    severity=Severity.ERROR,
    summary="A runner names a provider that does not exist, or that implements something else.",
    why=(
        "The provider is what the executor starts. If it does not exist nothing starts, and if it "
        "implements another interface something else is started than the plan says."
    ),
    fix="name a provider that implements the interface",
    bad=plan(
        go(2.0, -0.5).replace(
            'provider="nav2_capabilities/WaypointRunner"',
            'provider="nav2_capabilities/RobotPoseRunner"',
        )
    ),
    good=plan(go(2.0, -0.5)),
    severities=(
        "error if the provider implements another interface, or does not exist; warning if only "
        "its package looks misspelt, or if interface and provider are spelt in different dialects"
    ),
    find=find,
)
