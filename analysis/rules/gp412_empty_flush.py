"""GP412: a flush of a prompt buffer that nothing has filled."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.causes import buffer_name
from gpsfsm.analysis.decisions.prompts import empty_flush_claim
from gpsfsm.analysis.rules.base import Rule, go, look, note, phrase, plan, say
from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.story import Sentence, Statement

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.causes import Concerned
    from gpsfsm.analysis.context import Context


def find(context: Context) -> Iterator[Finding]:
    """One finding per flush; where the fills went to another buffer, GP413 tells."""
    for concerned in context.buffers.empty:
        yield _finding(context, concerned)


def _finding(context: Context, concerned: Concerned) -> Finding:
    assert context.prompts is not None
    number = concerned.runners[0]
    fills = context.prompts.filling(concerned.uuid) or ()
    name, place = buffer_name(concerned.uuid), context.place(context.runner(number))
    scenario = None
    if fills:
        message = (
            f"{place} can send the buffer '{name}' before anything is in it: "
            "the model then gets this prompt alone"
        )
        claim = empty_flush_claim(context.automaton, number, fills)
        closing = Sentence(Statement.EMPTY_FLUSH, arguments=(name,))
        scenario = context.scenario(RULE.code, claim, closing)
    else:
        message = (
            f"{place} sends the buffer '{name}', which this plan never fills: "
            "the model gets this prompt alone"
        )
    return RULE.finding(
        message,
        context.plan.location(context.runner(number)),
        scenario=scenario,
        unless=concerned.unless,
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
