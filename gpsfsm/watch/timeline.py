"""What a timeline shows: lanes with bars, links, joins and pauses, in document order."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from gpsfsm.execution.records import Kind, Status
from gpsfsm.watch.moments import status_of
from gpsfsm.watch.words import Detail

if TYPE_CHECKING:
    from collections.abc import Iterable

    from gpsfsm.watch.moments import Moment
    from gpsfsm.watch.words import Words

__all__ = ["MAX_LANES", "Bar", "Lane", "Mark", "Timeline", "timeline"]

MAX_LANES = 500
"""A picture of more lanes helps nobody: those that begin first are drawn."""


@dataclass(frozen=True, slots=True)
class Bar:
    """One instance: times in microseconds since the run began, None for what never happened.

    ``outcome`` is SUCCEEDED, FAILED or STOPPED, or None if it was still active at the end;
    ``told`` says it in words.
    """

    triggered_us: int
    started_us: int | None = None
    ended_us: int | None = None
    outcome: Kind | None = None
    told: str = ""


@dataclass(frozen=True, slots=True)
class Mark:
    """Something that happens at an instant in a lane: a join fires, a runner is asked again."""

    at_us: int
    told: str


@dataclass(slots=True)
class Lane:
    """The lane of an instance or of a control. ``cause`` is the index of the lane before it."""

    element: int
    label: str
    bar: Bar | None = None
    marks: list[Mark] = field(default_factory=list)
    cause: int | None = None

    @property
    def begin_us(self) -> int:
        """When anything happens here first."""
        times = [mark.at_us for mark in self.marks[:1]]
        return min([*times, self.bar.triggered_us] if self.bar else times)


@dataclass(frozen=True, slots=True)
class Timeline:
    """A run as a picture. ``hidden`` counts the lanes that are left out."""

    lanes: tuple[Lane, ...]
    pauses: tuple[tuple[int, int], ...]
    end_us: int
    status: Status
    hidden: int = 0


class _Builder:
    def __init__(self, words: Words) -> None:
        self.words = words
        self.lanes: dict[int, Lane] = {}  # by element
        self.causes: dict[int, int] = {}  # element: the element whose answer triggered it
        self.pauses: list[tuple[int, int]] = []
        self.paused_us: int | None = None
        self.end_us = 0
        self.status = Status.RUNNING

    def lane(self, node: int) -> Lane:
        element = self.words.element(node).index
        if element not in self.lanes:
            label = f"{self.words.line(node)}  {self.words.node(node)}"
            self.lanes[element] = Lane(element, label)
        return self.lanes[element]

    def add(self, moment: Moment) -> None:
        at_us, record = moment.at_us, moment.record
        self.end_us = max(self.end_us, at_us)
        kind = record.kind
        if kind is Kind.ENDED:
            self.status = status_of(record)
        elif kind is Kind.PAUSE and self.paused_us is None:
            self.paused_us = at_us
        elif kind is Kind.RESUME and self.paused_us is not None:
            self.pauses.append((self.paused_us, at_us))
            self.paused_us = None
        elif kind is Kind.JOINED or kind is Kind.RESTARTED:
            if self.words.shown(record, Detail.RUN):
                self.lane(record.node).marks.append(Mark(at_us, self.words.verb(record)))
        elif record.node > 0:
            self._instance(moment)

    def _instance(self, moment: Moment) -> None:
        at_us, record = moment.at_us, moment.record
        if record.kind in (Kind.TRIGGERED, Kind.HELD):
            lane = self.lane(record.node)
            lane.bar = lane.bar or Bar(at_us)
            if moment.cause > 0:
                self.causes[lane.element] = self.words.element(moment.cause).index
        elif record.kind is Kind.STARTED:
            lane = self.lane(record.node)
            lane.bar = replace(lane.bar or Bar(at_us), started_us=at_us)
        elif record.kind in (Kind.SUCCEEDED, Kind.FAILED, Kind.STOPPED):
            lane = self.lane(record.node)
            told = self.words.verb(record)
            ended = replace(lane.bar or Bar(at_us), ended_us=at_us, outcome=record.kind, told=told)
            lane.bar = ended

    def finish(self) -> Timeline:
        if self.paused_us is not None:
            self.pauses.append((self.paused_us, self.end_us))
        lanes = sorted(self.lanes.values(), key=lambda lane: (lane.begin_us, lane.element))
        shown = sorted(lanes[:MAX_LANES], key=lambda lane: lane.element)
        place = {lane.element: index for index, lane in enumerate(shown)}
        for lane in shown:
            lane.cause = place.get(self.causes.get(lane.element, -1))
        return Timeline(
            tuple(shown), tuple(self.pauses), self.end_us, self.status, len(lanes) - len(shown)
        )


def timeline(moments: Iterable[Moment], words: Words) -> Timeline:
    """The lanes of a run: one per instance that was triggered and per parallel control's join."""
    builder = _Builder(words)
    for moment in moments:
        builder.add(moment)
    return builder.finish()
