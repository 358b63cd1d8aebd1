"""Groups of graded answers, in numbers and in tables: text, Markdown, CSV and data for JSON.

The numbers are the confusion with what people say, means and deviations; docs/experiments.md gives
the formulas.
"""

from __future__ import annotations

import csv
import io
from collections import Counter
from dataclasses import dataclass
from math import fsum, sqrt
from typing import TYPE_CHECKING

from gpsfsm.grading.grader import Grade
from gpsfsm.model.printable import plain_markdown, printable

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence


@dataclass(frozen=True, slots=True)
class Entry:
    """One answer: its grade, that of people, and how many seconds the model took, if known.

    A ``corrupted`` one is counted apart from all others.
    """

    grade: Grade
    human: Grade | None = None
    seconds: float | None = None
    corrupted: bool = False


@dataclass(frozen=True, slots=True)
class Summary:
    """Some answers: how many have which grade, here and from people, and what they took.

    ``times`` are the moments of all times together. ``pooled`` is their deviation within the groups
    that were put together; one group alone has none. ``corrupted`` is the number of answers that
    were left out: they have no part in the other numbers.
    """

    grades: Mapping[Grade, int]
    people: Mapping[Grade, int]
    confusion: Confusion
    times: Moments | None
    pooled: float | None
    corrupted: int = 0

    @property
    def answers(self) -> int:
        """The number of answers that were not left out."""
        return sum(self.grades.values())


@dataclass(frozen=True, slots=True)
class Group:
    """A row of a table: what its answers have in common, by column, and the answers in numbers."""

    names: tuple[str, ...]
    summary: Summary


def summarize(entries: Iterable[Entry]) -> Summary:
    """One group in numbers."""
    listed = list(entries)
    answers = [entry for entry in listed if not entry.corrupted]
    return Summary(
        grades=Counter(entry.grade for entry in answers),
        people=Counter(entry.human for entry in answers if entry.human is not None),
        confusion=confusion_of((entry.human, entry.grade) for entry in answers),
        times=moments_of(entry.seconds for entry in answers if entry.seconds is not None),
        pooled=None,
        corrupted=len(listed) - len(answers),
    )


def over(groups: Sequence[Summary]) -> Summary:
    """Several groups in numbers; each must be one group, not a summary over groups."""
    grades: Counter[Grade] = Counter()
    people: Counter[Grade] = Counter()
    pairs: Counter[tuple[Grade, Grade]] = Counter()
    for group in groups:
        grades.update(group.grades)
        people.update(group.people)
        pairs.update(group.confusion.counts)
    times = [group.times for group in groups if group.times is not None]
    left_out = sum(group.corrupted for group in groups)
    deviation = pooled_deviation(times)
    return Summary(grades, people, Confusion(pairs), combined(times), deviation, left_out)


GRADES = (Grade.SUCCESS, Grade.PARTIAL, Grade.FAILED)
"""The grades that people give."""


@dataclass(frozen=True, slots=True)
class Confusion:
    """``counts``: the number of answers by the grade that people gave and the one given here."""

    counts: Mapping[tuple[Grade, Grade], int]

    @property
    def labelled(self) -> int:
        """The answers that people graded."""
        return sum(self.counts.values())

    @property
    def equal(self) -> int:
        """The answers with equal grades."""
        return sum(count for (human, ours), count in self.counts.items() if human is ours)

    @property
    def accuracy(self) -> float | None:
        """The share of answers with equal grades; None if people graded none."""
        return self.equal / self.labelled if self.labelled else None

    @property
    def kappa(self) -> float | None:
        """The agreement beyond chance: 1 is perfect, 0 what chance gives, below 0 less than that.

        None where chance alone gives perfect agreement: if there is no answer, or both give one and
        the same grade to all. J. Cohen, "A Coefficient of Agreement for Nominal Scales",
        Educational and Psychological Measurement 20 (1960).
        """
        human: Counter[Grade] = Counter()
        ours: Counter[Grade] = Counter()
        for (one, other), count in self.counts.items():
            human[one] += count
            ours[other] += count
        by_chance = sum(human[grade] * ours[grade] for grade in Grade)  # times the square of known
        possible = self.labelled**2 - by_chance
        return (self.labelled * self.equal - by_chance) / possible if possible else None


