"""GP312: a recovery that is meant as a condition on what a prompt or a sensor says."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.rules.base import Rule, ask_plan, control, go, hear, note, plan, set_plan
from gpsfsm.analysis.rules.names import either
from gpsfsm.compile import UnitKind
from gpsfsm.late import pattern
from gpsfsm.model.event import Outcome
from gpsfsm.model.finding import Confidence, Finding, Severity
from gpsfsm.model.plan import NOT_PARAMETERS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from gpsfsm.analysis.context import Context

_ASKING = frozenset(
    ("if", "whether", "unless", "else", "otherwise", "check", "determine", "decide", "condition")
)
_FAILING = ("fail", "error", "abort")
_WORD = pattern(r"[A-Z]?[a-z]+|[A-Z]+")
_MAX_TEXT = 2000


def find(context: Context) -> Iterator[Finding]:
    """One finding per recovery of a block that ends with a prompt that cannot fail.

    The prompt or the name of the recovery must ask something, or the recovery send the prompt. If
    the prompt is guarded alone, the recovery never runs at all: that is GP308.
    """
    units = context.units
    guards = [unit for unit, kind in enumerate(units.kinds) if kind is UnitKind.GUARD]
    prompts = () if context.prompts is None else context.prompts.all
    uuids = {prompt.runner: prompt.uuid or "" for prompt in prompts}
    sent = {prompt.runner: prompt.uuid or "" for prompt in prompts if prompt.flush is not False}
    for guard in sorted(guards, key=lambda unit: units.elements[unit]):
        guarded, first = units.children[guard][0], units.children[guard][1]
        last = _last_step(context, guarded)
        if last < 0 or not context.reached[first] or not _answers_only(context, last):
            continue
        if not _asks(context, last, guard) and not _sends(context, sent, uuids[last], guard):
            continue  # the prompt may just as well tell what has been done
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
    """True if the runner prompts a model and never fails."""
    binding = context.bindings[number]
    prompts = binding is not None and binding.provider.effects.prompt_buffer is not None
    return prompts and not _can_fail(context, number)


def _asks(context: Context, number: int, guard: int) -> bool:
    """True if the texts of a prompt or the name of the recovery read like a condition."""
    binding = context.bindings[number]
    assert binding is not None
    buffer = binding.provider.effects.prompt_buffer
    assert buffer is not None
    silent = {*(NOT_PARAMETERS - {"name"}), buffer.uuid, buffer.flush}
    for attribute in context.runner(number).attributes:
        text = attribute.text[:_MAX_TEXT]
        if attribute.name not in silent and ("?" in text or _words(text) & _ASKING):
            return True
    label = context.plan.elements[context.units.elements[guard]].text("name") or ""
    words = _words(label[:_MAX_TEXT])
    # "if the goal fails" is what recoveries are for
    return bool("?" in label or words & _ASKING) and not any(
        word.startswith(_FAILING) for word in words
    )


def _words(text: str) -> set[str]:
    """The words of a text or of a name such as ``if_no_person`` or ``ifNoPerson``."""
    return {word.lower() for word in _WORD.findall(text)}


def _sends(context: Context, sent: Mapping[int, str], uuid: str, guard: int) -> bool:
    """True if a step of the recovery may flush this buffer."""
    return bool(uuid) and any(
        sent.get(number) == uuid
        for unit in context.units.children[guard][1:]
        for number in context.runners_in(unit)
    )


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
        control("recovery", go(3.0, 4.0), name="if_nobody_answered"),
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
