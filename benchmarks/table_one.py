"""The paper's Table I beside ours, row by row, and the percentages of its text.

The paper's numbers are in ``experiments/table1/paper.csv``. Ours are computed for the rows whose
answers the development material holds; for the others they are those of a run over the paper's
public repository, ``experiments/table1/run.csv``. Nothing here depends on the machine.
"""

from __future__ import annotations

import csv
import os
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.common import ROOT
from gpsfsm.grading.experiment import mark_corrupted, model_name, read_experiment
from gpsfsm.grading.grader import Grade
from gpsfsm.grading.table_one import (
    Evaluated,
    Family,
    Row,
    evaluate,
    read_rows_of_table,
    rows_of,
    table,
)
from gpsfsm.grading.tables import Moments, combined, markdown

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

EXPERIMENT = Path(os.environ.get("GPSFSM_CORPUS", ROOT.parent / "shared/corpus")) / "experiment1"
DATA = ROOT / "experiments/table1"
FAMILIES = (Family("GPT", ("gpt-*",)), Family("local models", ("*",)))
TEXT = {
    ("fabric", "GPT"): "90/10/-",
    ("btgenbot", "GPT"): "54/11/34",
    ("fabric", "local models"): "10/22/68",
    ("btgenbot", "local models"): "13/35/52",
}
"""The percentages that the paper's text has."""
HEAD = ("system", "model", "prompt", "paper: S/P/F (N)", "paper: time, s", "ours: S/P/F (N)")
HEAD = (*HEAD, "ours: time, s", "ours from", "difference")
COMPUTED, RECORDED = "answers", "run"
Names = tuple[str, str, str]


@dataclass(frozen=True)
class Comparison:
    """The paper's rows and ours: from a run over everything, and computed from answers here.

    ``computed`` counts all answers, ``kept`` leaves out those of the ``corrupted`` rows that the
    paper leaves out. ``labels`` are the grades of people that are published one by one: the partial
    ones, and how many in all. ``cells`` are the times of each task.
    """

    paper: Sequence[Row]
    recorded: Mapping[Names, Row]
    corrupted: frozenset[Names]
    computed: Mapping[Names, Row] = field(default_factory=dict)
    kept: Mapping[Names, Row] = field(default_factory=dict)
    labels: Mapping[Names, tuple[int, int]] = field(default_factory=dict)
    cells: Mapping[tuple[Names, int], Moments] = field(default_factory=dict)

    def ours(self, names: Names) -> Row:
        """Our row with all answers: computed if they are here, else of the run."""
        return self.computed.get(names) or self.recorded[names]

    def difference(self, row: Row) -> str:
        """Why the row differs from ours; nothing if it does not."""
        ours = self.ours(row.names)
        if row.names in self.corrupted:
            return self._corrupted(row)
        if row.counts == ours.counts and row.same_times(ours):
            return ""
        if ours.answers == row.answers + 1:
            return f"{row.answers} of {ours.answers}: one answer less, which is not published"
        partial, labelled = self.labels.get(row.names, (0, 0))
        if partial > row.counts[1]:
            return f"not explained: {partial} of {labelled} single labels are partial"
        return "not explained: single labels are mostly not published"

    def _corrupted(self, row: Row) -> str:
        left_out = self.ours(row.names).answers - row.answers
        what = "corrupted as a whole" if not row.answers else f"{left_out} answers corrupted"
        kept = self.kept.get(row.names)
        if kept is not None:
            equal = row.counts == kept.counts and row.same_times(kept)
            verdict = "equal" if equal else "not equal"
            time = "" if kept.times is None else f", {kept.times_text}"
            return f"{what}; without them {kept.grades_text}{time}: {verdict}"
        if not row.answers:
            return what
        rest, whole = self._implied(row)
        return f"{what}, by the means {rest.mean:.2f} s each; with them {whole.times_text}"

    def _implied(self, row: Row) -> tuple[Moments, Row]:
        """The answers that the paper's row lacks by ours, and the row of both together.

        Their mean is what the two means leave; their deviation is that of the corrupted task of the
        same model's base version.
        """
        system, model, prompt = row.names
        ours = self.ours(row.names)
        assert row.times is not None
        assert ours.times is not None
        count = ours.answers - row.answers
        total = ours.answers * ours.times[0] - row.answers * row.times[0]
        base = self.cells[(system, model.replace("finetuned", "base"), prompt), 2]
        rest = Moments(count, total / count / 100, base.deviation)
        printed = Moments(row.answers, row.times[0] / 100, row.times[1] / 100)
        whole = combined([printed, rest])
        assert whole is not None
        assert whole.deviation is not None
        times = round(100 * whole.mean), round(100 * whole.deviation)
        return rest, Row(row.names, ours.counts, times)

    def lines(self) -> list[str]:
        """The table."""
        rows: list[Sequence[str]] = [HEAD]
        for row in self.paper:
            ours = self.ours(row.names)
            source = COMPUTED if row.names in self.computed else RECORDED
            cells = [*row.names, row.grades_text, row.times_text, ours.grades_text, ours.times_text]
            rows.append([*cells, source, self.difference(row)])
        return markdown(rows)

    def summary(self) -> list[str]:
        """The numbers of rows that are equal, and of those that are not, by their reasons."""
        pairs = [(row, self.ours(row.names)) for row in self.paper]
        timed = sum(row.same_times(ours) for row, ours in pairs)
        exact = sum(row.times == ours.times for row, ours in pairs)
        counted = sum(row.counts == ours.counts for row, ours in pairs)
        differ = [(row, ours) for row, ours in pairs if row.counts != ours.counts]
        corrupted = sum(row.names in self.corrupted for row, _ in differ)
        one_less = sum(
            ours.answers == row.answers + 1
            for row, ours in differ
            if row.names not in self.corrupted
        )
        rest = len(differ) - corrupted - one_less
        return [
            f"- Times: {timed} of {len(pairs)} rows are equal to 0.01 s with all answers counted, "
            f"{exact} of them in every digit; the other {len(pairs) - timed} are the rows with "
            "corrupted answers.",
            f"- Counts: {counted} rows are equal, {corrupted} differ by their corrupted answers, "
            f"{one_less} by one answer that the paper leaves out, and {rest} are not explained.",
            f"- Answers: {len(self.computed)} rows are computed from answers that are here, "
            f"{len(self.paper) - len(self.computed)} are those of the run.",
        ]

    def percentages(self) -> list[str]:
        """The percentages of the paper's text, ours, and those that follow from its Table I."""
        rows: list[Sequence[str]] = [
            (
                *("system", "models", "paper's text", "ours, all answers"),
                *("Table I, N as printed", "Table I, corrupted ones failed"),
            )
        ]
        for (system, family), text in TEXT.items():
            paper = [row for row in self.paper if _belongs(row.names, system, family)]
            ours = [self.ours(row.names) for row in paper]
            printed = _sums(row.counts for row in paper)
            corrupted = sum(
                self.ours(row.names).answers - row.answers
                for row in paper
                if row.names in self.corrupted
            )
            all_failed = (*printed[:2], printed[2] + corrupted)
            counts = (_sums(row.counts for row in ours), printed, all_failed)
            rows.append((system, family, text, *map(_percent, counts)))
        return markdown(rows)