def confusion_of(pairs: Iterable[tuple[Grade | None, Grade]]) -> Confusion:
    """Count pairs of the human grade and ours; without a human grade an answer does not count."""
    return Confusion(Counter((human, ours) for human, ours in pairs if human is not None))


@dataclass(frozen=True, slots=True)
class Moments:
    """The moments of a group of ``count`` measurements, at least one; in their unit.

    ``deviation`` is the sample deviation, with ``count - 1`` below the sum of squares. One
    measurement has none.
    """

    count: int
    mean: float
    deviation: float | None


def moments_of(values: Iterable[float]) -> Moments | None:
    """Mean and sample deviation of finite numbers; None if there is no number."""
    measured = list(values)
    count = len(measured)
    if not count:
        return None
    mean = fsum(measured) / count
    if count == 1:
        return Moments(count, mean, None)
    squares = fsum((value - mean) ** 2 for value in measured)
    rounding = fsum(value - mean for value in measured) ** 2 / count
    return Moments(count, mean, sqrt(max(0.0, squares - rounding) / (count - 1)))


def combined(groups: Sequence[Moments]) -> Moments | None:
    """The moments of all measurements of the groups together; None if there is no group.

    The mean is weighted by the counts. The sum of squares is that within the groups plus that of
    the means of the groups around the common mean.
    """
    count = sum(group.count for group in groups)
    if not count:
        return None
    mean = fsum(group.count * group.mean for group in groups) / count
    if count == 1:
        return Moments(count, mean, None)
    between = fsum(group.count * (group.mean - mean) ** 2 for group in groups)
    return Moments(count, mean, sqrt((_within(groups) + between) / (count - 1)))


def pooled_deviation(groups: Iterable[Moments]) -> float | None:
    """The deviation that the groups have in common: the root of the mean variance.

    Variances are weighted by their degrees of freedom, ``count - 1``. None if no group has more
    than one measurement. Differences between the means of the groups do not count.
    """
    several = [group for group in groups if group.deviation is not None]
    freedom = sum(group.count - 1 for group in several)
    return sqrt(_within(several) / freedom) if freedom else None


def _within(groups: Iterable[Moments]) -> float:
    """The sum of squares of the measurements around the means of their own groups."""
    return fsum((group.count - 1) * (group.deviation or 0.0) ** 2 for group in groups)


_FORMULAS = ("=", "+", "-", "@", "\uff1d", "\uff0b", "\uff0d", "\uff20")
"""With these a formula begins in spreadsheets; no number here is negative."""

_SHORT = "/".join(grade.value[0].upper() for grade in GRADES)


def short_rows(
    columns: Sequence[str], groups: Sequence[Group], *, labelled: bool, shares: bool = False
) -> list[list[str]]:
    """A head and a row for each group, to be looked at; three grades share a cell.

    Columns of times are left out where none is known, those of people where nothing is labelled,
    that of corrupted answers where there is none. ``shares`` adds the grades in percent.
    """
    timed = any(group.summary.times is not None for group in groups)
    corrupted = _any_corrupted(groups)
    head = [*columns, "answers", *(["corrupted"] if corrupted else []), _SHORT]
    head += [f"{_SHORT}, %"] if shares else []
    head += [f"people {_SHORT}", "equal"] if labelled else []
    head += ["mean, s", "deviation, s", "pooled, s"] if timed else []
    rows = [head]
    for group in groups:
        summary = group.summary
        row = [*map(printable, group.names), str(summary.answers)]
        row += [str(summary.corrupted)] if corrupted else []
        row.append(grades_text(summary.grades) + _undecided(summary))
        row += [_shares(summary)] if shares else []
        if labelled:
            row += [
                grades_text(summary.people),
                f"{summary.confusion.equal} of {summary.confusion.labelled}",
            ]
        if timed:
            row += ["" if time is None else f"{time:.2f}" for time in _times(summary)]
        rows.append(row)
    return rows


