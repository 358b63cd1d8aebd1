"""What is wrong with the prompt buffers of a plan, each cause once.

Shared by the rules on unflushed prompts, empty flushes and mixed buffers.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.analysis.decisions.prompts import PromptFlow

if TYPE_CHECKING:
    from gpsfsm.analysis.context import Context
    from gpsfsm.analysis.flow.prompts import Prompts

__all__ = ["BufferFindings", "Mixed", "buffer_findings"]


class Mixed(NamedTuple):
    """A flush after fills of other buffers (``uuids``) that nothing flushes."""

    flush: int
    uuid: str
    fills: tuple[int, ...]
    uuids: tuple[str, ...]


@dataclass(slots=True)
class BufferFindings:
    """Runner numbers, by buffer where there is one.

    ``nameless`` fill a buffer without uuid. What ``mixed`` names is in no other list, nor is a
    prompt whose empty answer is used: that is told there.
    """

    unflushed: dict[str, list[int]] = field(default_factory=dict)
    nameless: list[int] = field(default_factory=list)
    empty: dict[str, list[int]] = field(default_factory=dict)
    mixed: list[Mixed] = field(default_factory=list)


def buffer_findings(context: Context) -> BufferFindings:
    """Sort what was decided about the buffers into findings."""
    found = BufferFindings()
    flow: PromptFlow = context.answers["prompts"] or PromptFlow()
    prompts = context.prompts
    if prompts is None:
        return found
    told = {answer.source for answer in flow.empty_answers}
    uuids = {prompt.runner: prompt.uuid or "" for prompt in prompts.all}
    for number in flow.unflushed:
        if number in told:
            continue
        if uuids[number]:
            found.unflushed.setdefault(uuids[number], []).append(number)
        else:
            found.nameless.append(number)
    for number in flow.empty_flush:
        found.empty.setdefault(uuids[number], []).append(number)
    _mix(prompts, found)
    return found


def _mix(prompts: Prompts, found: BufferFindings) -> None:
    """Move flushes of nothing, and the fills before them that nothing sends, to ``mixed``."""
    never = {uuid: numbers for uuid, numbers in found.unflushed.items() if not _sent(prompts, uuid)}
    lone = [prompt.runner for prompt in prompts.all if prompt.flush and prompt.uuid == ""]
    unfilled = [
        number
        for uuid, numbers in found.empty.items()
        if not prompts.filling(uuid)
        for number in numbers
    ]
    uuid_of = {prompt.runner: prompt.uuid or "" for prompt in prompts.all}
    for flush in sorted({*lone, *unfilled}):
        before = {
            uuid: [number for number in numbers if number < flush]
            for uuid, numbers in never.items()
            if uuid in found.unflushed
        }
        fills = [number for numbers in before.values() for number in numbers]
        if not fills:
            continue
        uuids = tuple(uuid for uuid, numbers in before.items() if numbers)
        found.mixed.append(Mixed(flush, uuid_of[flush], tuple(sorted(fills)), uuids))
        for uuid in uuids:
            del found.unflushed[uuid]
        for uuid, numbers in list(found.empty.items()):
            found.empty[uuid] = [number for number in numbers if number != flush]


def _sent(prompts: Prompts, uuid: str) -> bool:
    return prompts.flushing(uuid) != ()
