"""A run that z3 has found, played event by event: the proof that there is such a run."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.errors import InternalError
from gpsfsm.model.event import Event, Outcome
from gpsfsm.tasks.leaving import left_at_end, left_by
from gpsfsm.tasks.monitor import Violation
from gpsfsm.tasks.plays import Plays

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.model.automaton import Automaton
    from gpsfsm.tasks.leaving import Left, Trail
    from gpsfsm.tasks.monitor import Monitor, MState
    from gpsfsm.tasks.plays import Move, Position

__all__ = ["Told", "retell"]

_Happening = tuple[bool, int]
"""Whether an outcome comes (else an instance begins), and the number of the instance."""


class Told(NamedTuple):
    """A run by its cuts: what has begun at each, whose outcomes have come, what was the change.

    ``latest`` is whose outcome came last, if any; ``outcomes`` is the scenario.
    """

    outcomes: tuple[Outcome, ...]
    begun: tuple[frozenset[int], ...]
    come: tuple[frozenset[int], ...]
    latest: tuple[int | None, ...]
    changes: tuple[_Happening | None, ...]


def retell(told: Told, automaton: Automaton, constraints: Constraints, monitor: Monitor) -> Left:
    """The run, as far as to where it leaves the task. Raises InternalError if it does not.

    Of the events between two changes those come first that stand first in the document.
    """
    telling = _Telling(told, Plays(automaton, constraints), monitor)
    for left in telling.along():
        return left
    raise InternalError("z3 has found a run that does not leave the task")


class _Telling:
    def __init__(self, told: Told, plays: Plays, monitor: Monitor) -> None:
        self._told = told
        self._plays = plays
        self._monitor = monitor
        self._position: Position = plays.first()
        self._state: MState = monitor.start
        self._trail: Trail = None

    def along(self) -> Iterator[Left]:
        """The run, if it leaves the task: first along the cuts, then on to an end."""
        begun: frozenset[int] = frozenset()
        come: frozenset[int] = frozenset()
        told = self._told
        cuts = zip(told.begun, told.come, told.latest, told.changes, strict=True)
        for now_begun, now_come, latest, change in cuts:
            todo = {(False, number) for number in now_begun - begun}
            todo |= {(True, number) for number in now_come - come}
            begun, come = now_begun, now_come
            late = [None if latest is None else (True, latest), change]
            while todo:
                move = self._next(todo, late)
                if move is None:
                    raise InternalError("z3 has found a run that cannot be played")
                todo.discard(_happening(move))
                yield from self._go(move)
        while True:
            left = left_at_end(self._plays, self._monitor, self._position, self._state, self._trail)
            if left is not None:
                yield left
            move = self._next(None, [])
            if move is None:
                return
            yield from self._go(move)

    def _next(self, todo: set[_Happening] | None, late: Sequence[_Happening | None]) -> Move | None:
        """The first move of those that are to come, those in ``late`` after all others."""
        if self._position.end is not None and not self._position.waiting:
            return None
        moves = [move for move in self._plays.moves(self._position) if self._fits(move)]
        if todo is not None:
            moves = [move for move in moves if _happening(move) in todo]
        return min(moves, key=lambda move: _rank(_happening(move), late), default=None)

    def _fits(self, move: Move) -> bool:
        """Whether the scenario has it so."""
        event, number = move
        outcome = self._told.outcomes[number]
        if event is Event.STARTED:
            return outcome is not Outcome.NO_START
        if event is Event.FAILED:
            return outcome in (Outcome.FAILED, Outcome.NO_START)
        return event.value == outcome.value

    def _go(self, move: Move) -> Iterator[Left]:
        event, number = move
        self._trail = (self._trail, event, number)
        after: MState | Violation
        if isinstance(event, Event):
            after = self._monitor.after(self._state, event, number)
        else:
            after = self._monitor.without_start(self._state, number)
        if isinstance(after, Violation):
            yield left_by(after, self._trail)
        if after is None:
            raise InternalError("z3 has found a run that nothing can be wrong with")
        self._position = self._plays.after(self._position, move)
        self._state = after


def _rank(happening: _Happening, late: Sequence[_Happening | None]) -> int:
    return max((rank for rank, each in enumerate(late, start=1) if each == happening), default=0)


def _happening(move: Move) -> _Happening:
    event, number = move
    begins = event is Event.STARTED or event is Outcome.NO_START
    return not begins, number
