"""GP206: a value that the parameter cannot have."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.rules.base import Rule, plan, wait
from gpsfsm.analysis.rules.names import (
    bound_parameters,
    either,
    is_placeholder,
    near,
    quoted,
    short,
    written,
)
from gpsfsm.model.capability import Parameter
from gpsfsm.model.finding import Severity
from gpsfsm.model.plan import Location

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.plan import Attribute


def find(context: Context) -> Iterator[Finding]:
    """One finding per attribute, where it stands."""
    for number, _, attribute, parameter in bound_parameters(context):
        if not isinstance(parameter, Parameter):
            continue
        bounds = _outside(attribute, parameter)
        chosen = bool(parameter.choices) and attribute.text not in parameter.choices
        if not bounds and (not chosen or is_placeholder(attribute)):
            continue
        runner = context.runner(number)
        allowed = bounds or either([quoted(choice) for choice in parameter.choices])
        yield RULE.finding(
            f"{written(attribute)} is not allowed: {short(runner.interface)} takes {allowed} there",
            Location(attribute.line, attribute.column, context.plan.path(runner)),
            hint="" if bounds else _hint(attribute, parameter),
            length=len(attribute.name),
        )


def _outside(attribute: Attribute, parameter: Parameter) -> str:
    """The bounds, if the value is a number outside of them."""
    value, least, greatest = attribute.value, parameter.minimum, parameter.maximum
    if isinstance(value, bool | str) or value != value:  # noqa: PLR0124  (a nan)
        return ""
    low, high = least is not None and value < least, greatest is not None and value > greatest
    if not low and not high:
        return ""
    if least is None:
        return f"at most {_said(greatest)}"
    return (
        f"at least {_said(least)}" if greatest is None else f"{_said(least)} to {_said(greatest)}"
    )


def _said(bound: float | None) -> str:
    """A bound as one writes it: 1000000000 and not 1e+09."""
    assert bound is not None
    return f"{bound:.0f}" if abs(bound) < 1e12 and bound == int(bound) else f"{bound:g}"


def _hint(attribute: Attribute, parameter: Parameter) -> str:
    meant = near(attribute.text, parameter.choices)
    return f"write {quoted(meant)}" if meant else ""


RULE = Rule(
    code="GP206",
    name="parameter-out-of-range",
    severity=Severity.ERROR,
    summary="The value of a parameter lies outside of what its provider allows.",
    why=(
        "The capability file says which values there are. With another one the runner fails, or "
        "does something that nobody has thought of."
    ),
    fix="write a value that is allowed",
    bad=plan(wait(-5.0)),
    good=plan(wait(5.0)),
    find=find,
)
