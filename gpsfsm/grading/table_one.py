"""The table of a recorded experiment: system, model, prompt and task, as the paper's Table I."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

from gpsfsm.checking.inputs import Input, read_bytes
from gpsfsm.errors import InputError
from gpsfsm.grading.grader import Grade, Graded, Grader
from gpsfsm.grading.tables import (
    Entry,
    Group,
    Summary,
    agreement_data,
    as_csv,
    confusion_lines,
    group_data,
    long_rows,
    markdown,
    over,
    short_rows,
    summarize,
)
from gpsfsm.model.printable import printable
from gpsfsm.streams import counted
from gpsfsm.tasks.load import load_task

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from gpsfsm.grading.experiment import Answer, Cell
    from gpsfsm.streams import Progress

ALL = "all"
"""What a row over several groups has in place of what they differ in."""

_COLUMNS = ("system", "model", "prompt", "task")
_NO_FILE = "there is no file: no plan was found in the answer"
_VERSION = 1


@dataclass(frozen=True, slots=True)
class Evaluated:
    """An answer and its grade."""

    answer: Answer
    graded: Graded

    @property
    def differs(self) -> bool:
        """True if people gave it another grade."""
        return self.answer.human not in (None, self.graded.grade)


@dataclass(slots=True)
class Evaluation:
    """Grades answers against the task files ``taskN.yaml`` of a folder.

    Models repeat themselves: equal texts for the same task are graded once.
    """

    folder: str
    _graders: dict[int, Grader] = field(default_factory=dict)
    _graded: dict[tuple[int, bytes], Graded] = field(default_factory=dict)

    def grade(self, answer: Answer) -> Graded:
        """Grade one answer. Raises InputError if there is no task file for it."""
        task = answer.key.cell.task
        grader = self._graders.get(task)
        if grader is None:
            file = Path(self.folder) / f"task{task}.yaml"
            if not file.exists():
                raise InputError(f"{file}: there is no such file: what did task {task} ask for?")
            grader = self._graders[task] = Grader(load_task(file))
        if answer.path is None:
            return Graded("", Grade.FAILED, False, False, _NO_FILE)
        try:
            source = answer.line or Input(answer.path)
            text = read_bytes(source, grader.options.limits.max_bytes)
        except InputError as error:
            return Graded(answer.path, Grade.UNDECIDED, False, None, f"not read: {error}")
        if (task, text) not in self._graded:
            self._graded[task, text] = grader.grade(text, answer.path)
        return replace(self._graded[task, text], path=answer.path)


def evaluate(
    answers: Iterable[Answer], folder: str, *, progress: Progress | None = None
) -> list[Evaluated]:
    """Grade the answers against the task files in ``folder``; raises InputError, ConfigError.

    ``progress(done, total)`` is called after each answer.
    """
    evaluation, listed = Evaluation(folder), list(answers)
    graded = (Evaluated(answer, evaluation.grade(answer)) for answer in listed)
    return list(counted(graded, len(listed), progress))


def table(evaluated: Sequence[Evaluated]) -> list[Group]:
    """A row for each cell and one over the cells of each model and prompt, system, and in all.

    ``evaluated`` is in the order of the keys.
    """
    cells = [
        (cell, summarize(map(_entry, inside)))
        for cell, inside in groupby(evaluated, key=lambda one: one.answer.key.cell)
    ]
    rows: list[Group] = []
    for (system, model, prompt), inside in groupby(cells, key=lambda one: one[0][:3]):
        tasks = list(inside)
        rows += [Group((system, model, prompt, str(cell.task)), number) for cell, number in tasks]
        rows.append(Group((system, model, prompt, ALL), over([number for _, number in tasks])))
    for system, inside in groupby(cells, key=lambda one: one[0].system):
        rows.append(Group((system, ALL, ALL, ALL), over([number for _, number in inside])))
    return [*rows, Group((ALL,) * len(_COLUMNS), _all(cells))]


def written(evaluated: Sequence[Evaluated], kind: str, *, totals: bool = False) -> str:
    """The evaluation as ``md``, ``csv`` or ``json``; ``totals``: only the rows over all tasks."""
    rows = [row for row in table(evaluated) if not totals or row.names[-1] == ALL]
    labelled = any(one.answer.human is not None for one in evaluated)
    if kind == "csv":
        return as_csv(long_rows(_COLUMNS, rows, labelled=labelled))
    if kind == "json":
        return _json(evaluated, rows, labelled=labelled)
    lines = markdown(short_rows(_COLUMNS, rows, labelled=labelled))
    agreement = agreement_lines(evaluated) if labelled else []
    return "\n".join([*lines, *(["", "```text", *agreement, "```"] if agreement else [])]) + "\n"


def agreement_lines(evaluated: Sequence[Evaluated]) -> list[str]:
    """The agreement of the grades with those of people, and where they differ."""
    lines = confusion_lines(_all_of(evaluated).confusion)
    for one in filter(lambda one: one.differs, evaluated):
        human = one.answer.human.value if one.answer.human else ""
        who = one.graded.path or f"{'/'.join(map(str, one.answer.key.cell))}"
        lines.append(f"{printable(who)}: people say {human}, gpsfsm {one.graded.grade.value}")
    return lines


def _all_of(evaluated: Sequence[Evaluated]) -> Summary:
    return summarize(map(_entry, evaluated))


def _all(cells: Sequence[tuple[Cell, Summary]]) -> Summary:
    return over([number for _, number in cells])


def _entry(one: Evaluated) -> Entry:
    return Entry(one.graded.grade, one.answer.human, one.answer.seconds)


def _json(evaluated: Sequence[Evaluated], rows: Sequence[Group], *, labelled: bool) -> str:
    content: dict[str, object] = {
        "version": _VERSION,
        "groups": [group_data(_COLUMNS, row, labelled=labelled) for row in rows],
        "answers": [_answer_data(one) for one in evaluated],
    }
    if labelled:
        content["agreement"] = agreement_data(_all_of(evaluated).confusion)
    return json.dumps(content, indent=2, ensure_ascii=True) + "\n"


def _answer_data(one: Evaluated) -> dict[str, object]:
    cell, human = one.answer.key.cell, one.answer.human
    return {
        **cell._asdict(),
        "iteration": one.answer.key.iteration,
        "path": one.answer.path,
        "grade": one.graded.grade.value,
        "syntax": one.graded.syntax,
        "theory": one.graded.theory,
        "reason": one.graded.reason,
        "human": None if human is None else human.value,
        "seconds": one.answer.seconds,
    }
