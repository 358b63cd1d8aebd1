"""Grades as a table, of answers or of groups of them, with the agreement of people."""

from __future__ import annotations

import json
import os
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import UsageError
from gpsfsm.grading.grader import Grade
from gpsfsm.grading.tables import (
    GRADES,
    Confusion,
    Entry,
    Group,
    agreement_data,
    aligned,
    as_csv,
    confusion_lines,
    confusion_of,
    group_data,
    long_rows,
    markdown,
    over,
    short_rows,
    summarize,
)
from gpsfsm.model.printable import clip, printable
from gpsfsm.streams import STDOUT, Form, form_of, to_stderr, to_stdout, write_text

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from gpsfsm.grading.grader import Graded
    from gpsfsm.grading.labels import Label, Labels

_FORMAT_VERSION = 1
_FOLDER = "folder"
_ALL = "all"
_NOTHING = "?"
_HEAD = ["path", "grade", "syntax", "theory", "reason"]


@dataclass(frozen=True, slots=True)
class GradeTable:
    """A table of grades, with the labels, if any, and the columns by which it is grouped."""

    grades: Sequence[Graded]
    labels: Labels | None = None
    by: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """The data that ``gpsfsm grade --table json`` prints (docs/tasks.md)."""
        return _data(self)

    def _repr_html_(self) -> str:
        """The table and the totals, for notebooks."""
        from gpsfsm.report._notebook import table_html

        labelled = self.labels is not None
        rows = _rows(self)
        if self.by:
            rows = short_rows(self.by, self.groups(), labelled=labelled)
        below = _totals(self.grades) + (f"\n\n{agreement_text(self)}" if labelled else "")
        return table_html(rows, below)

    def _repr_pretty_(self, printer: Any, _cycle: bool) -> None:
        """The same as text, where nothing draws: IPython on a terminal."""
        printer.text(str(self))

    def __str__(self) -> str:
        """The same for ``print``."""
        return table_text(self, "text").rstrip()

    def label(self, graded: Graded) -> Label | None:
        """The label of an answer; None if there is none."""
        return None if self.labels is None else self.labels.of(graded.path)

    def human(self, graded: Graded) -> Grade | None:
        """The grade that people gave an answer; None if there is none."""
        label = self.label(graded)
        return None if label is None else label.human

    def confusion(self) -> Confusion:
        """The comparison of the grades with those that people gave."""
        return confusion_of((self.human(one), one.grade) for one in self.grades)

    def groups(self) -> list[Group]:
        """The groups, sorted by name, followed by one for all answers."""
        entries: dict[tuple[str, ...], list[Entry]] = {}
        for graded in self.grades:
            label = self.label(graded)
            seconds = None if label is None else label.seconds
            names = tuple(_name(column, graded, label) for column in self.by)
            entries.setdefault(names, []).append(Entry(graded.grade, self.human(graded), seconds))
        groups = [
            Group(names, summarize(entries[names])) for names in sorted(entries, key=_natural)
        ]
        names = (_ALL, *("" for _ in self.by[1:]))
        return [*groups, Group(names, over([group.summary for group in groups]))]


def columns_of(by: str | None, labels: Labels | None, table: str = "text") -> tuple[str, ...]:
    """The columns that ``--by`` names: the folder, or columns of the labels. Raises UsageError."""
    if by is None:
        return ()
    if table == "jsonl":
        raise UsageError("--by cannot be used with jsonl, which has a line for each answer")
    columns = tuple(name.strip() for name in by.split(","))
    label_columns = () if labels is None else labels.columns
    for name in columns:
        if name != _FOLDER and name not in label_columns:
            alternative = (
                f"or one of {', '.join(label_columns)}"
                if label_columns
                else "or name a file with --labels"
            )
            raise UsageError(
                f"--by: there is no column '{clip(name, 40)}'; write folder {alternative}"
            )
    return columns


def _name(column: str, graded: Graded, label: Label | None) -> str:
    if column == _FOLDER:
        return os.path.dirname(graded.path) or "."  # noqa: PTH120  (keeps a leading ./)
    return _NOTHING if label is None else label.cells[column] or _NOTHING


def _natural(names: tuple[str, ...]) -> tuple[tuple[int, str], ...]:
    """Numbers in the order of their values, before everything else."""
    return tuple(
        (int(name), "") if name.isdecimal() and len(name) < 10 else (1 << 40, name)
        for name in names
    )


