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
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.analysis.options import Inconclusive
from gpsfsm.compile.instants import (
    FAILED,
    GOING,
    SUCCEEDED,
    Configuration,
    Instants,
)
from gpsfsm.model.event import Outcome

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Iterator, Sequence

    from gpsfsm.model.automaton import Automaton, Tie

MAX_CONFIGURATIONS = 50_000
"""Configurations that are explored; a machine with more is undecided."""

HANG = 3
"""A runner hangs: a step beside SUCCEEDED and FAILED that emits nothing."""

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


class Exploration:
    """The configurations that the runs of a machine reach, and the steps between them.

    ``allowed``: per runner the outcomes that it can have, if its tie leaves it any choice. Raises
    Inconclusive if there are more than ``limit`` configurations. The first ``reached`` are those of
    runs; behind them is what would come of ``others``: outcomes (configuration, runner, outcome)
    that are compared with only.
    """

    def __init__(
        self,
        automaton: Automaton,
        allowed: Sequence[Collection[Outcome]],
        *,
        ties: Sequence[Tie] = (),
        limit: int = MAX_CONFIGURATIONS,
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
        self._numbers: dict[Configuration, int] = {}
        self.explore(self.instants.first().configuration)
        self.reached = len(self.configurations)

    def instead(self, at: int, number: int, outcome: int) -> int:
        """The configuration that this outcome leads to, whether it can occur or not."""
        for step in self.steps[at]:
            if (step.number, step.outcome) == (number, outcome):
                return step.target
        key = (at, number, outcome)
        if key not in self.others:
            instant = self.instants.after(self.configurations[at], number, outcome)
            self.others[key] = self.explore(instant.configuration)
        return self.others[key]

    def explore(self, start: Configuration) -> int:
        """The number of a configuration; what it leads to is explored too."""
        first = self._number(start, None)
        at = first
        while at < len(self.configurations):
            if at >= len(self.steps):
                self.steps.append([])
                self._expand(at)
            at += 1
        return first

    def _number(self, configuration: Configuration, origin: tuple[int, Step] | None) -> int:
        number = self._numbers.get(configuration)
        if number is None:
            number = self._numbers[configuration] = len(self.configurations)
            if number >= self.limit:
                raise Inconclusive
            self.configurations.append(configuration)
            self.origins.append(None)
            if origin is not None:
                self.origins[number] = (origin[0], origin[1]._replace(target=number))
        return number

    def _expand(self, at: int) -> None:
        configuration = self.configurations[at]
        for number in bits(configuration.active):
            for outcome in self.possible(configuration, number):
                if outcome == HANG:
                    step = Step(number, HANG, 0, 1 << number, 0)
                    after = self.instants.hanging(configuration, number)
                else:
                    instant = self.instants.after(configuration, number, outcome)
                    step = Step(number, outcome, 0, instant.moved, instant.joined)
                    after = instant.configuration
                target = self._number(after, (at, step))
                self.steps[at].append(step._replace(target=target))

    def possible(self, configuration: Configuration, number: int) -> tuple[int, ...]:
        """The outcomes that an active runner can have in a configuration."""
        fixed = self.instants.fixed(configuration, number)
        if fixed is None:
            return self.allowed[number]
        return tuple(each for each in self.allowed[number] if each in (fixed, HANG))

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
        import networkx

        graph: networkx.DiGraph[int] = networkx.DiGraph()
        graph.add_edges_from((at, step.target) for at, steps in part.items() for step in steps)
        components: list[Steps] = []
        for members in networkx.strongly_connected_components(graph):
            inner = {
                at: [step for step in part[at] if step.target in members] for at in sorted(members)
            }
            if any(inner.values()):
                components.append(inner)
        return sorted(components, key=min)

    def just(self, component: Steps) -> bool:
        """True if runs can stay in the component for ever: nobody is active there without end."""
        waiting = -1
        for at, steps in component.items():
            waiting &= self.configurations[at].active
            for step in steps:
                waiting &= ~step.moved
        return not waiting

    def endless(self, part: Steps) -> list[Steps]:
        """The components in which runs can stay for ever."""
        return [each for each in self.components(part) if self.just(each)]

    def fair(self, part: Steps) -> bool:
        """True if a fair run can stay in this part for ever."""
        pending = self.components(part)
        while pending:
            component = pending.pop()
            if not self.just(component):
                continue
            taken: dict[int, set[int]] = {}
            possible: dict[int, set[int]] = {}
            for at, steps in component.items():
                for step in steps:
                    taken.setdefault(step.number, set()).add(step.outcome)
                    outcomes = self.possible(self.configurations[at], step.number)
                    possible.setdefault(step.number, set()).update(outcomes)
            unfair = {number for number in taken if possible[number] - taken[number] - {HANG}}
            if not unfair:
                return True
            pending += self.components(
                {
                    at: [step for step in steps if step.number not in unfair]
                    for at, steps in component.items()
                }
            )
        return False

    def leading_to(self, targets: Iterable[int], part: Steps | None = None) -> set[int]:
        """The configurations from which steps, of the part, lead to one of the targets."""
        sources: dict[int, list[int]] = {}
        rows = enumerate(self.steps) if part is None else part.items()
        for at, steps in rows:
            for step in steps:
                sources.setdefault(step.target, []).append(at)
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


def bits(number: int) -> Iterator[int]:
    """The places of the bits of a number, in ascending order."""
    while number:
        lowest = number & -number
        yield lowest.bit_length() - 1
        number ^= lowest


def still(configuration: Configuration) -> bool:
    """True if nothing more can happen."""
    return not configuration.active
