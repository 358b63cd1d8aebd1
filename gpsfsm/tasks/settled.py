"""Instances that are settled at an instant: over, or never to be triggered any more.

A moment of a run is told by the node that is triggered there. What can still happen then, and so
get between one event and the next, follows from the connections alone, whatever the outcomes:

- ``needed``: the outcomes without which a node is never triggered. A node that waits for all of
  its inputs needs what any of them needs, any other what all of them need.
- ``settled``: the nodes that are over once a node is triggered, or cannot come any more since
  they need the other outcome of an instance that is over. It is inherited in the same way.

Two instances can be active at once only if neither is settled when the other is triggered.

Example: in ``A; recovery(B); C`` the instance C is triggered by the success of A, after which B
cannot come, or by that of B. So A and B are settled when C is triggered, in either case, and no
two of the three are ever active at once.

Sets are masks by node. Where one event leads to one node and nothing waits, one instance is active
at a time, and no masks are needed.
"""

from __future__ import annotations

from functools import reduce
from operator import and_, or_
from typing import TYPE_CHECKING

from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import Event
from gpsfsm.tasks.ltlf import TooLarge

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.model.automaton import Automaton

_MAX_NODES = 2_000
_OTHER = {Event.SUCCEEDED: Event.FAILED, Event.FAILED: Event.SUCCEEDED}


class Settled:
    """The instances that can come between events of one automaton. Raises TooLarge."""

    def __init__(self, automaton: Automaton) -> None:
        self._automaton = automaton
        self.alone = _alone(automaton)
        if self.alone:
            return
        size = len(automaton.nodes)
        if size > _MAX_NODES:
            raise TooLarge
        self._runners = sum(1 << node.index for node in automaton.runners)
        self._needed = {event: [0] * size for event in _OTHER}
        self._need()
        self._needing = {event: _transposed(rows) for event, rows in self._needed.items()}
        self._settled = [0] * size
        for node in automaton.order:
            inputs = automaton.inputs[node]
            if inputs:
                self._settled[node] = self._joined(node, list(map(self._settled_by, inputs)))
        self._settling = _transposed(self._settled)

    def beside(self, node: int) -> int:
        """The instances of which an event can come while this one is active."""
        if self.alone:
            return 0
        return self._runners & ~(self._settled[node] | self._settling[node] | 1 << node)

    def before(self, signal: Signal, join: int) -> int:
        """The instances of which an event can come between an input of a join and its success."""
        if self.alone:
            return 0
        return self._runners & ~(self._settled_by(signal) | self._settling[join])

    def open_at(self, node: int) -> int:
        """The instances of which an event can come at the instant of the node or later."""
        return 0 if self.alone else self._runners & ~self._settled[node]

    def excluded(self, event: Event, node: int) -> int:
        """The instances of which this outcome cannot come if the node is triggered."""
        other = _OTHER.get(event)
        return 0 if self.alone or other is None else self._needed[other][node]

    def _need(self) -> None:
        for node in self._automaton.order:
            inputs = self._automaton.inputs[node]
            for event, needed in self._needed.items() if inputs else ():
                sets = [
                    needed[each.node] | (1 << each.node if each.event is event else 0)
                    for each in inputs
                ]
                needed[node] = self._joined(node, sets)

    def _joined(self, node: int, sets: Sequence[int]) -> int:
        """The union of the sets of its inputs if a node waits for all, else the intersection."""
        waits = self._automaton.nodes[node].need == len(sets)
        return reduce(or_ if waits else and_, sets)

    def _settled_by(self, signal: Signal) -> int:
        """The nodes that are settled right after an event."""
        node, event = signal
        settled = self._settled[node]
        if event in _OTHER:
            settled |= self._needing[_OTHER[event]][node] | 1 << node
        return settled


def _alone(automaton: Automaton) -> bool:
    """True if one instance is active at a time: each event leads to one node, and none waits."""
    single = all(len(targets) == 1 for targets in automaton.outputs.values())
    waits = any(node.need > 1 for node in automaton.nodes)
    chained = any(event is Event.STARTED for _, event, _ in automaton.edges)
    return single and not waits and not chained and len(automaton.starts) == 1


def _transposed(rows: Sequence[int]) -> list[int]:
    """The matrix of bits with rows and columns exchanged.

    Rows of the bits {1, 2}, {2} and {} have the columns {}, {0} and {0, 1}.
    """
    size = len(rows)
    lines = [format(row, f"0{size}b")[::-1] for row in reversed(rows)]
    return [int("".join(column), 2) for column in zip(*lines, strict=True)]


def waits(automaton: Automaton, node: int) -> bool:
    """True if a node is triggered by the last of several inputs."""
    kind, need = automaton.nodes[node].kind, automaton.nodes[node].need
    return kind is NodeKind.JOIN and need == len(automaton.inputs[node]) > 1
