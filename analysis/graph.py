"""Where signals lead when joins are followed."""

from __future__ import annotations

from gpsfsm.model.automaton import Automaton, NodeKind, Signal
from gpsfsm.model.event import Event

__all__ = ["Leads"]


class Leads:
    """Tells of a signal whether it leads, through joins, to a runner or to completion."""

    def __init__(self, automaton: Automaton) -> None:
        self._automaton = automaton
        self._to_runner = self._joins_before(NodeKind.RUNNER)
        self._to_complete = self._joins_before(NodeKind.COMPLETE)

    def to_runner(self, signal: Signal | None) -> bool:
        """Whether some runner instance is connected to the signal, perhaps through joins."""
        return self._leads(signal, NodeKind.RUNNER, self._to_runner)

    def to_complete(self, signal: Signal | None) -> bool:
        """Whether ``complete`` is connected to the signal, perhaps through joins."""
        return self._leads(signal, NodeKind.COMPLETE, self._to_complete)

    def dangles(self, signal: Signal) -> bool:
        """Whether the event is connected to no runner instance and not to ``complete``."""
        return not self.to_runner(signal) and not self.to_complete(signal)

    def _leads(self, signal: Signal | None, kind: NodeKind, joins: frozenset[int]) -> bool:
        if signal is None:
            return False
        targets = self._automaton.outputs.get(signal, ())
        nodes = self._automaton.nodes
        return any(nodes[target].kind is kind or target in joins for target in targets)

    def _joins_before(self, kind: NodeKind) -> frozenset[int]:
        """The joins from which a node of this kind can be reached through joins only."""
        nodes, inputs = self._automaton.nodes, self._automaton.inputs
        found: set[int] = set()
        pending = [node.index for node in nodes if node.kind is kind]
        while pending:
            for source, event in inputs[pending.pop()]:
                if (
                    nodes[source].kind is NodeKind.JOIN
                    and event is Event.SUCCEEDED
                    and source not in found
                ):
                    found.add(source)
                    pending.append(source)
        return frozenset(found)
