"""The plan as a tree with states, as far as a run has come; ``live`` shows it on a terminal."""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.execution.records import Kind
from gpsfsm.model.drawing import plan_to_tree
from gpsfsm.model.plan import Kind as ElementKind
from gpsfsm.watch.moments import seconds

if TYPE_CHECKING:
    from collections.abc import Iterable

    from gpsfsm.execution.records import Record
    from gpsfsm.model.automaton import Automaton

__all__ = ["Line", "State", "Tree"]


class State(Enum):
    """How an element stands: a sign, and the same for terminals that know ASCII only."""

    WAITING = ("·", ".")
    LOADING = ("○", "o")
    HELD = ("‖", "=")
    ACTIVE = ("▶", ">")
    SUCCEEDED = ("✓", "+")
    FAILED = ("✗", "x")
    STOPPED = ("■", "#")

    @property
    def ended(self) -> bool:
        """Whether it stays like that."""
        return self in (State.SUCCEEDED, State.FAILED, State.STOPPED)


_STATES = {
    Kind.TRIGGERED: State.LOADING,
    Kind.HELD: State.HELD,
    Kind.STARTED: State.ACTIVE,
    Kind.SUCCEEDED: State.SUCCEEDED,
    Kind.FAILED: State.FAILED,
    Kind.STOPPED: State.STOPPED,
}


class Line(NamedTuple):
    """One element: how it stands, its line of the tree, and how long it has acted ("": it has not).

    ``state`` is None for a control in which nothing acts.
    """

    state: State | None
    text: str
    took: str


class Tree:
    """Follows a run. ``lines`` are in document order, one per element of the plan."""

    def __init__(self, automaton: Automaton) -> None:
        self._plan = automaton.plan
        self._elements = [node.origin for node in automaton.runners]
        self._texts = plan_to_tree(automaton.plan).splitlines()
        self._states: dict[int, State] = {}
        self._times: dict[int, tuple[int, int]] = {}
        self._inside: dict[int, int] = {}  # control: how many instances act inside it
        self.last = 0  # the element that has changed last

    def __len__(self) -> int:
        return len(self._plan.elements)

    def add(self, at_us: int, records: Iterable[Record]) -> None:
        """Take in what has happened."""
        for record in records:
            state = _STATES.get(record.kind)
            if state is None or not 0 < record.node <= len(self._elements):
                continue
            element = self._elements[record.node - 1]
            before = self._states.get(element)
            if before is State.ACTIVE or state is State.ACTIVE:
                self._count(element, (state is State.ACTIVE) - (before is State.ACTIVE))
            self._states[element] = state
            started = at_us if state is State.ACTIVE else self._times.get(element, (at_us, 0))[0]
            self._times[element] = (started, at_us)
            self.last = element

    def _count(self, element: int, change: int) -> None:
        parent = self._plan.elements[element].parent
        while change and parent >= 0:
            self._inside[parent] = self._inside.get(parent, 0) + change
            parent = self._plan.elements[parent].parent

    def lines(self, now_us: int, first: int = 0, count: int | None = None) -> list[Line]:
        """Some lines of the tree, or all."""
        end = len(self) if count is None else min(len(self), first + count)
        return [self._line(index, now_us) for index in range(first, end)]

    def _line(self, index: int, now_us: int) -> Line:
        if self._plan.elements[index].kind is not ElementKind.RUNNER:
            active = self._inside.get(index, 0) > 0
            return Line(State.ACTIVE if active else None, self._texts[index], "")
        state = self._states.get(index, State.WAITING)
        took = ""
        if state is State.ACTIVE:
            took = f"{seconds(now_us - self._times[index][0])} s"
        elif state.ended:
            started_us, ended_us = self._times[index]
            took = f"{seconds(ended_us - started_us)} s"
        return Line(state, self._texts[index], took)
