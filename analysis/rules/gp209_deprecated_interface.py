"""GP209: an interface or provider that should not be used any more."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.rules.base import Rule, go, plan
from gpsfsm.analysis.rules.names import at, more_runners, others, quoted
from gpsfsm.model.finding import Severity
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context
    from gpsfsm.capabilities.library import Library
    from gpsfsm.model.finding import Finding

_MAX_REASON = 200
_MULTIPLEX = "capabilities2_runner/InputMultiplexRunner"


def find(context: Context) -> Iterator[Finding]:
    """One finding per interface or provider, at the first runner that names it."""
    library = context.capabilities.library
    lookups: dict[tuple[str, str], tuple[str, str, str]] = {}
    groups: dict[tuple[str, str, str], list[int]] = {}
    for number, runner in enumerate(context.plan.runners):
        pair = runner.interface, runner.provider
        if pair not in lookups:
            binding = context.bindings[number]
            lookups[pair] = _deprecated(library, pair, binding.provider.name if binding else "")
        if lookups[pair][0]:
            groups.setdefault(lookups[pair], []).append(number)
    for (what, name, reason), numbers in groups.items():
        yield RULE.finding(
            f"the {what} {quoted(name)} is deprecated: {clip(reason, _MAX_REASON)}"
            f"{more_runners(numbers)}",
            at(context, context.runner(numbers[0]), what),
            related=others(context, numbers, what),
            length=len(what),
        )


def _deprecated(library: Library, pair: tuple[str, str], provider: str) -> tuple[str, str, str]:
    """Attribute, name and reason; empty if neither interface nor provider is deprecated."""
    interface = library.interface(library.translation(pair[0]) or pair[0])
    if interface is not None and interface.deprecated:
        return "interface", interface.name, interface.deprecated
    described = library.provider(provider) if provider else None
    if described is not None and described.deprecated:
        return "provider", described.name, described.deprecated
    return "", "", ""


RULE = Rule(
    code="GP209",
    name="deprecated-interface",
    severity=Severity.WARNING,
    summary="A runner names an interface or a provider that should not be used any more.",
    why="The capability file says so, and says why: see the message.",
    fix="do as the message says",
    bad=plan(go(2.0, -0.5), f'<Runner interface="{_MULTIPLEX}" provider="{_MULTIPLEX}"/>'),
    good=plan(go(2.0, -0.5)),
    find=find,
)
