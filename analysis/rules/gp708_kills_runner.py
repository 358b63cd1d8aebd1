"""GP708: an attribute whose spelling makes a runner of the engine throw."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.rules.base import Rule, plan, runner
from gpsfsm.model.capability import ValueType
from gpsfsm.model.engine import OptionType
from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.plan import Location
from gpsfsm.model.printable import printable

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.on_engine import OnEngine
    from gpsfsm.model.capability import Binding
    from gpsfsm.model.engine import Parameter

_EXPECTED = {
    ValueType.DOUBLE: OptionType.DOUBLE,
    ValueType.INT: OptionType.INT,
    ValueType.STRING: OptionType.STRING,
    ValueType.BOOL: OptionType.BOOL,
}
_WORDS = {
    OptionType.BOOL: "a Boolean",
    OptionType.DOUBLE: "a double",
    OptionType.INT: "an integer",
    OptionType.STRING: "a string",
}


def find(engine: OnEngine) -> Iterator[Finding]:
    """One finding per attribute that is read as another type than the runner casts it to."""
    context = engine.context
    for number, binding in enumerate(context.compiled.bindings):
        if binding is None:
            continue
        for parameter in engine.parameters[number]:
            expected = _expected(binding, parameter)
            if expected in (None, parameter.type) or parameter.type not in _WORDS:
                continue
            if _replaced(engine, number, parameter.name):
                continue
            assert expected is not None
            yield _finding(engine, number, parameter, expected)


def _expected(binding: Binding, parameter: Parameter) -> OptionType | None:
    declared = binding.provider.parameter(parameter.name)
    return None if declared is None else _EXPECTED.get(declared.type)


def _replaced(engine: OnEngine, number: int, name: str) -> bool:
    """True if the value never reaches the runner: what triggers it hands over another one."""
    trigger = engine.trigger(number)
    runners = len(engine.context.plan.runners)
    if trigger is None or not 0 < trigger.node <= runners:
        return False
    source = engine.context.compiled.bindings[trigger.node - 1]
    return source is not None and any(
        output.name == name and output.event is trigger.event and not output.optional
        for output in source.provider.outputs
    )


def _finding(engine: OnEngine, number: int, parameter: Parameter, expected: OptionType) -> Finding:
    context = engine.context
    element = context.runner(number)
    attribute = next(each for each in element.attributes if each.name == parameter.name)
    text = printable(attribute.text)
    return RULE.finding(
        f'{engine.name} reads {parameter.name}="{text}" as {_WORDS[parameter.type]}, where '
        f"{context.place(element)} takes {_WORDS[expected]} only: "
        "the server dies when this runner starts",
        Location(attribute.line, attribute.column, context.plan.path(element)),
        hint=_hint(parameter, attribute.text, expected),
        length=len(parameter.name),
    )


def _hint(parameter: Parameter, text: str, expected: OptionType) -> str:
    """The same value, written so that the engine reads the type."""
    number = parameter.type in (OptionType.INT, OptionType.DOUBLE)
    if expected is OptionType.DOUBLE and parameter.type is OptionType.INT:
        return f'write {parameter.name}="{float(int(parameter.value)):.1f}"'
    if expected is OptionType.INT and number and float(parameter.value).is_integer():
        return f'write {parameter.name}="{int(parameter.value)}"'
    if expected is OptionType.STRING:
        return (
            f'write {parameter.name}="{printable(text)} ", with a blank behind it: no number and '
            "no Boolean ends with a blank"
        )
    if expected is OptionType.BOOL:
        return "write true or false, in small letters"
    return f"give {_WORDS[expected]}"


RULE = Rule(
    code="GP708",
    name="kills-runner",
    severity=Severity.ERROR,
    summary="An attribute is written so that the engine reads a type that kills the runner.",
    why=(
        "fabric-v2 guesses the type of an attribute from its text, and its runners cast the value "
        "strictly: an integer where a double is expected ends the process of the server. 1.0 is a "
        "double, 1 is not."
    ),
    fix="write the value so that the engine reads the type that the runner expects",
    bad=plan(runner("nav2_capabilities/WaypointRunner", x="1", y="2.0")),
    good=plan(runner("nav2_capabilities/WaypointRunner", x="1.0", y="2.0")),
    options=("--engine", "fabric-v2"),
    find_on_engine=find,
)
