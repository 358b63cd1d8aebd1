"""Tables of grades, and how far they agree with those that people gave."""

from __future__ import annotations

import csv
import io
import json
import os
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.errors import InputError
from gpsfsm.grading import Grade
from gpsfsm.inputs import read_file
from gpsfsm.model.printable import printable

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.grading import Graded

__all__ = ["Agreement", "agreement_of", "load_labels", "told", "written"]

_MAX_BYTES = 64 << 20
_COLUMNS = ("human", "label", "grade")
_GRADES = (Grade.SUCCESS, Grade.PARTIAL, Grade.FAILED)
_NAMES = {name: grade for grade in _GRADES for name in (grade.value, grade.value[0])}
_UNKNOWN = ("", "?")
_FORMAT_VERSION = 1


@dataclass(frozen=True, slots=True)
class Agreement:
    """``matrix``: answers by the grade that people gave and the one given here.

    ``differ`` are those on which they differ, with the human grade.
    """

    matrix: Mapping[tuple[Grade, Grade], int]
    differ: tuple[tuple[Graded, Grade], ...]

    @property
    def known(self) -> int:
        """The answers that people graded."""
        return sum(self.matrix.values())

    @property
    def equal(self) -> int:
        """The answers with equal grades."""
        return sum(count for (human, ours), count in self.matrix.items() if human is ours)


def load_labels(file: str) -> dict[str, Grade]:
    """Grades by the real path of the plan; paths in the file start at its folder.

    The file is CSV with the columns ``path`` and ``human``, ``label`` or ``grade``: S, P, F or
    success, partial, failed; ``?`` or nothing is unknown. Raises InputError.
    """
    try:
        text = read_file(file, _MAX_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{file}: this is not UTF-8 text") from error
    rows = csv.DictReader(io.StringIO(text, newline=""), strict=True)
    try:
        names = rows.fieldnames or ()
        column = next((name for name in _COLUMNS if name in names), None)
        if "path" not in names or column is None:
            wanted = f"'path' and one of {', '.join(_COLUMNS)}"
            raise InputError(f"{file}:1: the first line must name the columns {wanted}")
        found: dict[str, Grade] = {}
        for row in rows:
            written_as = (row[column] or "").strip().lower()
            if written_as in _UNKNOWN:
                continue
            if written_as not in _NAMES:
                what = printable(written_as[:40])
                raise InputError(f"{file}:{rows.line_num}: '{what}' is no grade; write S, P or F")
            place = os.path.join(os.path.dirname(file), row["path"] or "")  # noqa: PTH118, PTH120
            found[os.path.realpath(place)] = _NAMES[written_as]
    except (csv.Error, ValueError) as error:
        raise InputError(f"{file}:{rows.line_num}: this is not CSV: {error}") from error
    return found


def agreement_of(grades: Sequence[Graded], labels: Mapping[str, Grade]) -> Agreement:
    """How the grades compare with the labels; answers without a label do not count."""
    matrix: Counter[tuple[Grade, Grade]] = Counter()
    differ = []
    for graded in grades:
        human = labels.get(os.path.realpath(graded.path))
        if human is not None:
            matrix[human, graded.grade] += 1
            if graded.grade is not human:
                differ.append((graded, human))
    return Agreement(matrix, tuple(differ))


def written(grades: Sequence[Graded], agreement: Agreement | None, table: str) -> str:
    """The grades as a table of this kind. CSV has no place for the agreement."""
    if table == "csv":
        return _csv(grades)
    if table == "json":
        return _json(grades, agreement)
    return _markdown(grades, agreement) if table == "md" else _text(grades, agreement)


def told(agreement: Agreement) -> str:
    """The agreement in words, with the confusion matrix."""
    known, equal = agreement.known, agreement.equal
    if not known:
        return "no answer has a grade among the labels\n"
    lines = [f"agreement with the labels: {equal} of {known} ({100 * equal / known:.1f} %)"]
    columns = _columns(agreement)
    lines.append("".join(["people \\ gpsfsm", *(f"{one.value:>11}" for one in columns)]))
    for human in _GRADES:
        counts = (f"{agreement.matrix.get((human, ours), 0):>11}" for ours in columns)
        lines.append("".join([f"{human.value:<15}", *counts]))
    lines += [
        f"{printable(graded.path)}: people say {human.value}, gpsfsm {graded.grade.value}"
        for graded, human in agreement.differ
    ]
    return "\n".join(lines) + "\n"


def _columns(agreement: Agreement) -> tuple[Grade, ...]:
    undecided = any(ours is Grade.UNDECIDED for _, ours in agreement.matrix)
    return (*_GRADES, Grade.UNDECIDED) if undecided else _GRADES


def _cells(graded: Graded) -> list[str]:
    right = {True: "right", False: "wrong", None: "undecided"}
    path, reason = printable(graded.path), printable(graded.reason)
    return [path, graded.grade.value, right[graded.syntax], right[graded.theory], reason]


_HEAD = ["path", "grade", "syntax", "theory", "reason"]


def _csv(grades: Sequence[Graded]) -> str:
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(_HEAD)
    writer.writerows(map(_cells, grades))
    return out.getvalue()


def _markdown(grades: Sequence[Graded], agreement: Agreement | None) -> str:
    rows = [_HEAD, ["---"] * len(_HEAD), *map(_cells, grades)]
    lines = ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows]
    text = "\n".join([*lines, "", _totals(grades)]) + "\n"
    return text if agreement is None else f"{text}\n```text\n{told(agreement)}```\n"


def _text(grades: Sequence[Graded], agreement: Agreement | None) -> str:
    lines = []
    for graded in grades:
        path, grade, _, _, reason = _cells(graded)
        lines.append(f"{grade:<9}  {path}")
        if graded.grade is not Grade.SUCCESS:
            lines.append(f"{'':<9}  {reason}")
    lines += ["", _totals(grades)] if lines else ["no plan was found"]
    text = "\n".join(lines) + "\n"
    return text if agreement is None else f"{text}\n{told(agreement)}"


def _totals(grades: Sequence[Graded]) -> str:
    counts = Counter(graded.grade for graded in grades)
    parts = [f"{counts[grade]} {grade.value}" for grade in _GRADES]
    if counts[Grade.UNDECIDED]:
        parts.append(f"{counts[Grade.UNDECIDED]} undecided")
    return f"{len(grades)} answer{'s' if len(grades) != 1 else ''}: {', '.join(parts)}"


def _json(grades: Sequence[Graded], agreement: Agreement | None) -> str:
    counts = Counter(graded.grade for graded in grades)
    content: dict[str, object] = {
        "version": _FORMAT_VERSION,
        "answers": [
            {
                "path": graded.path,
                "grade": graded.grade.value,
                "syntax": graded.syntax,
                "theory": graded.theory,
                "reason": graded.reason,
            }
            for graded in grades
        ],
        "totals": {grade.value: counts[grade] for grade in Grade},
    }
    if agreement is not None:
        content["agreement"] = {
            "known": agreement.known,
            "equal": agreement.equal,
            "matrix": {
                human.value: {ours.value: agreement.matrix.get((human, ours), 0) for ours in Grade}
                for human in _GRADES
            },
        }
    return json.dumps(content, indent=2, ensure_ascii=True) + "\n"
