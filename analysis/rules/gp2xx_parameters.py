"""Rules on parameters: unknown, missing, mistyped, out of range, never filled in."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

from gpsfsm.analysis.flow import Placeholder, placeholder
from gpsfsm.analysis.rules.base import Rule, go, look, plan, say, wait
from gpsfsm.analysis.rules.names import (
    bound_parameters,
    either,
    expected_type,
    is_label,
    is_placeholder,
    near,
    quoted,
    short,
    written,
)
from gpsfsm.analysis.words import listed
from gpsfsm.late import pattern
from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.capability import Parameter, Source, ValueType
from gpsfsm.model.finding import Confidence, Severity
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from gpsfsm.analysis.context import Context
    from gpsfsm.analysis.decisions.data_flow import DataFlow, Overwritten
    from gpsfsm.model.capability import Binding, Input, Provider
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.plan import Attribute, Element, Value


_MAX_LOOKUPS = 500  # near names take time, and hostile plans are full of unknown ones


def _find_unknown_parameter(context: Context) -> Iterator[Finding]:
    """One finding per attribute, where it stands."""
    lookups: dict[tuple[str, tuple[str, ...], str], str] = {}
    for number, binding in enumerate(context.bindings):
        if binding is None:
            continue
        runner = context.runner(number)
        missing: list[str] | None = None
        for attribute in runner.attributes:
            if not _is_unknown(binding.provider, attribute.name):
                twice = _read_instead(binding, attribute)
                if twice:
                    yield _second_spelling_finding(context, runner, attribute, twice)
                continue
            if missing is None:
                missing = _missing(binding)
            key = binding.provider.name, tuple(missing), attribute.name
            if key not in lookups and len(lookups) < _MAX_LOOKUPS:
                words = _words(binding.provider, missing)
                lookups[key] = words.get(near(attribute.name, list(words)), "")
            meant = lookups.get(key, "")
            yield _unknown_parameter_finding(
                context, runner, attribute, binding, meant, needed=meant in missing
            )


def _is_unknown(provider: Provider, name: str) -> bool:
    return not is_label(name) and provider.parameter(name) is None and provider.input(name) is None


def _read_instead(binding: Binding, attribute: Attribute) -> str:
    """The attribute that is read instead of this one, which is another name for it; else ""."""
    parameter = binding.provider.parameter(attribute.name)
    first = binding.written.get(parameter.name) if parameter else None
    return "" if first is None or first is attribute else first.name


def _second_spelling_finding(
    context: Context, runner: Element, attribute: Attribute, read: str
) -> Finding:
    who, what = short(runner.interface), quoted(attribute.name)
    return UNKNOWN_PARAMETER.finding(
        f"{quoted(read)} and {what} are one parameter of {who}: the value of {what} is ignored",
        context.plan.location(runner, attribute),
        hint=f"remove {what}",
        length=len(attribute.name),
    )


def _unknown_parameter_finding(
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
        message = f"{who} has no parameter {what}, but needs {quoted(meant)}"
    else:
        message = f"{who} has no parameter {what}: its value is ignored"
    names = _takes(binding.provider)
    if meant in names:
        hint = f"write {quoted(meant)} instead"
    elif meant:
        hint = f"remove it: {quoted(meant)} can only come from the step right before this one"
    elif names:
        hint = f"use one of its parameters: {listed([quoted(name) for name in names], most=8)}"
    else:
        hint = "remove it: this runner takes no parameters"
    return UNKNOWN_PARAMETER.finding(
        message,
        context.plan.location(runner, attribute),
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


UNKNOWN_PARAMETER = Rule(
    code="GP203",
    name="unknown-parameter",
    severity=Severity.WARNING,
    summary="A runner has a parameter that its provider does not declare.",
    why=(
        "The engines ignore it silently: the runner uses a default instead of the value and "
        "does something other than the plan says. Often the name is misspelt, or belongs to "
        "another runner."
    ),
    fix="write the name as the capability file has it, or remove the attribute",
    bad=plan(go(2.0, -0.5).replace("/>", ' speed="0.3"/>')),
    good=plan(go(2.0, -0.5).replace("/>", ' name="the door"/>')),
    find=_find_unknown_parameter,
)


_SHOWN = 5


def _find_missing_parameter(context: Context) -> Iterator[Finding]:
    """One finding per runner instance."""
    flow: DataFlow | None = context.answers.get("data_flow")
    missing: dict[int, list[str]] = {}
    for need in flow.missing if flow else ():
        if need.kind == "parameter" and need.how == "always":
            missing.setdefault(need.runner, []).append(clip(need.name, 40))
    for number, names in missing.items():
        runner = context.runner(number)
        several = len(names) > 1
        missing_names = listed([quoted(name) for name in names], most=_SHOWN)
        yield MISSING_PARAMETER.finding(
            f"{missing_names} {'are' if several else 'is'} missing: {context.place(runner)} needs "
            f"{'them' if several else 'it'}, and no other step can supply "
            f"{'them' if several else 'it'}",
            context.plan.location(runner),
            hint="write " + listed([f'{name}="…"' for name in names], most=_SHOWN),
        )


MISSING_PARAMETER = Rule(
    code="GP204",
    name="missing-parameter",
    severity=Severity.ERROR,
    summary="A runner lacks a parameter that it needs, and nothing can supply it.",
    why=(
        "The parameter has no default, the plan does not set it, and the step before outputs "
        "no value of this name. The runner fails, or works with an arbitrary value."
    ),
    fix="write the parameter",
    bad=plan(go(2.0, -0.5), wait(5.0).replace(' seconds="5.0"', "")),
    good=plan(go(2.0, -0.5), wait(5.0)),
    find=_find_missing_parameter,
)


_TRUE = frozenset({"true", "1", "yes", "on", "y", "t"})
_FALSE = frozenset({"false", "0", "no", "off", "n", "f"})
_WITH_UNIT = pattern(r"\s*([+-]?[0-9]+(?:[.,][0-9]+)?)\s*[a-zA-Z°%]{0,10}\s*")
_MAX_NUMBER = 40
_WANTED = {
    ValueType.BOOL: "true or false",
    ValueType.INT: "an integer",
    ValueType.DOUBLE: "a finite number",
}


def _find_mistyped_parameter(context: Context) -> Iterator[Finding]:
    """One finding per attribute, where it stands."""
    for number, binding, attribute, parameter in bound_parameters(context):
        wanted = expected_type(binding, parameter)
        if _fits(attribute.value, wanted) or is_placeholder(attribute):
            continue
        runner = context.runner(number)
        yield MISTYPED_PARAMETER.finding(
            f"{short(runner.interface)} expects {clip(attribute.name, 40)} to be "
            f'{_WANTED[wanted]}, not "{clip(attribute.text, 40)}"',
            context.plan.location(runner, attribute),
            hint=_mistyped_parameter_hint(attribute, wanted),
            length=len(attribute.name),
        )


def _fits(value: Value, wanted: ValueType) -> bool:
    if wanted is ValueType.BOOL:
        return isinstance(value, bool)
    if wanted not in (ValueType.INT, ValueType.DOUBLE):
        return True
    if isinstance(value, bool | str):
        return False
    return isinstance(value, int) or (wanted is ValueType.DOUBLE and math.isfinite(value))


def _mistyped_parameter_hint(attribute: Attribute, wanted: ValueType) -> str:
    name, text = clip(attribute.name, 40), attribute.text
    if wanted is ValueType.BOOL:
        word = text[:_MAX_NUMBER].strip().lower()
        if word in _TRUE | _FALSE:
            return f'write {name}="{"true" if word in _TRUE else "false"}"'
        return f'write {name}="true" or {name}="false"'
    number = _number(attribute)
    if wanted is ValueType.DOUBLE:
        return f'write {name}="{number}"' if number else f'write a number, as in {name}="1.5"'
    if number and float(number).is_integer():
        return f'write {name}="{int(float(number))}"'
    return f'write an integer, as in {name}="3"'


def _number(attribute: Attribute) -> str:
    """The number that is meant by ``1,5``, ``1.5 m`` or ``90deg``; "" if none is."""
    match = _WITH_UNIT.fullmatch(attribute.text) if len(attribute.text) <= _MAX_NUMBER else None
    return match[1].replace(",", ".") if match else ""


MISTYPED_PARAMETER = Rule(
    code="GP205",
    name="mistyped-parameter",
    severity=Severity.ERROR,
    summary="The value of a parameter has the wrong type.",
    why=(
        "Attributes are read as a Boolean (exactly true or false), an integer, a floating-point "
        "number, or else as text. A runner that receives another type than it expects may crash "
        "its whole process."
    ),
    fix="write a value of the type that the capability file declares",
    bad=plan(go(2.0, -0.5).replace('"2.0"', '"2.0 m"')),
    good=plan(go(2.0, -0.5)),
    find=_find_mistyped_parameter,
)


def _find_parameter_out_of_range(context: Context) -> Iterator[Finding]:
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
        yield PARAMETER_OUT_OF_RANGE.finding(
            f"{written(attribute)} is not allowed: {short(runner.interface)} accepts {allowed}",
            context.plan.location(runner, attribute),
            hint="" if bounds else _parameter_out_of_range_hint(attribute, parameter),
            length=len(attribute.name),
        )
    yield from _outside_of_map(context)
    yield from _unbounded_arrivals(context)


def _unbounded_arrivals(context: Context) -> Iterator[Finding]:
    """Values that arrive for a parameter that the robot bounds: nothing says that they lie within.

    A number that the plan writes there does not count, for the one that arrives replaces it.
    """
    if context.capabilities.robot is None:
        return
    for number, binding in enumerate(context.bindings):
        if binding is None or not binding.arriving:
            continue
        for parameter in binding.provider.configuration:
            spans = parameter.minimum, parameter.maximum
            if spans == (None, None) or parameter.name not in binding.arriving:
                continue
            runner, giver = context.runner(number), _giver(context, number, parameter.name)
            yield PARAMETER_OUT_OF_RANGE.finding(
                f"{context.place(runner)} takes {quoted(parameter.name)} from "
                f"{context.place(giver)}, and nothing keeps the value within its bounds "
                f"({_span(*spans)})",
                context.plan.location(runner),
                hint="put a step that outputs no such value between the two, and write the value",
                related=(context.related(giver, f"outputs {quoted(parameter.name)}"),),
            )


def _giver(context: Context, number: int, name: str) -> Element:
    """The runner from which a value of this name arrives: in a machine, the first of them."""
    automaton = context.automaton
    numbers = (
        automaton.runner_number(signal.node)
        for signal in automaton.inputs[automaton.runner_node(number)]
        if automaton.nodes[signal.node].kind is NodeKind.RUNNER
        and (giver := context.bindings[automaton.runner_number(signal.node)]) is not None
        and name in giver.provider.names_handed_over(signal.event)
    )
    return context.runner(next(numbers))


def _outside_of_map(context: Context) -> Iterator[Finding]:
    """Places outside of the polygon in which the robot may drive, at the x of each."""
    robot = context.capabilities.robot
    if robot is None or not robot.corners:
        return
    for number, binding in enumerate(context.bindings):
        if binding is None:
            continue
        x, y = (binding.written.get(axis) for axis in ("x", "y"))
        if x is None or y is None or isinstance(x.value, str) or isinstance(y.value, str):
            continue  # a text is no number, as GP205 tells; a bare x or y has its bounds above
        if not inside((float(x.value), float(y.value)), robot.corners):
            runner = context.runner(number)
            yield PARAMETER_OUT_OF_RANGE.finding(
                f"{written(x)} {written(y)} is outside the map of the robot {quoted(robot.name)}",
                context.plan.location(runner, x),
                hint="choose a place inside the corners that the robot's profile lists",
                length=len(x.name),
            )


def inside(point: tuple[float, float], corners: Sequence[tuple[float, float]]) -> bool:
    """True if a point lies in a polygon or on its edge: a ray to the right crosses an odd number.

    >>> square = [(0, 0), (2, 0), (2, 2), (0, 2)]
    >>> inside((1, 1), square), inside((2, 1), square), inside((3, 1), square)
    (True, True, False)
    """
    x, y = point
    odd = False
    for (x1, y1), (x2, y2) in zip(corners, [*corners[1:], corners[0]], strict=True):
        side = (x2 - x1) * (y - y1) - (y2 - y1) * (x - x1)
        within = min(x1, x2) <= x <= max(x1, x2) and min(y1, y2) <= y <= max(y1, y2)
        if side == 0 and within:
            return True
        # An edge counts its lower end only, so that a corner on the ray is not counted twice.
        if (y1 > y) != (y2 > y) and (side > 0) == (y2 > y1):
            odd = not odd
    return odd


def _outside(attribute: Attribute, parameter: Parameter) -> str:
    """The bounds, if the value is a number outside of them."""
    value, least, greatest = attribute.value, parameter.minimum, parameter.maximum
    if isinstance(value, bool | str) or (isinstance(value, float) and math.isnan(value)):
        return ""
    low, high = least is not None and value < least, greatest is not None and value > greatest
    return _span(least, greatest) if low or high else ""


def _span(least: float | None, greatest: float | None) -> str:
    """Two bounds as one says them; one of them may be None."""
    if least is None:
        return f"at most {_said(greatest)}"
    return (
        f"at least {_said(least)}" if greatest is None else f"{_said(least)} to {_said(greatest)}"
    )


def _said(bound: float | None) -> str:
    """A bound as one writes it: 1000000000 and not 1e+09."""
    assert bound is not None
    return f"{bound:.0f}" if abs(bound) < 1e12 and bound == int(bound) else f"{bound:g}"


def _parameter_out_of_range_hint(attribute: Attribute, parameter: Parameter) -> str:
    meant = near(attribute.text, parameter.choices)
    return f"write {quoted(meant)}" if meant else ""


PARAMETER_OUT_OF_RANGE = Rule(
    code="GP206",
    name="parameter-out-of-range",
    severity=Severity.ERROR,
    summary="The value of a parameter is outside the range that its provider allows.",
    why=(
        "The capability file declares which values are valid. With any other value the runner "
        "fails or behaves unpredictably."
    ),
    fix="write an allowed value",
    bad=plan(wait(-5.0)),
    good=plan(wait(5.0)),
    find=_find_parameter_out_of_range,
)


_TEXTS = (ValueType.ANY, ValueType.STRING)


def _find_unfilled_placeholder(context: Context) -> Iterator[Finding]:
    """One finding per attribute, where it stands; none where no run ever uses the value."""
    flow = _Flow(context)
    for number, runner in enumerate(context.plan.runners):
        for attribute in runner.attributes:
            if is_label(attribute.name):
                continue
            named = placeholder(attribute.text)
            if named is None or not context.reached[context.unit_of_runner[number]]:
                continue
            finding = _unfilled_placeholder_finding(context, flow, number, attribute, named)
            if finding is not None:
                yield finding


class _Flow:
    """Attributes as they are when the plan runs."""

    def __init__(self, context: Context) -> None:
        self._context = context
        answer: DataFlow | None = context.answers.get("data_flow")
        self.decided = answer is not None
        self.overwritten: Mapping[tuple[int, str], Overwritten] = {
            (entry.runner, entry.name): entry for entry in (answer.overwritten if answer else ())
        }

        self.lost = {(entry.runner, entry.name) for entry in (answer.lost if answer else ())}

    def open(self, number: int) -> bool:
        """True if it is not known what arrives."""
        return not self.decided or self._context.values.arriving[number] is None

    def must_arrive(self, number: int, name: str) -> bool:
        """True if an instance needs a value that only another step can give it."""
        binding = self._context.bindings[number]
        needs = () if binding is None else self._context.values.needs(binding)
        return any(need.name == name and not need.literal for need in needs)

    def may_arrive(self, number: int, name: str) -> bool:
        """True if a step right before an instance could give this value, and does not yet."""
        binding = self._context.bindings[number]
        expected = None if binding is None else binding.provider.input(name)
        allowed = () if expected is None else expected.satisfiable_from
        if allowed and Source.UPSTREAM not in allowed:
            return False
        arriving = self._context.values.arriving[number] or ()
        return name in self._outputs and name not in arriving

    @cached_property
    def _outputs(self) -> frozenset[str]:
        """The names of all values that some runner gives."""
        library = self._context.capabilities.library
        return frozenset(
            output.name for provider in library.providers for output in provider.outputs
        )


def _unfilled_placeholder_finding(
    context: Context, flow: _Flow, number: int, attribute: Attribute, named: Placeholder
) -> Finding | None:
    binding, runner = context.bindings[number], context.runner(number)
    who, what = short(runner.interface) or "the runner", clip(attribute.name, 40)
    text = quoted(named.text)
    if named.certain:
        message = f"the placeholder {text} is never filled in: {who} takes '{what}' literally"
    else:
        message = f"{text} in '{what}' looks like a placeholder, but is never filled in"
    hint = unless = ""
    severity = Severity.ERROR if named.certain else Severity.WARNING
    confidence = Confidence.PROVED if named.certain else Confidence.HEURISTIC
    name = attribute.name
    if binding is None:
        severity, confidence = Severity.WARNING, Confidence.HEURISTIC
    else:
        provider = binding.provider
        parameter = provider.parameter(attribute.name) or provider.input(attribute.name)
        if parameter is None or binding.written.get(parameter.name) is not attribute:
            return None  # GP203: nobody reads it
        name = parameter.name
        if (number, name) in flow.lost:
            unless = "GP402"  # it tells where the value is
        if not named.certain and expected_type(binding, parameter) not in _TEXTS:
            return None  # GP205: it is no text at all
        replaced = flow.overwritten.get((number, name))
        if replaced is not None and replaced.how == "always":
            severity, confidence = Severity.INFO, Confidence.PROVED
            source = context.place(context.runner(replaced.source))
            message = (
                f"the placeholder {text} in '{what}' is harmless, because a value from {source} "
                "always replaces it"
            )
            hint = f"remove '{what}': the value arrives by its name alone"
        elif flow.must_arrive(number, name):
            return None  # GP401: what the plan writes does not count
        elif replaced is not None or flow.open(number):
            severity = Severity.WARNING
            message += f", unless a value named {quoted(parameter.name)} arrives"
    location = context.plan.location(runner, attribute)
    finding = UNFILLED_PLACEHOLDER.finding(
        message,
        location,
        severity=severity,
        hint=hint or _unfilled_placeholder_hint(flow, number, name),
        length=len(attribute.name),
        unless=unless,
    )
    return replace(finding, confidence=confidence)


def _unfilled_placeholder_hint(flow: _Flow, number: int, name: str) -> str:
    """A value that the parameter can get instead, in words."""
    if not flow.may_arrive(number, name):
        return UNFILLED_PLACEHOLDER.fix
    return (
        f"write the value itself, or put a step that outputs {quoted(name)} right before this one: "
        "a value arrives only from there, and only under the parameter's own name"
    )


UNFILLED_PLACEHOLDER = Rule(
    code="GP207",
    name="unfilled-placeholder",
    severity=Severity.ERROR,
    summary="An attribute contains a placeholder such as $name or {name}, which nothing fills in.",
    why=(
        "Plans have no variables. A value passes from a step to the one right after it if both "
        "use the same name, whatever the plan writes; it is never inserted into a text. So "
        "the robot says 'dollar answer', or drives nowhere."
    ),
    fix="write the value itself",
    bad=plan(go(2.0, -0.5), say("$greeting")),
    good=plan(look("What do you see?"), say("").replace(' text=""', "")),
    severities=(
        "error if the runner receives the placeholder literally; warning if the text may mean "
        "something else, if no file describes the runner, or if a value may arrive in its place; "
        "info if a value always arrives in its place"
    ),
    find=_find_unfilled_placeholder,
)


RULES = (
    UNKNOWN_PARAMETER,
    MISSING_PARAMETER,
    MISTYPED_PARAMETER,
    PARAMETER_OUT_OF_RANGE,
    UNFILLED_PLACEHOLDER,
)
