"""The paper's Table I beside ours: the page has what is computed, and its sentences count right."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from benchmarks import table_one
from benchmarks.table_one import DATA, Comparison, comparison
from gpsfsm.grading.experiment import Answer, Cell, Key, mark_corrupted, read_experiment
from gpsfsm.grading.table_one import Evaluated, Row, evaluate, read_rows_of_table, rows_of, table
from gpsfsm.grading.tables import combined

REPO = Path(__file__).parents[2]
PAGE = (REPO / "docs/experiments.md").read_text(encoding="utf-8")
ROWS = 28


def block() -> str:
    """What the page has between its markers."""
    match = re.search(r"<!-- bench:table one -->\n(.*?)<!-- /bench:table one -->", PAGE, re.DOTALL)
    assert match is not None
    return match[1].strip()


def cells_of(text: str, head: str) -> list[list[str]]:
    """The rows of the Markdown table that begins with this cell."""
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for part in text.split("\n\n")
        if part.startswith(f"| {head} |")
        for line in part.splitlines()
    ]
    return [rows[0], *rows[2:]]


@pytest.fixture(scope="module")
def computed(shared_corpus: Path) -> Comparison:
    return comparison()


def test_the_page_has_what_is_computed(
    shared_corpus: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert table_one.main() == 0
    assert block() == capsys.readouterr().out.strip()


def test_each_row_of_the_page_has_the_papers_numbers_and_ours() -> None:
    """Without the answers, too: then ours are those of the run, which a test below compares."""
    head, *rows = cells_of(block(), "system")[: ROWS + 1]
    assert tuple(head) == table_one.HEAD
    paper = read_rows_of_table(str(DATA / "paper.csv"))
    recorded = {row.names: row for row in read_rows_of_table(str(DATA / "run.csv"))}
    assert len(paper) == len(recorded) == ROWS
    for cells, row in zip(rows, paper, strict=True):
        ours = recorded[row.names]
        numbers = [row.grades_text, row.times_text, ours.grades_text, ours.times_text]
        assert cells[:7] == [*row.names, *numbers]


def test_the_sentences_of_the_page_count_its_rows() -> None:
    """Counted from the cells alone, not by what has written them."""
    _, *rows = cells_of(block(), "system")[: ROWS + 1]
    same_times = same_digits = same_counts = corrupted = one_less = unexplained = 0
    for _, _, _, counts, times, our_counts, our_times, _, difference in rows:
        numbers = [
            [float(each) for each in re.findall(r"[\d.]+", two)] for two in (times, our_times)
        ]
        near = len(numbers[0]) == 2 and all(
            abs(one - two) < 0.0101 for one, two in zip(*numbers, strict=True)
        )
        same_times += near
        same_digits += times == our_times
        if counts == our_counts:
            same_counts += 1
            assert difference == ""
        elif "corrupted" in difference:
            corrupted += 1
            assert not near
        elif "one answer less" in difference:
            one_less += 1
        else:
            unexplained += difference.startswith("not explained: ")
    assert same_counts + corrupted + one_less + unexplained == ROWS
    assert same_times + corrupted == ROWS
    text = block()
    assert f"- Times: {same_times} of {ROWS} rows are equal to 0.01 s" in text
    assert f" {same_digits} of them in every digit; the other {corrupted} are" in text
    assert f"- Counts: {same_counts} rows are equal, {corrupted} differ by their corrupted" in text
    assert f" {one_less} by one answer that the paper leaves out, and {unexplained} are not" in text
    sources = [row[7] for row in rows]
    assert f"- Answers: {sources.count('answers')} rows are computed" in text
    assert f" {sources.count('run')} are those of the run." in text


def test_the_run_has_the_rows_that_are_computed(computed: Comparison) -> None:
    assert len(computed.computed) == 12
    for names, row in computed.computed.items():
        assert computed.recorded[names] == row


def test_only_the_second_task_gives_the_papers_row(shared_corpus: Path) -> None:
    """The paper does not say which task of the BTGenBot row was corrupted: its numbers do."""
    answers = read_experiment(str(shared_corpus / "experiment1"))
    names = ("btgenbot", "codellama-base", "oneshot")
    groups = [group for group in table(evaluate_all(answers)) if group.names[:3] == names]
    tasks = {group.names[3]: group.summary for group in groups if group.names[3] != "all"}
    (paper,) = (row for row in read_rows_of_table(str(DATA / "paper.csv")) if row.names == names)
    fits = []
    for left_out in tasks:
        rest = [tasks[task].times for task in tasks if task != left_out]
        moments = combined([each for each in rest if each is not None])
        assert moments is not None
        times = round(100 * moments.mean), round(100 * (moments.deviation or 0))
        if Row(names, paper.counts, times).same_times(paper):
            fits.append(left_out)
    assert fits == ["2"]


def evaluate_all(answers: list[Answer]) -> list[Evaluated]:
    return evaluate(answers, str(REPO / "experiments/navigation"))


def test_what_remains_without_corrupted_answers_is_the_papers_row(computed: Comparison) -> None:
    paper = {row.names: row for row in computed.paper}
    here = computed.corrupted & computed.computed.keys()
    assert len(computed.corrupted) == 4
    assert len(here) == 2
    for names in here:
        kept = computed.kept[names]
        assert kept.counts == paper[names].counts
        assert kept.same_times(paper[names])
        assert kept.answers < computed.computed[names].answers
    others = computed.computed.keys() - here
    assert all(computed.kept[names] == computed.computed[names] for names in others)


def test_the_corrupted_answers_have_labels_and_times_like_others(shared_corpus: Path) -> None:
    answers = read_experiment(str(shared_corpus / "experiment1"))
    marked, unused = mark_corrupted(answers, str(DATA / "corrupted.csv"))
    left_out = [one for one in marked if one.corrupted]
    assert len(left_out) == 60
    assert {one.key.cell.model for one in left_out} == {"codellama-base"}
    assert [place.rpartition(":")[2] for place in unused] == ["3", "5"]  # the other two rows


def test_a_row_is_equal_to_a_hundredth() -> None:
    names = ("s", "m", "p")
    row = Row(names, (1, 2, 3), (216, 73))
    assert row.same_times(Row(names, (0, 0, 0), (215, 74)))
    assert not row.same_times(Row(names, (1, 2, 3), (216, 75)))
    assert not row.same_times(Row(names, (1, 2, 3), None))
    assert Row(names, (0, 0, 0), None).same_times(Row(names, (0, 0, 9), None))
    assert (row.grades_text, row.times_text) == ("1/2/3 (6)", "2.16 ± 0.73")


def test_rows_of_groups_are_those_over_all_tasks() -> None:
    keys = [Key(Cell("s", "m", "p", 1), number) for number in (1, 2)]
    answers = [Answer(key, None, None, 1.0) for key in keys]
    rows = rows_of(table(evaluate_all(answers)))
    assert rows == {("s", "m", "p"): Row(("s", "m", "p"), (0, 0, 2), (100, 0))}
