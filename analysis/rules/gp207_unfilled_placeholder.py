"""GP207: a placeholder, for which nothing is ever put in."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

from gpsfsm.analysis.flow import Placeholder, placeholder
from gpsfsm.analysis.rules.base import Rule, go, look, plan, say
from gpsfsm.analysis.rules.names import expected_type, is_label, quoted, short
from gpsfsm.model.capability import Source, ValueType
from gpsfsm.model.finding import Confidence, Severity
from gpsfsm.model.plan import Location
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from gpsfsm.analysis.context import Context
    from gpsfsm.analysis.decisions.data_flow import DataFlow, Overwritten
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.plan import Attribute

_TEXTS = (ValueType.ANY, ValueType.STRING)


def find(context: Context) -> Iterator[Finding]:
    """One finding per attribute, where it stands; none where no run ever uses the value."""
    flow = _Flow(context)
    for number, runner in enumerate(context.plan.runners):
        for attribute in runner.attributes:
            if is_label(attribute.name):
                continue
            named = placeholder(attribute.text)
            if named is None or not context.reached[context.unit_of_runner[number]]:
                continue
            finding = _finding(context, flow, number, attribute, named)
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


def _finding(
    context: Context, flow: _Flow, number: int, attribute: Attribute, named: Placeholder
) -> Finding | None:
    binding, runner = context.bindings[number], context.runner(number)
    who, what = short(runner.interface) or "the runner", clip(attribute.name, 40)
    text = quoted(named.text)
    if named.certain:
        message = f"nothing ever fills the placeholder {text}: {who} uses {what} as it is written"
    else:
        message = f"{text} in {what} looks like a placeholder, and nothing ever fills one"
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
                f"the placeholder {text} in {what} is harmless here, because the value that comes "
                f"from {source} replaces it"
            )
            hint = f"leave {what} out: it is the name alone that makes the value arrive"
        elif flow.must_arrive(number, name):
            return None  # GP401: what the plan writes does not count
        elif replaced is not None or flow.open(number):
            severity = Severity.WARNING
            message += f", unless a value of the name {quoted(parameter.name)} arrives"
    location = Location(attribute.line, attribute.column, context.plan.path(runner))
    finding = RULE.finding(
        message,
        location,
        severity=severity,
        hint=hint or _hint(flow, number, name),
        length=len(attribute.name),
        unless=unless,
    )
    return replace(finding, confidence=confidence)


def _hint(flow: _Flow, number: int, name: str) -> str:
    """A value that the parameter can get instead, in words."""
    if not flow.may_arrive(number, name):
        return RULE.fix
    return (
        f"write the value itself; or put a step that gives {quoted(name)} right before this one: "
        "a value arrives from there alone, and under the parameter's own name"
    )


RULE = Rule(
    code="GP207",
    name="unfilled-placeholder",
    severity=Severity.ERROR,
    summary="An attribute holds a placeholder such as $name or {name}, which nothing ever fills.",
    why=(
        "Plans have no variables. A value goes from a step to the one right after it if both call "
        "it by the same name, whatever the plan writes; it is never put into a text. So the robot "
        "says 'dollar answer', or drives nowhere."
    ),
    fix="write the value itself",
    bad=plan(go(2.0, -0.5), say("$greeting")),
    good=plan(look("What do you see?"), say("").replace(' text=""', "")),
    severities=(
        "error if the runner gets the placeholder as it is written; warning where the text may "
        "mean something else, where no file describes the runner, or where a value may arrive in "
        "its place; info if a value always arrives in its place"
    ),
    find=find,
)
