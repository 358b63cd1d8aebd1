"""A demand as a machine of few states: what an encoding of runs needs to know of it.

The machine is made for one plan: its letters are the events of that plan's instances, and those
that make no difference in any state are not among them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from gpsfsm.model.event import End, Event, Outcome
from gpsfsm.tasks.ltlf import TooLargeError
from gpsfsm.tasks.monitor import Violation

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterator, Mapping

    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.tasks.monitor import Branching, MState

_MAX_STATES = 1_000
_MAX_TABLE = 300_000

Key = tuple[object, ...]
"""Of a violation: ``Violation.key``."""

Letter = tuple[Event | Outcome, int]
"""An event of the instance with this number; NO_START: it is triggered and will not start."""

ENDINGS = (
    (End.COMPLETED, False),
    (End.GAVE_UP, False),
    (End.STUCK, False),
    (End.STUCK, True),
)
"""How a run ends, and whether it is stuck because an instance hangs."""


@dataclass(frozen=True)
class Machine:
    """States are numbers from 0, which is the first; ``classes`` are letters of one effect.

    ``targets[state]`` gives the states after a letter of a class; a class that is not there leaves
    the state as it is. ``broken`` are the states in which the task has been left, ``ends`` those
    of which a run leaves it by ending so. All other states can lead to such a one. ``depth`` is
    how often the state can change at most; None: there are circles.
    """

    targets: tuple[Mapping[int, frozenset[int]], ...]
    classes: Mapping[Letter, int]
    broken: Mapping[int, Key]
    ends: tuple[Mapping[tuple[End, bool], Key], ...]
    depth: int | None

    @property
    def size(self) -> int:
        """The number of states; 0: no run leaves the task."""
        return len(self.targets)

    def after(self, state: int) -> dict[int, list[int]]:
        """The other states that can come right after this one, each with the classes for it."""
        reached: dict[int, list[int]] = {}
        for number, targets in sorted(self.targets[state].items()):
            for target in sorted(targets - {state}):
                reached.setdefault(target, []).append(number)
        return reached


def machine_of(
    branching: Branching, constraints: Constraints, *, most: int = _MAX_TABLE
) -> Machine:
    """The machine of a demand. Raises TooLargeError if it takes more than ``most`` transitions."""
    return _Making(branching, constraints, most).machine()


def letters_of(constraints: Constraints) -> Iterator[Letter]:
    """All events that can come of the instances of a plan."""
    for number, allowed in enumerate(constraints.allowed):
        if allowed - {Outcome.NO_START}:
            yield Event.STARTED, number
        if Outcome.NO_START in allowed:
            yield Outcome.NO_START, number
        if Outcome.SUCCEEDED in allowed:
            yield Event.SUCCEEDED, number
        if allowed & {Outcome.FAILED, Outcome.NO_START}:
            yield Event.FAILED, number


@dataclass
class _Making:
    branching: Branching
    constraints: Constraints
    most: int
    _rows: list[list[frozenset[int]]] = field(default_factory=list)
    _ends: list[dict[tuple[End, bool], Key]] = field(default_factory=list)
    _broken: dict[int, Key] = field(default_factory=dict)

    def machine(self) -> Machine:
        groups: dict[Hashable, list[Letter]] = {}
        for letter in letters_of(self.constraints):
            groups.setdefault(self.branching.letter(*letter), []).append(letter)
        self._explore([letters[0] for letters in groups.values()])
        useful = self._useful()
        number = {state: at for at, state in enumerate(useful)}
        columns: dict[tuple[frozenset[int], ...], int] = {}
        classes: dict[Letter, int] = {}
        stays = tuple(frozenset({at}) for at in range(len(useful)))
        for place, letters in enumerate(groups.values()):
            column = tuple(
                frozenset(number[target] for target in self._rows[state][place] if target in number)
                for state in useful
            )
            if column != stays:
                classes |= dict.fromkeys(letters, columns.setdefault(column, len(columns)))
        targets = tuple(
            {at: column[state] for column, at in columns.items() if column[state] != stays[state]}
            for state in range(len(useful))
        )
        broken = {number[state]: key for state, key in self._broken.items()}
        ends = tuple(self._ends[state] for state in useful)
        return Machine(targets, classes, broken, ends, _depth(targets))

    def _explore(self, letters: list[Letter]) -> None:
        """Fill the table of all states and letters."""
        states: dict[tuple[bool, MState | Key], int] = {(False, self.branching.start): 0}
        todo: list[MState | Violation] = [self.branching.start]
        for at, state in enumerate(todo):  # which grows
            if len(states) > _MAX_STATES or at * len(letters) > self.most:
                raise TooLargeError
            if isinstance(state, Violation):
                self._broken[at] = state.key
                self._rows.append([frozenset({at})] * len(letters))
                self._ends.append({})
                continue
            row: list[frozenset[int]] = []
            for letter in letters:
                targets = set()
                for after in self.branching.branches(state, *letter):
                    wrong = isinstance(after, Violation)
                    edge = (wrong, after.key if isinstance(after, Violation) else after)
                    if edge not in states:
                        states[edge] = len(states)
                        todo.append(after)
                    targets.add(states[edge])
                row.append(frozenset(targets))
            self._rows.append(row)
            self._ends.append(dict(self._endings(state)))

    def _endings(self, state: MState) -> Iterator[tuple[tuple[End, bool], Key]]:
        for end, hanging in ENDINGS:
            violation = self.branching.at_end(state, end, hanging=hanging)
            if violation is not None:
                yield (end, hanging), violation.key

    def _useful(self) -> list[int]:
        """The states from which the task can still be left, ascending; none if not the first."""
        before: list[set[int]] = [set() for _ in self._rows]
        for state, row in enumerate(self._rows):
            for target in frozenset().union(*row):
                before[target].add(state)
        todo = [state for state, ends in enumerate(self._ends) if ends or state in self._broken]
        useful = set(todo)
        while todo:
            new = before[todo.pop()] - useful
            useful |= new
            todo += new
        return sorted(useful) if 0 in useful else []


def _depth(targets: tuple[Mapping[int, frozenset[int]], ...]) -> int | None:
    """The length of the longest way through the states; None: there is none."""
    import networkx

    graph: networkx.DiGraph[int] = networkx.DiGraph()
    for state, row in enumerate(targets):
        graph.add_node(state)
        graph.add_edges_from((state, after) for after in set().union(*row.values()) - {state})
    if not networkx.is_directed_acyclic_graph(graph):
        return None
    length: int = networkx.dag_longest_path_length(graph)
    return length
