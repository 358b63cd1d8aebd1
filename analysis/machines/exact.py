"""The exact part of an exploration: what runs reach without entering an inexact node.

An over-approximated automaton has all runs of its file, and perhaps others. Each of the others
enters one of the automaton's ``inexact`` nodes: it triggers such a runner, brings an input to such
a join, or comes to such an end. So whatever a run within the exact part shows, the file can do;
what only other runs show is a *may* (semantics, 9.6). Once such a node has been entered, nothing
that comes later is exact: what it stands for may have written or sent something.

    start → A;  A SUCCEEDED → B;  A FAILED → choice;  choice FAILED → stuck        inexact: choice
    configurations   0: A active   1: B active   2: choice active   3: nothing active
    exact            0 and 1: that B runs is proved, that the machine gets stuck is a may
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.machines.search import Exploration
from gpsfsm.compile.instants import COMPLETED, GAVE_UP
from gpsfsm.model.automaton import NodeKind

if TYPE_CHECKING:
    from collections.abc import Collection

    from gpsfsm.analysis.machines.search import Step
    from gpsfsm.compile.instants import Configuration, Instant

NOWHERE = -1
"""The number of a configuration that is not in the exact part."""


class ExactPart(Exploration):
    """The exact part of a whole exploration, with numbers of its own, breadth-first.

    ``sources`` are the numbers that its configurations have in the whole. ``reached`` is 0 where
    an inexact node is entered at the first instant.
    """

    def __init__(self, whole: Exploration, inexact: Collection[int]) -> None:
        self.automaton, self.instants = whole.automaton, whole.instants
        self.allowed_outcomes, self.allowed = whole.allowed_outcomes, whole.allowed
        self._whole, self._successors = whole, whole._successors
        self.configurations: list[Configuration] = []
        self.steps: list[list[Step]] = []
        self.origins: list[tuple[int, Step] | None] = []
        self.sources: list[int] = []
        self._own: dict[int, int] = {}
        self._runners = self._inputs = self._joins = 0
        self._ends: set[int] = set()
        self._everything = False
        for node in inexact:
            self._leave_out(node)
        if not self._enters(self.instants.first()):
            self._add(0)
        self.reached = len(self.configurations)

    def _leave_out(self, node: int) -> None:
        """Count a node among those that no exact run enters."""
        kind = self.automaton.nodes[node].kind
        if kind is NodeKind.RUNNER:
            self._runners |= 1 << self.automaton.runner_number(node)
        elif kind is NodeKind.JOIN:
            place = self.instants.place[node]
            self._joins |= 1 << place
            self._inputs |= self.instants.inputs_of[place]
        elif kind is NodeKind.START:
            self._everything = True
        else:
            self._ends.add(COMPLETED if kind is NodeKind.COMPLETE else GAVE_UP)

    def instead(self, at: int, number: int, outcome: int) -> int:
        """The configuration that this outcome leads to; NOWHERE if that is not exact."""
        instant = self.instants.after(self.configurations[at], number, outcome)
        if self._enters(instant):
            return NOWHERE
        return self._add(self._whole.instead(self.sources[at], number, outcome))

    def _enters(self, instant: Instant) -> bool:
        """True if something inexact is entered at an instant."""
        return bool(instant.joined & self._joins or instant.triggered & self._runners)

    def _add(self, start: int) -> int:
        """The own number of a configuration, which is added with all that it leads to."""
        if not self._is_exact(start):
            return NOWHERE
        if start in self._own:
            return self._own[start]
        self._own[start] = len(self._own)
        self.origins.append(None)
        pending = [start]
        for at in pending:  # grows while it is read
            steps: list[Step] = []
            for step in self._whole.steps[at]:
                if step.moved & self._runners or step.joined & self._joins:
                    continue
                if not self._is_exact(step.target):
                    continue
                if step.target not in self._own:
                    self._own[step.target] = len(self._own)
                    pending.append(step.target)
                    own = step._replace(target=self._own[step.target])
                    self.origins.append((self._own[at], own))
                steps.append(step._replace(target=self._own[step.target]))
            self.configurations.append(self._whole.configurations[at])
            self.sources.append(at)
            self.steps.append(steps)
        assert len(self.configurations) == len(self._own) == len(self.origins)
        return self._own[start]

    def _is_exact(self, at: int) -> bool:
        each = self._whole.configurations[at]
        inside = (each.active | each.hanging) & self._runners or each.arrived & self._inputs
        return not (self._everything or inside or each.ended in self._ends)
