"""GP412: a flush of a prompt buffer that nothing has filled."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.buffers import buffer_findings
from gpsfsm.analysis.decisions.prompts import empty_flush_claim
from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import go, look, note, phrase, plan, say
from gpsfsm.model.finding import Finding, Severity

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context

__all__ = ["RULE"]


def find(context: Context) -> Iterator[Finding]:
    """One finding per flush; where the fills went to another buffer, GP413 tells."""
    for uuid, numbers in buffer_findings(context).empty.items():
        assert context.prompts is not None
        fills = context.prompts.filling(uuid) or ()
        for number in numbers:
            place = context.place(context.runner(number))
            if fills:
                message = (
                    f"{place} can send the buffer '{uuid}' before anything is in it: "
                    "the model then gets this prompt alone"
                )
                claim = empty_flush_claim(context.automaton, number, fills)
                closing = f"nothing had to be in the buffer '{uuid}' when it was sent"
                scenario = context.scenario(RULE.code, claim, (closing,))
            else:
                message = (
                    f"{place} sends the buffer '{uuid}', which this plan never fills: "
                    "the model gets this prompt alone"
                )
                scenario = None
            yield RULE.finding(
                message, context.plan.location(context.runner(number)), scenario=scenario
            )


RULE = Rule(
    code="GP412",
    name="empty-flush",
    severity=Severity.WARNING,
    summary="A prompt buffer is sent before anything was put into it.",
    why=(
        "The model gets the last prompt without what the robot has seen and heard, and answers "
        "all the same."
    ),
    fix=(
        "give the prompts that belong together the same uuid and put this one last; "
        "leave the uuid away if it stands alone"
    ),
    bad=plan(
        go(1.0, 2.0),
        phrase("Say what you see.", uuid="scene", flush="true"),
        say("$text"),
    ),
    good=plan(
        go(1.0, 2.0),
        look("Who is there?"),
        note(uuid="scene"),
        phrase("Say what you see.", uuid="scene", flush="true"),
        say("$text"),
    ),
    find=find,
)
