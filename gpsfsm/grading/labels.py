"""Labels: what people say of answers, in a CSV file."""

from __future__ import annotations

import csv
import io
import os
from dataclasses import dataclass
from math import isfinite
from typing import TYPE_CHECKING

from gpsfsm.errors import InputError
from gpsfsm.files import read_whole
from gpsfsm.grading.tables import GRADES
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from gpsfsm.grading.grader import Grade

MAX_BYTES = 64 << 20
"""Files that are larger are not read."""

_GRADE_COLUMNS = ("human", "label", "grade")
_TIME_COLUMNS = ("seconds", "latency_s")
_NAMES = {name: grade for grade in GRADES for name in (grade.value, grade.value[0])}
_UNKNOWN = ("", "?")
_MAX_SECONDS = 1e9


@dataclass(frozen=True, slots=True)
class Label:
    """A line of the file: the human grade and the time, if they are known, and all cells."""

    line: int
    human: Grade | None
    seconds: float | None
    cells: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Labels:
    """``columns`` as the first line names them; labels by the real path of the answer."""

    columns: tuple[str, ...]
    by_path: Mapping[str, Label]

    def of(self, path: str) -> Label | None:
        """The label of the answer in this file, if there is one."""
        return self.by_path.get(os.path.realpath(path))


def load_labels(file: str) -> Labels:
    """Read a labels file; paths in it start at its folder.

    It is CSV with the column ``path``, and ``human``, ``label`` or ``grade``: S, P, F or success,
    partial, failed; ``?`` or nothing is unknown. ``seconds`` or ``latency_s`` is how long the model
    took. Raises InputError with the line that is wrong.
    """
    columns, rows = read_rows(file)
    graded = next((name for name in _GRADE_COLUMNS if name in columns), None)
    timed = next((name for name in _TIME_COLUMNS if name in columns), None)
    if "path" not in columns or graded is None:
        wanted = f"'path' and one of {', '.join(_GRADE_COLUMNS)}"
        raise InputError(f"{file}:1: the first line must name the columns {wanted}")
    by_path: dict[str, Label] = {}
    for line, cells in rows:
        place = _place(file, cells["path"])
        if place in by_path:
            message = (
                f"the path '{clip(cells['path'], 80)}' is already in line {by_path[place].line}"
            )
            raise InputError(f"{file}:{line}: {message}")
        human = _grade(cells[graded], f"{file}:{line}")
        seconds = None if timed is None else seconds_of(cells[timed], f"{file}:{line}")
        by_path[place] = Label(line, human, seconds, cells)
    return Labels(columns, by_path)


def read_rows(file: str) -> tuple[tuple[str, ...], Iterator[tuple[int, dict[str, str]]]]:
    """The columns of a CSV file, and its lines: the number, and the cells by column.

    Cells that a line lacks are empty, those beyond the columns are left out. Raises InputError,
    also later, from the iterator.
    """
    try:
        text = read_whole(file, MAX_BYTES).decode("utf-8-sig")
    except InputError as error:
        raise InputError(f"{file}: {error}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{file}: this is not UTF-8 text") from error
    rows = csv.DictReader(io.StringIO(text, newline=""), restval="", strict=True)
    try:
        columns = tuple(rows.fieldnames or ())
    except csv.Error as error:
        raise InputError(f"{file}:{rows.line_num}: this is not CSV: {error}") from error
    return columns, _cells(file, columns, rows)


def seconds_of(written: str, place: str) -> float | None:
    """A time as it is written; None if there is none. Raises InputError that begins with place."""
    if written.strip() in _UNKNOWN:
        return None
    try:
        seconds = float(written)
    except ValueError:
        seconds = -1.0
    if not isfinite(seconds) or not 0 <= seconds <= _MAX_SECONDS:
        message = f"'{clip(written, 40)}' is not a time; write seconds"
        raise InputError(f"{place}: {message}, such as 2.5")
    return seconds


def _cells(
    file: str, columns: tuple[str, ...], rows: csv.DictReader[str]
) -> Iterator[tuple[int, dict[str, str]]]:
    try:
        for row in rows:
            yield rows.line_num, {name: row[name] for name in columns}
    except csv.Error as error:
        raise InputError(f"{file}:{rows.line_num}: this is not CSV: {error}") from error


def _grade(written: str, place: str) -> Grade | None:
    name = written.strip().lower()
    if name in _UNKNOWN:
        return None
    if name not in _NAMES:
        raise InputError(f"{place}: '{clip(name, 40)}' is not a grade; write S, P or F")
    return _NAMES[name]


def _place(file: str, path: str) -> str:
    try:
        return os.path.realpath(os.path.join(os.path.dirname(file), path))  # noqa: PTH118, PTH120
    except ValueError:  # a NUL character: no answer has such a path
        return path
