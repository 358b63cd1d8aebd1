"""GP203: an attribute that the provider does not know."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.rules.base import Rule, go, plan
from gpsfsm.analysis.rules.names import is_label, near, quoted, short
from gpsfsm.analysis.words import listed
from gpsfsm.model.capability import Source
from gpsfsm.model.finding import Severity
from gpsfsm.model.plan import Location

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context
    from gpsfsm.model.capability import Binding, Input, Parameter, Provider
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.plan import Attribute, Element

_MAX_LOOKUPS = 500  # near names take time, and hostile plans are full of unknown ones


def find(context: Context) -> Iterator[Finding]:
    """One finding per attribute, where it stands."""
    lookups: dict[tuple[str, tuple[str, ...], str], str] = {}
    for number, binding in enumerate(context.bindings):
        if binding is None:
            continue
        runner = context.runner(number)
        missing: list[str] | None = None
        for attribute in runner.attributes:
            if not _unknown(binding.provider, attribute.name):
                twice = _twice(binding, attribute)
                if twice:
                    yield _second(context, runner, attribute, twice)
                continue
            if missing is None:
                missing = _missing(binding)
            key = binding.provider.name, tuple(missing), attribute.name
            if key not in lookups and len(lookups) < _MAX_LOOKUPS:
                words = _words(binding.provider, missing)
                lookups[key] = words.get(near(attribute.name, list(words)), "")
            meant = lookups.get(key, "")
            yield _finding(context, runner, attribute, binding, meant, needed=meant in missing)


def _unknown(provider: Provider, name: str) -> bool:
    return not is_label(name) and provider.parameter(name) is None and provider.input(name) is None


def _twice(binding: Binding, attribute: Attribute) -> str:
    """The attribute that is read instead of this one, which is another name for it; else ""."""
    parameter = binding.provider.parameter(attribute.name)
    first = binding.written.get(parameter.name) if parameter else None
    return "" if first is None or first is attribute else first.name


def _second(context: Context, runner: Element, attribute: Attribute, read: str) -> Finding:
    who, what = short(runner.interface), quoted(attribute.name)
    return RULE.finding(
        f"{quoted(read)} and {what} are one parameter of {who}: what {what} says is ignored",
        Location(attribute.line, attribute.column, context.plan.path(runner)),
        hint=f"remove {what}",
        length=len(attribute.name),
    )


def _finding(
    context: Context,
    runner: Element,
    attribute: Attribute,
    binding: Binding,
    meant: str,
    *,
    needed: bool,
) -> Finding:
    who, what = short(runner.interface) or runner.interface, quoted(attribute.name)
    if needed and meant in _takes(binding.provider):
        message = f"{who} has no parameter {what}, but it needs {quoted(meant)}"
    else:
        message = f"{who} has no parameter {what}: what is written there is ignored"
    names = _takes(binding.provider)
    if meant in names:
        hint = f"write {quoted(meant)} instead"
    elif meant:
        hint = f"remove it: {quoted(meant)} can only come from the step right before this one"
    elif names:
        hint = f"it takes {listed([quoted(name) for name in names], most=8)}"
    else:
        hint = "remove it: this runner takes no parameters"
    return RULE.finding(
        message,
        Location(attribute.line, attribute.column, context.plan.path(runner)),
        hint=hint,
        length=len(attribute.name),
    )


def _missing(binding: Binding) -> list[str]:
    """The names for which the plan should write something and does not."""
    provider = binding.provider
    declared: list[Parameter | Input] = [*provider.configuration, *provider.inputs]
    needed = {each.name for each in declared if each.required and each.default is None}
    return [name for name in _takes(provider) if name in needed and name not in binding.written]


def _takes(provider: Provider) -> list[str]:
    """The names under which a plan may write something."""
    names = [parameter.name for parameter in provider.configuration]
    names += [
        expected.name
        for expected in provider.inputs
        if set(expected.satisfiable_from) & {Source.CONFIGURATION, Source.EXTERNAL}
    ]
    return list(dict.fromkeys(names))


def _words(provider: Provider, missing: list[str]) -> dict[str, str]:
    """From words that a plan may have meant to names; what is missing first."""
    declared: list[Parameter | Input] = [*provider.configuration, *provider.inputs]
    words = {name: name for name in [*missing, *(parameter.name for parameter in declared)]}
    for parameter in declared:
        for alias in (*parameter.aliases, parameter.semantic_key.rpartition(".")[2]):
            words.setdefault(alias, parameter.name)
    words.pop("", None)
    return words


RULE = Rule(
    code="GP203",
    name="unknown-parameter",
    severity=Severity.WARNING,
    summary="A runner is given a parameter that its provider does not know.",
    why=(
        "The engines ignore it silently: the runner does something else than the plan says, with "
        "a default in place of the value. Often it is a misspelt name, or one that another runner "
        "has."
    ),
    fix="write the name as the capability file has it, or remove the attribute",
    bad=plan(go(2.0, -0.5).replace("/>", ' speed="0.3"/>')),
    good=plan(go(2.0, -0.5).replace("/>", ' name="the door"/>')),
    find=find,
)