def table_text(all_of_it: GradeTable, table: str) -> str:
    """The grades, or the groups of them, as a table of this kind; CSV has only the table."""
    labelled = all_of_it.labels is not None
    if table == "jsonl":
        return "".join(_line(all_of_it, graded) for graded in all_of_it.grades)
    if table == "json":
        return json.dumps(all_of_it.to_dict(), indent=2, ensure_ascii=True) + "\n"
    if table == "csv":
        if all_of_it.by:
            return as_csv(long_rows(all_of_it.by, all_of_it.groups(), labelled=labelled))
        return as_csv(_rows(all_of_it))
    if not all_of_it.grades:
        return "no plan was found\n"
    lines = []
    if all_of_it.by:
        rows = short_rows(all_of_it.by, all_of_it.groups(), labelled=labelled)
        lines += markdown(rows) if table == "md" else aligned(rows)
    else:
        lines += markdown(_rows(all_of_it)) if table == "md" else _text(all_of_it.grades)
    text = "\n".join([*lines, "", _totals(all_of_it.grades)]) + "\n"
    if labelled:
        agreement = agreement_text(all_of_it)
        text += f"\n```text\n{agreement}```\n" if table == "md" else f"\n{agreement}"
    return text


def streamed(
    grades: Iterable[Graded], labels: Labels | None, table: str, output_file: str
) -> Iterator[Graded]:
    """The grades; of JSON lines for standard output each comes after its line is there."""
    nothing_else = GradeTable((), labels)
    for graded in grades:
        if _streams(table, output_file):
            to_stdout(_line(nothing_else, graded), Form.JSON)
        yield graded


def write_grades(all_of_it: GradeTable, table: str, output_file: str) -> None:
    """Write what ``streamed`` has not; where it is for programs, the agreement is a message."""
    if not _streams(table, output_file):
        write_text(table_text(all_of_it, table), output_file, form=form_of(table))
    if all_of_it.labels is not None and table in ("csv", "jsonl"):
        to_stderr(agreement_text(all_of_it))


def _streams(table: str, output_file: str) -> bool:
    return table == "jsonl" and output_file == STDOUT


def _line(all_of_it: GradeTable, graded: Graded) -> str:
    return json.dumps({"version": _FORMAT_VERSION, **_answer(all_of_it, graded)}) + "\n"


def agreement_text(all_of_it: GradeTable) -> str:
    """The agreement with people in words, with the confusion matrix and all differences."""
    lines = confusion_lines(all_of_it.confusion())
    for graded in all_of_it.grades:
        human = all_of_it.human(graded)
        if human not in (None, graded.grade):
            path = printable(graded.path)
            lines.append(f"{path}: people say {human}, gpsfsm {graded.grade.value}")
    return "\n".join(lines) + "\n"


def _rows(all_of_it: GradeTable) -> list[list[str]]:
    """A head and a row for each answer."""
    head = list(_HEAD)
    if all_of_it.labels is not None:
        head.insert(2, "human")
    return [head, *(_cells(all_of_it, graded) for graded in all_of_it.grades)]


def _cells(all_of_it: GradeTable, graded: Graded) -> list[str]:
    right = {True: "right", False: "wrong", None: "undecided"}
    path, reason = printable(graded.path), printable(graded.reason)
    cells = [path, graded.grade.value, right[graded.syntax], right[graded.theory], reason]
    if all_of_it.labels is not None:
        cells.insert(2, all_of_it.human(graded) or _NOTHING)
    return cells


def _text(grades: Sequence[Graded]) -> list[str]:
    lines = []
    for graded in grades:
        lines.append(f"{graded.grade.value:<9}  {printable(graded.path)}")
        if graded.grade is not Grade.SUCCESS:
            lines.append(f"{'':<9}  {printable(graded.reason)}")
    return lines


def _totals(grades: Sequence[Graded]) -> str:
    counts = Counter(graded.grade for graded in grades)
    parts = [f"{counts[grade]} {grade.value}" for grade in GRADES]
    if counts[Grade.UNDECIDED]:
        parts.append(f"{counts[Grade.UNDECIDED]} undecided")
    return f"{len(grades)} answer{'s' if len(grades) != 1 else ''}: {', '.join(parts)}"


def _data(all_of_it: GradeTable) -> dict[str, Any]:
    counts = Counter(graded.grade for graded in all_of_it.grades)
    labelled = all_of_it.labels is not None
    content: dict[str, Any] = {
        "version": _FORMAT_VERSION,
        "answers": [_answer(all_of_it, graded) for graded in all_of_it.grades],
        "totals": {grade.value: counts[grade] for grade in Grade},
    }
    if all_of_it.by:
        *groups, over_all = all_of_it.groups()
        data = [group_data(all_of_it.by, group, labelled=labelled) for group in groups]
        content["groups"] = data
        whole = group_data(all_of_it.by, over_all, labelled=labelled)
        content["all"] = {name: value for name, value in whole.items() if name != "group"}
    if labelled:
        content["agreement"] = agreement_data(all_of_it.confusion())
    return content


def _answer(all_of_it: GradeTable, graded: Graded) -> dict[str, Any]:
    data = graded.to_dict()
    if all_of_it.labels is not None:
        data["human"] = all_of_it.human(graded)
    return data
