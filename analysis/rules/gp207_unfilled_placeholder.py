"""GP207: a placeholder, for which nothing is ever put in."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

from gpsfsm.analysis.capability_words import expected_type, is_label, quoted, short
from gpsfsm.analysis.flow.placeholders import Placeholder, placeholder
from gpsfsm.analysis.flow.values import Values
from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import go, look, plan, say
from gpsfsm.model.capability import ValueType
from gpsfsm.model.finding import Confidence, Severity
from gpsfsm.model.plan import Location
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from gpsfsm.analysis.context import Context
    from gpsfsm.analysis.decisions.data_flow import DataFlow, Overwritten
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.plan import Attribute

__all__ = ["RULE"]

_TEXTS = (ValueType.ANY, ValueType.STRING)
_MAX_NAMES = 3


def find(context: Context) -> Iterator[Finding]:
    """One finding per attribute, where it stands; none where no run ever uses the value."""
    flow = _Flow(context)
    for number, runner in enumerate(context.plan.runners):
        for attribute in runner.attributes:
            if is_label(attribute.name):
                continue
            found = placeholder(attribute.text)
            if found is None or not context.reached[context.unit_of_runner[number]]:
                continue
            finding = _finding(context, flow, number, attribute, found)
            if finding is not None:
                yield finding


class _Flow:
    """What becomes of attributes."""

    def __init__(self, context: Context) -> None:
        self._context = context
        answer: DataFlow | None = context.answers.get("data_flow")
        self.decided = answer is not None
        self.overwritten: Mapping[tuple[int, str], Overwritten] = {
            (found.runner, found.name): found for found in (answer.overwritten if answer else ())
        }

        self.lost = {(found.runner, found.name) for found in (answer.lost if answer else ())}

    def open(self, number: int) -> bool:
        """Whether it is not known what arrives."""
        return not self.decided or self._values.arriving[number] is None

    @cached_property
    def _values(self) -> Values:
        return Values(self._context.compiled)


def _finding(
    context: Context, flow: _Flow, number: int, attribute: Attribute, found: Placeholder
) -> Finding | None:
    binding, runner = context.bindings[number], context.runner(number)
    who, what = short(runner.interface) or "the runner", clip(attribute.name, 40)
    text = quoted(found.text)
    if found.certain:
        message = f"nothing ever fills the placeholder {text}: {who} uses {what} as it is written"
    else:
        message = f"{text} in {what} looks like a placeholder, and nothing ever fills one"
    severity = Severity.ERROR if found.certain else Severity.WARNING
    confidence = Confidence.PROVED if found.certain else Confidence.HEURISTIC
    hint = _hint(found)
    if binding is None:
        severity, confidence = Severity.WARNING, Confidence.HEURISTIC
    else:
        provider = binding.provider
        known = provider.parameter(attribute.name) or provider.input(attribute.name)
        if known is None:
            return None  # GP203: nobody reads it
        if (number, known.name) in flow.lost:
            return None  # GP402: it tells where the value is
        if not found.certain and expected_type(binding, known) not in _TEXTS:
            return None  # GP205: it is no text at all
        replaced = flow.overwritten.get((number, known.name))
        if replaced is not None and replaced.how == "always":
            severity, confidence = Severity.INFO, Confidence.PROVED
            source = context.place(context.runner(replaced.source))
            message = (
                f"the placeholder {text} in {what} is harmless here, because the value that comes "
                f"from {source} replaces it"
            )
            hint = f"leave {what} out: it is the name alone that makes the value arrive"
        elif replaced is not None or flow.open(number):
            severity = Severity.WARNING
            message += f", unless a value of the name {quoted(known.name)} arrives"
    location = Location(attribute.line, attribute.column, context.plan.path(runner))
    finding = RULE.finding(
        message, location, severity=severity, hint=hint, length=len(attribute.name)
    )
    return replace(finding, confidence=confidence)


def _hint(found: Placeholder) -> str:
    """How the value that is wanted can travel."""
    if not found.names:
        return RULE.fix
    named = " or ".join(quoted(name) for name in found.names[:_MAX_NAMES])
    return (
        "a value goes to the step right after the one that gives it, under the same name: put "
        f"this step right behind one that gives {named}, or write the value itself"
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
