"""GP413: prompts that seem to belong together are in different buffers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.causes import buffer_name
from gpsfsm.analysis.rules.base import Rule, look, note, phrase, plan, say
from gpsfsm.analysis.words import listed
from gpsfsm.model.finding import Confidence, Finding, Severity

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context


def find(context: Context) -> Iterator[Finding]:
    """One finding per flush that comes after prompts in buffers that nothing sends."""
    for mixed in context.buffers.mixed:
        flush = context.runner(mixed.flush)
        fills = [context.runner(number) for number in mixed.fills]
        buffers = listed([f"'{buffer_name(uuid)}'" for uuid in mixed.uuids])
        sent, wanted = buffer_name(mixed.uuid), buffer_name(mixed.uuids[0])
        which = f"only the buffer '{sent}'" if sent else "no buffer: it has no uuid"
        yield RULE.finding(
            f"{context.place(flush)} sends {which}, but the prompts before it wait in {buffers}, "
            "which nothing sends",
            context.plan.location(flush),
            hint=f'write uuid="{wanted}" here if these prompts belong together',
            related=tuple(context.related(fill, "waits in another buffer") for fill in fills),
        )


RULE = Rule(
    code="GP413",
    name="mixed-buffers",
    severity=Severity.WARNING,
    summary="A prompt is sent while what seems to belong to it waits in another buffer.",
    why=(
        "Only prompts with the same uuid are sent together. The model answers without the rest, "
        "and nobody notices."
    ),
    fix="give the prompts that belong together the same uuid",
    bad=plan(
        look("Who is there?"),
        note(uuid="scene"),
        phrase("Say who is there.", uuid="speech", flush="true"),
        say("$text"),
    ),
    good=plan(
        look("Who is there?"),
        note(uuid="scene"),
        phrase("Say who is there.", uuid="scene", flush="true"),
        say("$text"),
    ),
    confidence=Confidence.HEURISTIC,
    find=find,
)
