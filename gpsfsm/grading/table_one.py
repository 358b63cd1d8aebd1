"""The table of a recorded experiment: system, model, prompt and task, as the paper's Table I."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

from gpsfsm.checking.inputs import Input, read_bytes
from gpsfsm.errors import InputError, UsageError
from gpsfsm.grading.experiment import model_name
from gpsfsm.grading.grader import Grade, Graded, Grader
from gpsfsm.grading.labels import read_rows, seconds_of
from gpsfsm.grading.tables import (
    GRADES,
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
from gpsfsm.model.printable import clip, printable
from gpsfsm.progress import counted
from gpsfsm.tasks.load import load_task

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from gpsfsm.grading.experiment import Answer, Cell
    from gpsfsm.progress import Progress

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
        """True if it counts, and people gave it another grade."""
        return not self.answer.corrupted and self.answer.human not in (None, self.graded.grade)


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

    ``progress``: as for ``gpsfsm.check``.
    """
    evaluation, listed = Evaluation(folder), list(answers)
    graded = (Evaluated(answer, evaluation.grade(answer)) for answer in listed)
    return list(counted(graded, len(listed), progress, "grading"))


@dataclass(frozen=True, slots=True)
class Family:
    """Models that share rows of the table: those whose name matches one of the ``patterns``."""

    name: str
    patterns: tuple[str, ...]

    @classmethod
    def of(cls, text: str) -> Family:
        """A family as ``--family`` names it, such as ``GPT=gpt-*``. Raises UsageError."""
        name, equals, patterns = text.partition("=")
        name, listed = name.strip(), tuple(filter(None, map(str.strip, patterns.split(","))))
        if not equals or not name or not listed:
            message = f"a family is NAME=PATTERN,..., such as GPT=gpt-*, not {clip(text, 60)}"
            raise UsageError(message)
        if name == ALL:
            raise UsageError(f"a family cannot be called {ALL}: that is the row over all models")
        return cls(name, listed)

    def holds(self, model: str) -> bool:
        """True if a model belongs to the family."""
        return any(fnmatchcase(model, pattern) for pattern in self.patterns)


def table(evaluated: Sequence[Evaluated], families: Sequence[Family] = ()) -> list[Group]:
    """A row for each cell and one over the cells of each model and prompt, system, and in all.

    ``evaluated`` is in the order of the keys. A model counts in the first of the ``families`` that
    holds it; each has a row in each system.
    """
    cells = _cells(evaluated)
    rows: list[Group] = []
    for (system, model, prompt), inside in groupby(cells, key=lambda one: one[0][:3]):
        tasks = list(inside)
        rows += [Group((system, model, prompt, str(cell.task)), number) for cell, number in tasks]
        rows.append(Group((system, model, prompt, ALL), over([number for _, number in tasks])))
    for system, inside in groupby(cells, key=lambda one: one[0].system):
        of_system = list(inside)
        rows += _family_rows(system, of_system, families)
        rows.append(Group((system, ALL, ALL, ALL), _all(of_system)))
    return [*rows, Group((ALL,) * len(_COLUMNS), _all(cells))]


def _cells(evaluated: Iterable[Evaluated]) -> list[tuple[Cell, Summary]]:
    return [
        (cell, summarize(map(_entry, inside)))
        for cell, inside in groupby(evaluated, key=lambda one: one.answer.key.cell)
    ]


def _family_rows(
    system: str, cells: Sequence[tuple[Cell, Summary]], families: Sequence[Family]
) -> Iterator[Group]:
    """A row for each family of which the system has a model."""
    members: dict[Family, list[Summary]] = {}
    for cell, summary in cells:
        family = next((each for each in families if each.holds(cell.model)), None)
        if family is not None:
            members.setdefault(family, []).append(summary)
    for family in families:
        if family in members:
            yield Group((system, family.name, ALL, ALL), over(members[family]))


def written(
    evaluated: Sequence[Evaluated],
    kind: str,
    *,
    totals: bool = False,
    families: Sequence[Family] = (),
    published: Sequence[Row] = (),
) -> str:
    """The evaluation as ``md``, ``csv`` or ``json``; ``totals``: only the rows over all tasks.

    In Markdown a ``published`` table follows, beside ours.
    """
    rows = [row for row in table(evaluated, families) if not totals or row.names[-1] == ALL]
    labelled = any(one.answer.human is not None for one in evaluated)
    if kind == "csv":
        return as_csv(long_rows(_COLUMNS, rows, labelled=labelled))
    if kind == "json":
        return _json(evaluated, rows, labelled=labelled)
    lines = markdown(short_rows(_COLUMNS, rows, labelled=labelled, shares=bool(families)))
    agreement = agreement_lines(evaluated) if labelled else []
    lines += ["", "```text", *agreement, "```"] if agreement else []
    lines += ["", *comparison(published, rows_of(rows))] if published else []
    return "\n".join(lines) + "\n"


