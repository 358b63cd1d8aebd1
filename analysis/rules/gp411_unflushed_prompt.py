"""GP411: a prompt waits in a buffer that is never sent to the model."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.buffers import buffer_findings
from gpsfsm.analysis.decisions.prompts import unflushed_claim
from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import go, look, note, phrase, plan, say
from gpsfsm.analysis.words import listed
from gpsfsm.model.finding import Finding, Severity

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.analysis.context import Context

__all__ = ["RULE"]


def find(context: Context) -> Iterator[Finding]:
    """One finding per buffer; what GP413 and GP414 tell of is left to them."""
    told = buffer_findings(context)
    for uuid, numbers in told.unflushed.items():
        yield _finding(context, uuid, numbers)
    for number in told.nameless:
        place = context.place(context.runner(number))
        yield RULE.finding(
            f"the model never gets the prompt of {place}: without uuid and without flush it waits "
            "in a buffer that nothing can flush",
            context.plan.location(context.runner(number)),
            hint='write flush="true" to send it, or the uuid of a prompt that is flushed later',
        )


def _finding(context: Context, uuid: str, numbers: Sequence[int]) -> Finding:
    assert context.prompts is not None
    flushes = context.prompts.flushing(uuid) or ()
    first, *others = (context.runner(number) for number in numbers)
    names = listed([context.place(context.runner(number)) for number in numbers])
    if flushes:
        message = f"the plan can complete without sending the prompt of {names}"
        reason = f"no flush of '{uuid}' comes after it in every run"
        claim = unflushed_claim(context.automaton, numbers[0], flushes)
        closing = f"the plan completes, and no flush of '{uuid}' had to come after this prompt"
        scenario = context.scenario(RULE.code, claim, (closing,))
        hint = (
            f'put a prompt with flush="true" uuid="{uuid}" where every run gets to after this one'
        )
    else:
        message = f"the model never gets the prompt of {names}"
        reason = f"nothing flushes the buffer '{uuid}'"
        scenario = None
        hint = f'write flush="true" uuid="{uuid}" at the last prompt that belongs to it'
    return RULE.finding(
        f"{message}: {reason}",
        context.plan.location(first),
        hint=hint,
        related=tuple(context.related(other, f"also waits in '{uuid}'") for other in others),
        scenario=scenario,
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