def _rows_with_corrupted(file: Path) -> frozenset[Names]:
    with file.open(encoding="utf-8", newline="") as lines:
        return frozenset(
            (line["system"], model_name(line["model"], line["version"]), line["prompt"])
            for line in csv.DictReader(lines)
        )


def _belongs(names: Names, system: str, family: str) -> bool:
    first = next(each for each in FAMILIES if each.holds(names[1]))
    return names[0] == system and first.name == family


def _sums(counts: Iterable[tuple[int, int, int]]) -> tuple[int, int, int]:
    success, partial, failed = map(sum, zip(*counts, strict=True))
    return success, partial, failed


def _percent(counts: Sequence[int]) -> str:
    whole = sum(counts)
    return "/".join(f"{100 * count / whole:.1f}" for count in counts) + f" of {whole}"


def comparison() -> Comparison:
    """The comparison; without the development material all rows are those of the run."""
    paper = read_rows_of_table(str(DATA / "paper.csv"))
    recorded = {row.names: row for row in read_rows_of_table(str(DATA / "run.csv"))}
    corrupted = _rows_with_corrupted(DATA / "corrupted.csv")
    if not EXPERIMENT.is_dir():
        return Comparison(paper, recorded, corrupted)
    answers = read_experiment(str(EXPERIMENT))
    graded = evaluate(answers, str(ROOT / "experiments/navigation"))
    marked, _ = mark_corrupted(answers, str(DATA / "corrupted.csv"))
    kept = [Evaluated(one, each.graded) for one, each in zip(marked, graded, strict=True)]
    groups = table(graded)
    labels: dict[Names, tuple[int, int]] = {}
    cells: dict[tuple[Names, int], Moments] = {}
    for group in groups:
        *names, task = group.names
        key = (names[0], names[1], names[2])
        if task == "all":
            labelled = group.summary.confusion.labelled
            labels[key] = group.summary.people.get(Grade.PARTIAL, 0), labelled
        elif group.summary.times is not None:
            cells[key, int(task)] = group.summary.times
    rows, without = rows_of(groups), rows_of(table(kept))
    return Comparison(paper, recorded, corrupted, rows, without, labels, cells)


def main() -> int:
    if not EXPERIMENT.is_dir():
        print(f"the experiment is not here: {EXPERIMENT} (GPSFSM_CORPUS)", file=sys.stderr)
        return 2
    compared = comparison()
    parts = [compared.lines(), compared.summary(), compared.percentages()]
    print("\n\n".join("\n".join(part) for part in parts))
    return 0


if __name__ == "__main__":
    sys.exit(main())
