"""What is wrong with the prompt buffers of a plan, and which rule tells what.

Shared by the rules on unflushed prompts, empty flushes and mixed buffers.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.analysis.decisions.prompts import PromptFlow
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from gpsfsm.analysis.context import Context
    from gpsfsm.analysis.flow.prompts import Prompts

__all__ = ["BufferFindings", "Concerned", "Mixed", "buffer_findings", "buffer_name"]

_MAX_NAME = 60


class Mixed(NamedTuple):
    """A flush after fills of other buffers (``uuids``) that nothing flushes."""

    flush: int
    uuid: str
    fills: tuple[int, ...]
    uuids: tuple[str, ...]


class Concerned(NamedTuple):
    """Runner numbers of one buffer; ``unless`` is the rule that tells the same of them, or ""."""

    uuid: str
    runners: tuple[int, ...]
    unless: str


@dataclass(slots=True)
class BufferFindings:
    """What is wrong, by buffer; what no other rule tells comes first.

    ``unflushed`` has the fills, those without uuid one by one; ``empty`` the flushes, each by
    itself.
    """

    unflushed: list[Concerned] = field(default_factory=list)
    empty: list[Concerned] = field(default_factory=list)
    mixed: list[Mixed] = field(default_factory=list)


def buffer_name(uuid: str) -> str:
    """A uuid as messages and hints show it: printable and not too long."""
    return clip(uuid, _MAX_NAME)


def buffer_findings(context: Context) -> BufferFindings:
    """Sort what was decided about the buffers into findings."""
    flow: PromptFlow = context.answers["prompts"] or PromptFlow()
    prompts = context.prompts
    if prompts is None:
        return BufferFindings()
    mixed = _mixed(prompts, flow)
    answered = {answer.source for answer in flow.empty_answers}
    apart = {number: found.flush for found in mixed for number in found.fills}
    uuid_of = {prompt.runner: prompt.uuid or "" for prompt in prompts.all}
    fills: dict[tuple[str, str, int], list[int]] = {}
    for number in flow.unflushed:
        unless = "GP414" if number in answered else "GP413" if number in apart else ""
        uuid = uuid_of[number]
        # each finding is left out as a whole, so it holds what one finding of that rule tells
        part = number if unless == "GP414" or not uuid else apart.get(number, -1)
        fills.setdefault((unless, uuid, part), []).append(number)
    alone = {found.flush for found in mixed}
    return BufferFindings(
        unflushed=[
            Concerned(uuid, tuple(numbers), unless)
            for (unless, uuid, _), numbers in sorted(
                fills.items(), key=lambda item: (item[0][0], item[1])
            )
        ],
        empty=[
            Concerned(uuid_of[number], (number,), "GP413" if number in alone else "")
            for number in flow.empty_flush
        ],
        mixed=mixed,
    )


def _mixed(prompts: Prompts, flow: PromptFlow) -> list[Mixed]:
    """Flushes of nothing, each with the fills before it that nothing sends and no other one has."""
    answered = {answer.source for answer in flow.empty_answers}
    uuid_of = {prompt.runner: prompt.uuid or "" for prompt in prompts.all}
    waiting = [
        number
        for number in flow.unflushed
        if uuid_of[number] and number not in answered and prompts.flushing(uuid_of[number]) == ()
    ]
    lone = [prompt.runner for prompt in prompts.all if prompt.flush and prompt.uuid == ""]
    unfilled = [number for number in flow.empty_flush if not prompts.filling(uuid_of[number])]
    found: list[Mixed] = []
    start = 0
    for flush in sorted({*lone, *unfilled}):
        end = bisect_left(waiting, flush)
        fills = tuple(waiting[start:end])
        if fills:
            uuids = tuple(dict.fromkeys(uuid_of[number] for number in fills))
            found.append(Mixed(flush, uuid_of[flush], fills, uuids))
            start = end
    return found
