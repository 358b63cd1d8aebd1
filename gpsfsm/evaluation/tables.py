"""Tables of groups of answers: text, Markdown, CSV and data for JSON."""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING

from gpsfsm.evaluation.confusion import GRADES
from gpsfsm.grading import Grade
from gpsfsm.model.printable import plain_markdown, printable

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.evaluation.confusion import Confusion
    from gpsfsm.evaluation.summary import Group, Summary

__all__ = [
    "agreement_data",
    "aligned",
    "as_csv",
    "confusion_told",
    "group_data",
    "long_rows",
    "markdown",
    "short_rows",
]

_FORMULAS = ("=", "+", "-", "@", "\uff1d", "\uff0b", "\uff0d", "\uff20")
"""With these a formula begins in spreadsheets; no number here is negative."""

_SHORT = "/".join(grade.value[0].upper() for grade in GRADES)


def short_rows(
    columns: Sequence[str], groups: Sequence[Group], *, labelled: bool
) -> list[list[str]]:
    """A head and a row for each group, to be looked at; three grades share a cell.

    Columns of times are left out where none is known, those of people where nothing is labelled.
    """
    timed = any(group.summary.times is not None for group in groups)
    head = [*columns, "answers", _SHORT]
    head += [f"people {_SHORT}", "equal"] if labelled else []
    head += ["mean, s", "deviation, s", "pooled, s"] if timed else []
    rows = [head]
    for group in groups:
        found = group.summary
        row = [*map(printable, group.names), str(found.answers), _grades(found.grades)]
        row[-1] += _undecided(found)
        if labelled:
            row += [_grades(found.people), f"{found.confusion.equal} of {found.confusion.known}"]
        if timed:
            row += ["" if time is None else f"{time:.2f}" for time in _times(found)]
        rows.append(row)
    return rows


def long_rows(
    columns: Sequence[str], groups: Sequence[Group], *, labelled: bool
) -> list[list[str]]:
    """A head and a row for each group, to be computed with: a cell for every number."""
    head = [*columns, "answers", *(grade.value for grade in Grade)]
    if labelled:
        head += [*(f"human_{grade.value}" for grade in GRADES), "known", "equal"]
    rows = [[*head, "timed", "mean_s", "deviation_s", "pooled_s"]]
    for group in groups:
        found = group.summary
        numbers = [found.answers, *(found.grades.get(grade, 0) for grade in Grade)]
        if labelled:
            numbers += [found.people.get(grade, 0) for grade in GRADES]
            numbers += [found.confusion.known, found.confusion.equal]
        numbers.append(0 if found.times is None else found.times.count)
        times = ("" if time is None else f"{time:.6g}" for time in _times(found))
        rows.append([*map(printable, group.names), *map(str, numbers), *times])
    return rows


def group_data(columns: Sequence[str], group: Group, *, labelled: bool) -> dict[str, object]:
    """A group for JSON."""
    found = group.summary
    data: dict[str, object] = {
        "group": dict(zip(columns, group.names, strict=True)),
        "answers": found.answers,
        "grades": {grade.value: found.grades.get(grade, 0) for grade in Grade},
    }
    if labelled:
        data["agreement"] = agreement_data(found.confusion)
    if found.times is not None:
        data["seconds"] = {
            "count": found.times.count,
            "mean": found.times.mean,
            "deviation": found.times.deviation,
            "pooled": found.pooled,
        }
    return data


def agreement_data(confusion: Confusion) -> dict[str, object]:
    """The agreement with people for JSON."""
    return {
        "known": confusion.known,
        "equal": confusion.equal,
        "accuracy": confusion.accuracy,
        "kappa": confusion.kappa,
        "matrix": {
            human.value: {ours.value: confusion.counts.get((human, ours), 0) for ours in Grade}
            for human in GRADES
        },
    }


def confusion_told(confusion: Confusion) -> list[str]:
    """The agreement with people in words, with the confusion matrix."""
    if confusion.accuracy is None:
        return ["no answer has a grade among the labels"]
    kappa = "" if confusion.kappa is None else f", kappa {confusion.kappa:.3f}"
    share = f"({100 * confusion.accuracy:.1f} %{kappa})"
    lines = [f"agreement with the labels: {confusion.equal} of {confusion.known} {share}"]
    undecided = any(ours is Grade.UNDECIDED for _, ours in confusion.counts)
    columns = (*GRADES, Grade.UNDECIDED) if undecided else GRADES
    lines.append("".join(["people \\ gpsfsm", *(f"{one.value:>11}" for one in columns)]))
    for human in GRADES:
        counts = (f"{confusion.counts.get((human, ours), 0):>11}" for ours in columns)
        lines.append("".join([f"{human.value:<15}", *counts]))
    return lines


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Rows as lines of text, in columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]


def markdown(rows: Sequence[Sequence[str]]) -> list[str]:
    """Rows as lines of a Markdown table; the first is the head. Cells are text and nothing else."""
    cells = [[plain_markdown(cell) for cell in row] for row in rows]
    ruled = [cells[0], ["---"] * len(cells[0]), *cells[1:]]
    return ["| " + " | ".join(row) + " |" for row in ruled]


def as_csv(rows: Sequence[Sequence[str]]) -> str:
    """Rows as CSV. A cell that a spreadsheet would compute gets an apostrophe."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerows([_no_formula(cell) for cell in row] for row in rows)
    return out.getvalue()


def _no_formula(cell: str) -> str:
    return f"'{cell}" if cell.lstrip().startswith(_FORMULAS) else cell


def _grades(counts: Mapping[Grade, int]) -> str:
    return "/".join(str(counts.get(grade, 0)) for grade in GRADES)


def _undecided(found: Summary) -> str:
    count = found.grades.get(Grade.UNDECIDED, 0)
    return f" ({count} undecided)" if count else ""


def _times(found: Summary) -> tuple[float | None, float | None, float | None]:
    if found.times is None:
        return None, None, None
    return found.times.mean, found.times.deviation, found.pooled
