"""The exploration of a machine: all configurations that runs reach, and what follows from them.

The graph of configurations is finite. Its vertices are numbered in breadth-first order, so that the
path to each is a shortest one and the same on every machine. A maximal run is a path to a
configuration in which nothing is active, or an infinite path that stays at last in one strongly
connected component: it is a run if no runner is active throughout that component without ever
coming to an end there (semantics, 9.3). It is fair if every runner that ends there does so with
each of its outcomes. Where an outcome is missing in a component, a fair run takes none of that
runner's steps again and again: they are left out, and what is left is decomposed anew (Streett's
condition).

    A FAILED → A;  A SUCCEEDED → complete        configurations 0: A active; 1: completed
    component {0} with the step A FAILED         endless; unfair, since A SUCCEEDED is missing there
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.analysis.options import InconclusiveError
from gpsfsm.compile.instants import (
    FAILED,
    GOING,
    HANG,
    SUCCEEDED,
    Change,
    Configuration,
    Instants,
    Successors,
)
from gpsfsm.model.event import Outcome

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence

    from gpsfsm.model.automaton import Automaton, Tie

MAX_CONFIGURATIONS = 50_000
"""Configurations that are explored; a machine with more is undecided."""

_OUTCOMES = {Outcome.SUCCEEDED: SUCCEEDED, Outcome.FAILED: FAILED, Outcome.HANG: HANG}


class Step(NamedTuple):
    """A step from one configuration to another.

    The runner ``number`` has the ``outcome``. ``moved``: the runners that come to an end;
    ``joined``: the joins that fire, are armed again or stopped.
    """

    number: int
    outcome: int
    target: int
    moved: int
    joined: int


@dataclass(frozen=True, slots=True)
class Lasso:
    """An infinite run: steps (runner, outcome) that lead to a loop, and those of the loop."""

    prefix: tuple[tuple[int, int], ...]
    loop: tuple[tuple[int, int], ...]

    @property
    def runners(self) -> tuple[int, ...]:
        """The runners that have an outcome in the loop, in document order."""
        return tuple(sorted({number for number, _ in self.loop}))


Steps = dict[int, list[Step]]
"""A part of the graph: the steps of each of its configurations within the part."""


_Row = tuple[list[Change], list[int]]
"""The steps of a configuration: their changes, and the numbers of what they lead to."""


class Exploration:
    """The configurations that the runs of a machine reach, and the steps between them.

    ``allowed``: per runner the outcomes that it can have, if its tie leaves it any choice. Raises
    InconclusiveError if there are more than ``limit`` configurations. The first ``reached`` are
    those of runs; behind them is what would come of ``others``: outcomes (configuration, runner,
    outcome) that are compared with only.
    """

    def __init__(
        self,
        automaton: Automaton,
        allowed: Sequence[Collection[Outcome]],
        *,
        ties: Sequence[Tie] = (),
        limit: int = MAX_CONFIGURATIONS,
        stepper: Successors | None = None,
    ) -> None:
        self.automaton = automaton
        self.instants = Instants(automaton, ties)
        self.allowed_outcomes = tuple(allowed)
        self.allowed = tuple(
            tuple(sorted(_OUTCOMES[outcome] for outcome in outcomes)) for outcomes in allowed
        )
        self.limit = limit
        self.configurations: list[Configuration] = []
        self.steps: list[list[Step]] = []
        self.origins: list[tuple[int, Step] | None] = []
        self.others: dict[tuple[int, int, int], int] = {}
        self._successors = stepper or Successors(self.instants, self.allowed)
        self._numbers: dict[int, int] = {}  # of packed configurations, in ascending order
        self.explore(self._successors.first())
        self.reached = len(self.configurations)

    def instead(self, at: int, number: int, outcome: int) -> int:
        """The configuration that this outcome leads to, whether it can occur or not."""
        for step in () if self._successors.by_scenario else self.steps[at]:
            if (step.number, step.outcome) == (number, outcome):
                return step.target
        key = (at, number, outcome)
        if key not in self.others:
            other = self._successors.instead(self.configurations[at], number, outcome)
            self.others[key] = self.explore(other)
        return self.others[key]

    def explore(self, start: Configuration) -> int:
        """The number of a configuration; what it leads to is explored too."""
        packed = self._successors.packed(start)
        if packed not in self._numbers:
            self._record(packed, self._rows_from(packed))
        return self._numbers[packed]

    def _rows_from(self, start: int) -> list[_Row]:
        """The rows of a new configuration, and of all that it leads to, breadth-first.

        The steps are made afterwards, once it is clear that there are not too many.
        """
        numbers, limit, successors = self._numbers, self.limit, self._successors
        if len(numbers) >= limit:
            raise InconclusiveError
        numbers[start] = len(numbers)
        pending = [start]
        rows: list[_Row] = []
        for state in pending:  # grows while it is read
            changes, targets = successors.changes(state), list[int]()
            for target in successors.targets(state, changes):
                number = numbers.get(target)
                if number is None:
                    number = len(numbers)
                    if number >= limit:
                        raise InconclusiveError
                    numbers[target] = number
                    pending.append(target)
                targets.append(number)
            rows.append((changes, targets))
        return rows

    def _record(self, start: int, rows: list[_Row]) -> None:
        """Make the steps of new configurations; the first that leads to each is its origin."""
        begin = self._numbers[start]
        assert begin == len(self.configurations), "what was explored before was recorded"
        self.origins.append(None)
        new = islice(self._numbers, begin, None)
        for at, (state, (changes, targets)) in enumerate(zip(new, rows, strict=True), start=begin):
            self.configurations.append(self._successors.unpacked(state))
            steps = [
                Step(change.number, change.outcome, target, moved, change.joined)
                for change, target, moved in zip(
                    changes, targets, self._successors.moved(state, changes), strict=True
                )
            ]
            self.steps.append(steps)
            for step in steps:
                if step.target == len(self.origins):
                    self.origins.append((at, step))
        assert len(self.origins) == len(self._numbers), "each configuration has its origin"

    def possible(self, configuration: Configuration, number: int) -> tuple[int, ...]:
        """The outcomes that an active runner can have in a configuration."""
        return self._successors.possible(configuration, number)

    # -- parts of the graph -----------------------------------------------------------------

    def part(
        self,
        inside: Callable[[int, Configuration], bool],
        taken: Callable[[Step], bool] = lambda _: True,
    ) -> Steps:
        """The configurations ``inside``, with the steps between them that are ``taken``."""
        members = {at for at, each in enumerate(self.configurations) if inside(at, each)}
        return {
            at: [step for step in self.steps[at] if step.target in members and taken(step)]
            for at in sorted(members)
        }

    def going(self) -> Steps:
        """The configurations in which the run has not ended."""
        return self.part(lambda _, each: each.ended == GOING)

    def components(self, part: Steps) -> list[Steps]:
        """The strongly connected components with a step, in order of their first configuration."""
        targets = {at: {step.target for step in steps} for at, steps in part.items()}
        components: list[Steps] = []
        for members in strongly_connected(targets):
            first = members[0]
            if len(members) == 1 and first not in targets[first]:
                continue
            inner = part
            if len(members) < len(part):
                inside = set(members)
                inner = {
                    at: [step for step in part[at] if step.target in inside]
                    for at in sorted(members)
                }
            components.append(inner)
        return sorted(components, key=min)

    def just(self, component: Steps) -> bool:
        """True if runs can stay in the component for ever: nobody is active there without end."""
        waiting = -1
        for at, steps in component.items():
            waiting &= self.configurations[at].active
            for step in steps:
                waiting &= ~step.moved
            if not waiting:
                return True
        return False

    def endless(self, part: Steps) -> list[Steps]:
        """The components in which runs can stay for ever."""
        return [each for each in self.components(part) if self.just(each)]

    def fair(self, components: Iterable[Steps], inexact: Collection[int] = ()) -> bool:
        """True if a fair run can stay in one of these components for ever.

        Nobody knows which outcomes the ``inexact`` runners really have, so that they need not have
        all of them.
        """
        pending = list(components)
        while pending:
            component = pending.pop()
            if not self.just(component):
                continue
            unfair = self._unfair(component) - set(inexact)
            if not unfair:
                return True
            pending += self.components(
                {
                    at: [step for step in steps if step.number not in unfair]
                    for at, steps in component.items()
                }
            )
        return False

    def _unfair(self, component: Steps) -> set[int]:
        """The runners that end in a component, but not with each outcome that they can have there.

        To hang is no outcome that anybody must have.
        """
        taken: dict[int, set[int]] = {}
        for steps in component.values():
            for step in steps:
                taken.setdefault(step.number, set()).add(step.outcome)
        possible = {number: set(self.allowed[number]) for number in taken}
        tied = {number: set[int]() for number in taken if number in self._successors.tied}
        for at, steps in component.items() if tied else ():
            for number in {step.number for step in steps if step.number in tied}:
                tied[number].update(self.possible(self.configurations[at], number))
        possible |= tied
        return {number for number in taken if possible[number] - taken[number] - {HANG}}

    def leading_to(self, targets: Iterable[int]) -> set[int]:
        """The configurations from which steps lead to one of the targets."""
        sources: dict[int, list[int]] = {}
        for at, steps in enumerate(self.steps):
            for target in {step.target for step in steps}:
                sources.setdefault(target, []).append(at)
        leading = set(targets)
        pending = list(leading)
        while pending:
            for at in sources.get(pending.pop(), ()):
                if at not in leading:
                    leading.add(at)
                    pending.append(at)
        return leading

    # -- shortest runs ----------------------------------------------------------------------

    def path(self, at: int) -> tuple[tuple[int, int], ...]:
        """The shortest steps (runner, outcome) that lead to a configuration."""
        steps: list[tuple[int, int]] = []
        origin = self.origins[at]
        while origin is not None:
            steps.append((origin[1].number, origin[1].outcome))
            origin = self.origins[origin[0]]
        return tuple(reversed(steps))

    def lasso(self, component: Steps) -> Lasso:
        """The shortest prefix into a component, and the shortest loop from there that is a run.

        A loop is a run if each runner that is active at its beginning comes to an end, or has
        ended, on the way: the search goes over configurations with those that have not yet.
        """
        start = min(component)
        begin = (start, self.configurations[start].active)
        origins: dict[tuple[int, int], tuple[tuple[int, int], Step]] = {}
        queue = deque([begin])
        while queue:
            at = queue.popleft()
            for step in component[at[0]]:
                active = self.configurations[step.target].active
                after = (step.target, at[1] & active & ~step.moved)
                if after == (start, 0):
                    loop = [(step.number, step.outcome)]
                    while at != begin:
                        at, earlier = origins[at]
                        loop.append((earlier.number, earlier.outcome))
                    return Lasso(self.path(start), tuple(reversed(loop)))
                if after not in origins and after != begin:
                    origins[after] = (at, step)
                    queue.append(after)
        raise AssertionError("a component in which runs can stay has a loop through each of it")


# Tarjan's algorithm, without recursion. The vertices are visited depth-first and numbered in the
# order of the visits; each learns the lowest number of an open vertex that its steps lead back to.
# One that leads back to none before itself closes a component: itself and all that is open since.
# (networkx has it too, but to make a graph of so many steps takes longer than to explore them.)
#
#     0 → 1, 1 → 2, 2 → 1    visits 0, 1, 2;  2 leads back to 1, so that 1 closes {1, 2};  then {0}


def strongly_connected(targets: Mapping[int, Iterable[int]]) -> Iterator[list[int]]:
    """The strongly connected components of a graph, of which every vertex has its targets."""
    order: dict[int, int] = {}
    lowest: dict[int, int] = {}
    closed = len(targets)  # is no number of a visit
    opened: list[int] = []
    for root in targets:
        path = [] if root in order else [(root, iter(targets[root]))]
        while path:
            at, further = path[-1]
            if at not in order:
                order[at] = lowest[at] = len(order)
                opened.append(at)
            for target in further:
                if target not in order:
                    path.append((target, iter(targets[target])))
                    break
                lowest[at] = min(lowest[at], order[target])
            else:
                path.pop()
                if path:
                    before = path[-1][0]
                    lowest[before] = min(lowest[before], lowest[at])
                if lowest[at] == order[at]:
                    component: list[int] = []
                    while at not in component[-1:]:
                        component.append(opened.pop())
                        order[component[-1]] = closed
                    yield component
    assert not opened, "every vertex is in a component"
