"""Causes of findings, each once: joins that wait for ever, and prompt buffers that go wrong.

A waiting join has the units that are guilty of it and what belongs to them, for the rules on
dangling events, join deadlocks and stuck plans; a buffer has the one of the rules on unflushed
prompts, empty flushes and mixed buffers that reports it.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import field
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.analysis.decisions.prompts import PromptFlow
from gpsfsm.analysis.encode import conjunction, negation
from gpsfsm.compile import UnitKind
from gpsfsm.late import dataclass
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.analysis.context import Context
    from gpsfsm.analysis.decisions.joins import Deadlock
    from gpsfsm.analysis.flow import Prompts


@dataclass(frozen=True, slots=True)
class Waiting:
    """A parallel_all whose join may wait for ever.

    ``guilty`` are the units for which it may wait, ``dangling`` the numbers of the runners whose
    dangling failures make them fail, ``outer`` the blocks that wait only because this one does.
    """

    deadlock: Deadlock
    unit: int
    guilty: tuple[int, ...]
    dangling: tuple[int, ...]
    outer: tuple[int, ...]


def waiting_blocks(context: Context) -> tuple[Waiting, ...]:
    """The join deadlocks to report, in document order. Raises InconclusiveError at a limit.

    A block that waits only for a block that waits itself is listed under that one.
    """
    deadlocks = {
        context.unit_of_element[context.automaton.blocks[deadlock.block].element]: deadlock
        for deadlock in context.answers["joins"] or ()
    }
    guilty = _guilty(context, deadlocks)
    cause = {unit: _cause(context, guilty, unit) for unit in deadlocks}
    enclosing = _enclosing(context.units.parents, deadlocks)
    outer: dict[int, list[int]] = {}
    for unit, root in cause.items():
        if root != unit:
            outer.setdefault(root, []).append(unit)
    dangling: dict[int, list[int]] = {}
    for dangler in context.answers["dangling"] or ():
        block = enclosing[context.unit_of_runner[dangler.runner]]
        if block >= 0 and (dangler.effect == "give_up" or context.possible_event(dangler)):
            dangling.setdefault(cause[block], []).append(dangler.runner)
    return tuple(
        Waiting(
            deadlock,
            unit,
            guilty[unit],
            tuple(dangling.get(unit, ())),
            tuple(outer.get(unit, ())),
        )
        for unit, deadlock in deadlocks.items()
        if cause[unit] == unit
    )


def _guilty(context: Context, deadlocks: Mapping[int, Deadlock]) -> Mapping[int, tuple[int, ...]]:
    """The units of each block whose success may never come."""
    children = context.units.children
    structure = context.deciders.structure
    if structure is not None:
        return {
            unit: tuple(child for child in children[unit] if structure.can_fail[child])
            for unit in deadlocks
        }
    solver = context.deciders.solver
    pairs = [(unit, place) for unit in deadlocks for place in range(len(children[unit]))]
    terms = []
    for unit, place in pairs:
        block = context.automaton.blocks[deadlocks[unit].block]
        success, _ = block.units[place]
        triggered = solver.encoding.happens(block.trigger)
        terms.append(conjunction((triggered, negation(solver.encoding.happens(success)))))
    answers = solver.decide(terms)
    culprits: dict[int, list[int]] = {unit: [] for unit in deadlocks}
    for (unit, place), guilty in zip(pairs, answers, strict=True):
        if guilty:
            culprits[unit].append(children[unit][place])
    return {unit: tuple(units) for unit, units in culprits.items()}


def _cause(context: Context, guilty: Mapping[int, tuple[int, ...]], unit: int) -> int:
    """The innermost block because of which this one waits: itself, if it has other reasons."""
    while len(guilty[unit]) == 1:
        inner = guilty[unit][0]
        while context.units.kinds[inner] is UnitKind.SEQUENCE and (
            len(context.units.children[inner]) == 1
        ):
            inner = context.units.children[inner][0]
        if inner not in guilty:
            break
        unit = inner
    return unit


def _enclosing(parents: Sequence[int], blocks: Mapping[int, Deadlock]) -> list[int]:
    """For each unit the innermost of the blocks around it, or -1."""
    enclosing = [-1] * len(parents)
    for unit, parent in enumerate(parents):
        if parent >= 0:
            enclosing[unit] = parent if parent in blocks else enclosing[parent]
    return enclosing


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
    """The defects, by buffer; those that no other rule reports come first.

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
    apart = {number: buffer.flush for buffer in mixed for number in buffer.fills}
    uuid_of = {prompt.runner: prompt.uuid or "" for prompt in prompts.all}
    fills: dict[tuple[str, str, int], list[int]] = {}
    for number in flow.unflushed:
        unless = "GP414" if number in answered else "GP413" if number in apart else ""
        uuid = uuid_of[number]
        # each finding is left out as a whole, so it holds what one finding of that rule tells
        part = number if unless == "GP414" or not uuid else apart.get(number, -1)
        fills.setdefault((unless, uuid, part), []).append(number)
    alone = {buffer.flush for buffer in mixed}
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
    mixed: list[Mixed] = []
    start = 0
    for flush in sorted({*lone, *unfilled}):
        end = bisect_left(waiting, flush)
        fills = tuple(waiting[start:end])
        if fills:
            uuids = tuple(dict.fromkeys(uuid_of[number] for number in fills))
            mixed.append(Mixed(flush, uuid_of[flush], fills, uuids))
            start = end
    return mixed