def long_rows(
    columns: Sequence[str], groups: Sequence[Group], *, labelled: bool
) -> list[list[str]]:
    """A head and a row for each group, to be computed with: a cell for every number."""
    corrupted = _any_corrupted(groups)
    head = [*columns, "answers", *(["corrupted"] if corrupted else [])]
    head += [grade.value for grade in Grade]
    if labelled:
        head += [*(f"human_{grade.value}" for grade in GRADES), "known", "equal"]
    rows = [[*head, "timed", "mean_s", "deviation_s", "pooled_s"]]
    for group in groups:
        summary = group.summary
        numbers = [summary.answers, *([summary.corrupted] if corrupted else [])]
        numbers += [summary.grades.get(grade, 0) for grade in Grade]
        if labelled:
            numbers += [summary.people.get(grade, 0) for grade in GRADES]
            numbers += [summary.confusion.labelled, summary.confusion.equal]
        numbers.append(0 if summary.times is None else summary.times.count)
        times = ("" if time is None else f"{time:.6g}" for time in _times(summary))
        rows.append([*map(printable, group.names), *map(str, numbers), *times])
    return rows


def group_data(columns: Sequence[str], group: Group, *, labelled: bool) -> dict[str, object]:
    """A group for JSON."""
    summary = group.summary
    data: dict[str, object] = {
        "group": dict(zip(columns, group.names, strict=True)),
        "answers": summary.answers,
        "grades": {grade.value: summary.grades.get(grade, 0) for grade in Grade},
    }
    if summary.corrupted:
        data["corrupted"] = summary.corrupted
    if labelled:
        data["agreement"] = agreement_data(summary.confusion)
    if summary.times is not None:
        data["seconds"] = {
            "count": summary.times.count,
            "mean": summary.times.mean,
            "deviation": summary.times.deviation,
            "pooled": summary.pooled,
        }
    return data


def agreement_data(confusion: Confusion) -> dict[str, object]:
    """The agreement with people for JSON."""
    return {
        "known": confusion.labelled,
        "equal": confusion.equal,
        "accuracy": confusion.accuracy,
        "kappa": confusion.kappa,
        "matrix": {
            human.value: {ours.value: confusion.counts.get((human, ours), 0) for ours in Grade}
            for human in GRADES
        },
    }


def confusion_lines(confusion: Confusion) -> list[str]:
    """The agreement with people in words, with the confusion matrix."""
    if confusion.accuracy is None:
        return ["no answer has a grade among the labels"]
    kappa = "" if confusion.kappa is None else f", kappa {confusion.kappa:.3f}"
    share = f"({100 * confusion.accuracy:.1f} %{kappa})"
    lines = [f"agreement with the labels: {confusion.equal} of {confusion.labelled} {share}"]
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


def grades_text(counts: Mapping[Grade, int]) -> str:
    """Success, partial and failed, as ``49/1/0``."""
    return "/".join(str(counts.get(grade, 0)) for grade in GRADES)


def _shares(summary: Summary) -> str:
    """The grades in percent; nothing where there is no answer."""
    whole = summary.answers
    if not whole:
        return ""
    return "/".join(f"{100 * summary.grades.get(grade, 0) / whole:.1f}" for grade in GRADES)


def _any_corrupted(groups: Iterable[Group]) -> bool:
    return any(group.summary.corrupted for group in groups)


def _undecided(summary: Summary) -> str:
    count = summary.grades.get(Grade.UNDECIDED, 0)
    return f" ({count} undecided)" if count else ""


def _times(summary: Summary) -> tuple[float | None, float | None, float | None]:
    if summary.times is None:
        return None, None, None
    return summary.times.mean, summary.times.deviation, summary.pooled
