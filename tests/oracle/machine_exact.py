"""Exact runs of a machine, by brute force: those that enter none of some nodes (semantics, 9.6)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from tests.oracle.machines import (
    COMPLETED,
    GAVE_UP,
    Machine,
    Name,
    Step,
    _Facts,
    _is_run,
    _parts,
)

if TYPE_CHECKING:
    from collections.abc import Iterable

    import networkx as nx


@dataclass
class _ExactFacts(_Facts):
    """The same about the runs that enter none of some nodes (9.6); there may be none."""

    inexact: frozenset[Name] = frozenset()

    def __post_init__(self) -> None:
        self.first = self.machine.begin()
        self.steps = {}
        if not self.enters(self.machine.first):
            self.steps = self.machine.reach([self.first], lambda step: not self.enters(step))
        self.parts = [part for part in _parts(self._open(self.steps)) if _is_run(part)]

    def enters(self, step: Step) -> bool:
        """True if a step triggers, feeds or comes to one of these nodes."""
        machine, after = self.machine, step.after
        ends = {"complete": COMPLETED, "give_up": GAVE_UP}
        return any(
            (name in machine.number and machine.number[name] in step.started)
            or (
                name in machine.join_number
                and (
                    machine.join_number[name] in step.moved
                    or bool(after.arrived[machine.join_number[name]])
                )
            )
            or ends.get(machine.kinds[name], "") == after.end
            or machine.kinds[name] == "start"
            for name in self.inexact
        )

    def orphans(self) -> list[Name]:
        return super().orphans() if self.steps else []

    def fewest_failures(self) -> int | None:
        return super().fewest_failures() if self.steps else None


def exact_facts(
    graph: nx.MultiDiGraph[Any], inexact: Iterable[Name], *, most: int = 20_000
) -> tuple[set[str], list[Name], int | None]:
    """How exact runs end, what they leave running at completion, and their fewest failures."""
    facts = _ExactFacts(Machine(graph, most=most), inexact=frozenset(inexact))
    return facts.ends(), facts.orphans(), facts.fewest_failures()
