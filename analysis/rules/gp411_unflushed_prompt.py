"""GP411: a prompt waits in a buffer that is never sent to the model."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.causes import buffer_name
from gpsfsm.analysis.decisions.prompts import unflushed_claim
from gpsfsm.analysis.rules.base import Rule, go, look, note, phrase, plan, say
from gpsfsm.analysis.words import listed
from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.story import Sentence, Statement

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.causes import Concerned
    from gpsfsm.analysis.context import Context


def find(context: Context) -> Iterator[Finding]:
    """One finding per buffer; another one of what GP413 or GP414 tells, if nobody sees that."""
    for concerned in context.buffers.unflushed:
        if concerned.uuid:
            yield _finding(context, concerned)
        else:
            yield _nameless(context, concerned)


def _nameless(context: Context, concerned: Concerned) -> Finding:
    prompt = context.runner(concerned.runners[0])
    return RULE.finding(
        f"the model never gets the prompt of {context.place(prompt)}: without uuid and without "
        "flush it waits in a buffer that nothing can flush",
        context.plan.location(prompt),
        hint='write flush="true" to send it, or the uuid of a prompt that is flushed later',
        unless=concerned.unless,
    )


def _finding(context: Context, concerned: Concerned) -> Finding:
    assert context.prompts is not None
    uuid, numbers = concerned.uuid, concerned.runners
    flushes = context.prompts.flushing(uuid) or ()
    first, *others = (context.runner(number) for number in numbers)
    names = listed([context.place(context.runner(number)) for number in numbers])
    name = buffer_name(uuid)
    if flushes:
        message = f"the plan can complete without sending the prompt of {names}"
        reason = f"no flush of '{name}' comes after it in every run"
        claim = unflushed_claim(context.automaton, numbers[0], flushes)
        closing = Sentence(Statement.UNFLUSHED, arguments=(name,))
        scenario = context.scenario(RULE.code, claim, closing)
        hint = (
            f'put a prompt with flush="true" uuid="{name}" where every run gets to after this one'
        )
    else:
        message = f"the model never gets the prompt of {names}"
        reason = f"nothing flushes the buffer '{name}'"
        scenario = None
        hint = f'write flush="true" uuid="{name}" at the last prompt that belongs to it'
    return RULE.finding(
        f"{message}: {reason}",
        context.plan.location(first),
        hint=hint,
        related=tuple(context.related(other, f"also waits in '{name}'") for other in others),
        scenario=scenario,
        unless=concerned.unless,
    )


RULE = Rule(
    code="GP411",
    name="unflushed-prompt",
    severity=Severity.WARNING,
    summary="A prompt is buffered, and in some run that completes it is never sent.",
    why=(
        "A prompt runner keeps its text in a buffer until a prompt with the same uuid and flush "
        "set to true sends all of it. It reports success in any case, so nobody notices that the "
        "model was never asked."
    ),
    fix='write flush="true" at the last prompt that belongs together',
    bad=plan(go(1.0, 2.0), look("Who is there?"), note(uuid="scene"), say("Thank you.")),
    good=plan(
        go(1.0, 2.0),
        look("Who is there?"),
        note(uuid="scene"),
        phrase("Say who is there.", uuid="scene", flush="true"),
        say("$text"),
    ),
    find=find,
)
