"""Grading many answers: in this process, in several, or on a Ray cluster (docs/scale.md)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.grading import Grade, Graded, Grader
from gpsfsm.parallel import texts_of
from gpsfsm.workers import engine_of, run

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.checking import CheckOptions
    from gpsfsm.inputs import Input
    from gpsfsm.parallel import Text
    from gpsfsm.tasks.task import Task

__all__ = ["GradeWork", "grade_inputs"]


@dataclass(frozen=True, slots=True)
class GradeWork:
    """What workers do with an answer that is to be graded."""

    task: Task
    options: CheckOptions

    def __call__(self, item: Text) -> Graded:
        """Grade it."""
        path, text = item
        return Grader(self.task, self.options).grade(text, path)


def grade_inputs(
    inputs: Sequence[Input], task: Task, options: CheckOptions, *, jobs: int | str = 1
) -> Iterator[Graded]:
    """Grade every input, in order, where ``jobs`` says; the grades do not depend on that.

    Raises UsageError for options that make no sense, and for an engine that is not to be had.
    """
    engine = engine_of(jobs, len(inputs))
    texts = texts_of(inputs, options.limits.max_bytes, _not_read)
    return run(engine, GradeWork(task, options), texts, lost=_lost)


def _not_read(path: str, why: str) -> Graded:
    return Graded(path, Grade.UNDECIDED, False, None, f"not read: {why}")


def _lost(item: Text, how: str) -> Graded:
    reason = f"the process that graded this answer {how}"
    return Graded(item[0], Grade.UNDECIDED, False, None, reason)
