"""GP312: a recovery that is meant as a condition on what a prompt or a sensor says."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.capability_words import either
from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import ask_plan, control, go, hear, note, plan, set_plan
from gpsfsm.compile import UnitKind
from gpsfsm.model.event import Outcome
from gpsfsm.model.finding import Confidence, Finding, Severity

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context

__all__ = ["RULE"]


def find(context: Context) -> Iterator[Finding]:
    """One finding per recovery of a block that ends with a prompt that cannot fail.

    If the prompt is guarded alone, the recovery never runs at all: that is GP308.
    """
    units = context.units
    guards = [unit for unit, kind in enumerate(units.kinds) if kind is UnitKind.GUARD]
    for guard in sorted(guards, key=lambda unit: units.elements[unit]):
        guarded, first = units.children[guard][0], units.children[guard][1]
        last = _last_step(context, guarded)
        if last < 0 or not context.reached[first] or not _answers_only(context, last):
            continue
        prompt = context.runner(last)
        able = [
            number
            for number in context.runners_in(guarded)
            if number != last and _can_fail(context, number)
        ]
        causes = either([context.place(context.runner(number)) for number in able])
        yield RULE.finding(
            f"this recovery does not depend on what {context.place(prompt)} says: this prompt "
            f"never fails, so the recovery runs only if {causes} fails",
            context.plan.location(units.elements[guard]),
            related=(context.related(prompt, "never fails, whatever it says"),),
        )


def _last_step(context: Context, unit: int) -> int:
    """The number of the runner with which a sequence ends, or -1 if it ends otherwise."""
    units = context.units
    inside = False
    while units.kinds[unit] is UnitKind.SEQUENCE and units.children[unit]:
        unit = units.children[unit][-1]
        inside = True
    if not inside or units.kinds[unit] is not UnitKind.RUNNER:
        return -1
    return context.numbers[units.elements[unit]]


def _answers_only(context: Context, number: int) -> bool:
    """Whether the runner prompts a model and never fails."""
    binding = context.bindings[number]
    prompts = binding is not None and binding.provider.effects.prompt_buffer is not None
    return prompts and not _can_fail(context, number)


def _can_fail(context: Context, number: int) -> bool:
    allowed = context.deciders.constraints.allowed[number]
    return bool(allowed & {Outcome.FAILED, Outcome.NO_START})


RULE = Rule(
    code="GP312",
    name="condition-as-recovery",
    severity=Severity.WARNING,
    summary="A recovery stands where the plan seems to ask what a prompt has said.",
    why=(
        "Plans have no conditions. A recovery runs if something has failed, and a prompt that is "
        "put into the buffer never fails, whatever its text says. So the steps of the recovery "
        "never run for the reason for which they were written."
    ),
    fix=(
        "let the model decide: flush the prompt with a runner that asks for a plan, and set that "
        "plan; or guard the step whose failure is meant"
    ),
    bad=plan(
        control(
            "sequential",
            go(1.0, 2.0),
            hear(),
            note(uuid="guest"),
        ),
        control("recovery", go(3.0, 4.0)),
    ),
    good=plan(
        go(1.0, 2.0),
        hear(),
        note(uuid="guest"),
        ask_plan("If nobody answered, go to (3, 4).", uuid="guest", flush="true"),
        set_plan(),
    ),
    confidence=Confidence.HEURISTIC,
    find=find,
)