@dataclass(frozen=True, slots=True)
class Row:
    """A row over all tasks, in the numbers that a paper prints.

    ``counts`` are success, partial and failed; ``times`` are mean and deviation in hundredths of a
    second, None where no time counts. ``undecided`` answers, which no paper has, are none of these.
    """

    names: tuple[str, str, str]
    counts: tuple[int, int, int]
    times: tuple[int, int] | None
    undecided: int = 0

    @classmethod
    def of(cls, group: Group) -> Row:
        """The row of a group over all tasks."""
        system, model, prompt, _ = group.names
        success, partial, failed = (group.summary.grades.get(grade, 0) for grade in GRADES)
        times = group.summary.times
        rounded = None
        if times is not None:
            rounded = _hundredths(times.mean), _hundredths(times.deviation or 0.0)
        undecided = group.summary.grades.get(Grade.UNDECIDED, 0)
        return cls((system, model, prompt), (success, partial, failed), rounded, undecided)

    @property
    def answers(self) -> int:
        """The number of answers that count."""
        return sum(self.counts) + self.undecided

    @property
    def grades_text(self) -> str:
        """Counts and their sum, as ``46/3/0 (49)``."""
        undecided = f", {self.undecided} undecided" if self.undecided else ""
        return "/".join(map(str, self.counts)) + f" ({self.answers}{undecided})"

    @property
    def times_text(self) -> str:
        """Mean and deviation, as ``2.16 ± 0.73``; a hyphen where there are none."""
        return "-" if self.times is None else " ± ".join(f"{each / 100:.2f}" for each in self.times)

    def same_counts(self, other: Row) -> bool:
        """True if all counts are equal, and with them the number of answers."""
        return (*self.counts, self.undecided) == (*other.counts, other.undecided)

    def same_times(self, other: Row) -> bool:
        """True if mean and deviation are equal to a hundredth: both tables are rounded."""
        if self.times is None or other.times is None:
            return self.times is other.times
        return all(abs(one - two) <= 1 for one, two in zip(self.times, other.times, strict=True))


_ROW_COLUMNS = ("system", "model", "prompt", *(grade.value for grade in GRADES))
_TIME_COLUMNS = ("mean_s", "deviation_s")


def read_rows_of_table(file: str) -> list[Row]:
    """The rows of a published table: CSV with a line for each system, model and prompt.

    Columns: ``system``, ``model``, ``prompt``, perhaps ``version``, ``success``, ``partial``,
    ``failed``, and ``mean_s`` and ``deviation_s``, which may be empty. Raises InputError with the
    line that is wrong.
    """
    columns, lines = read_rows(file)
    for name in (*_ROW_COLUMNS, *_TIME_COLUMNS):
        if name not in columns:
            raise InputError(f"{file}:1: the column '{name}' is missing")
    rows: dict[tuple[str, str, str], Row] = {}
    for line, cells in lines:
        place = f"{file}:{line}"
        model = model_name(cells["model"], cells.get("version", ""))
        names = cells["system"].lower(), model, cells["prompt"]
        if names in rows:
            raise InputError(f"{place}: there is a line of {'/'.join(names)} already")
        success, partial, failed = (_count(cells[grade.value], place) for grade in GRADES)
        mean, deviation = (seconds_of(cells[name], place) for name in _TIME_COLUMNS)
        times = None
        if mean is not None and deviation is not None:
            times = _hundredths(mean), _hundredths(deviation)
        rows[names] = Row(names, (success, partial, failed), times)
    return list(rows.values())


def _count(written_text: str, place: str) -> int:
    if not written_text.isascii() or not written_text.isdecimal() or len(written_text) > 6:
        raise InputError(f"{place}: '{clip(written_text, 40)}' is not a number of answers")
    return int(written_text)


def _hundredths(seconds: float) -> int:
    return round(100 * seconds)


def rows_of(groups: Iterable[Group]) -> dict[tuple[str, str, str], Row]:
    """The rows over all tasks of a model with a prompt."""
    rows = (Row.of(one) for one in groups if one.names[-1] == ALL and ALL not in one.names[:-1])
    return {row.names: row for row in rows}


_COMPARED = ("system", "model", "prompt", "published S/P/F (N)", "time, s", "here S/P/F (N)")


def comparison(published: Sequence[Row], rows: Mapping[tuple[str, str, str], Row]) -> list[str]:
    """A published table beside ours in Markdown, and how many rows are equal."""
    shown, both = [[*_COMPARED, "time, s", "counts", "times"]], []
    for row in published:
        ours = rows.get(row.names)
        cells = [*map(printable, row.names), row.grades_text, row.times_text]
        if ours is None:
            shown.append([*cells, "no answers here", "", "", ""])
            continue
        both.append((row, ours))
        counts = "equal" if row.same_counts(ours) else "differ"
        times = "equal" if row.same_times(ours) else "differ"
        shown.append([*cells, ours.grades_text, ours.times_text, counts, times])
    counted = sum(row.same_counts(ours) for row, ours in both)
    timed = sum(row.same_times(ours) for row, ours in both)
    rows_here = f"{len(both)} of {len(published)} published rows have answers here: "
    equal = f"{counted} with equal counts, {timed} with times that are equal to 0.01 s"
    return [*markdown(shown), "", rows_here + equal]


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
    answer = one.answer
    return Entry(one.graded.grade, answer.human, answer.seconds, answer.corrupted)


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
        "corrupted": one.answer.corrupted,
    }
