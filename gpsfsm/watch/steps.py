"""What a run has done, as a model is told that is to write a plan that goes on."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.execution.journal_rows import RowMaker
from gpsfsm.execution.records import Kind, Record
from gpsfsm.generation.prompts.continuation import Step

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.execution.kernel import Kernel
    from gpsfsm.execution.records import Input
    from gpsfsm.watch.words import Words

__all__ = ["StepTaker"]

_POSE = "RobotPoseRunner"
_OUTCOMES = frozenset((Kind.SUCCEEDED.value, Kind.FAILED.value, Kind.STOPPED.value))


class StepTaker:
    """A watcher of a run that collects its outcomes in order, as rows of a journal tell them.

    So the steps are the same, to the letter, whether a run was watched or is read from a journal.
    """

    def __init__(self, kernel: Kernel, words: Words) -> None:
        self._words = words
        self._maker = RowMaker(kernel)
        self._nodes = len(kernel.automaton.nodes)
        self._steps: list[Step] = []
        self.pose: tuple[float, float] | None = None  # the last one that a runner has told

    def __call__(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        """Take in what has happened."""
        if any(record.kind.value in _OUTCOMES for record in records):
            self.take(self._maker.make(at_us, happened, records))

    def take(self, rows: Iterable[Row]) -> None:
        """Take in what a journal has kept."""
        for row in rows:
            if row.record and row.kind in _OUTCOMES and 0 < row.node < self._nodes:
                kind, values = Kind(row.kind), row.values
                if row.interface.rpartition("/")[2] == _POSE:
                    self.pose = _place(values) or self.pose
                record = Record(kind, row.node, data=values or None, message=row.message)
                action = f"{self._words.line(row.node)}  {self._words.node(row.node)}"
                outcome = self._words.verb(record)
                self._steps.append(Step(action, outcome, failed=kind is Kind.FAILED))

    @property
    def steps(self) -> tuple[Step, ...]:
        """The outcomes so far."""
        return tuple(self._steps)


def _place(values: Mapping[str, object]) -> tuple[float, float] | None:
    x, y = values.get("x"), values.get("y")
    if isinstance(x, int | float) and isinstance(y, int | float):
        return float(x), float(y)
    return None
