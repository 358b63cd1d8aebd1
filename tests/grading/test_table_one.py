"""Rows of the table of an experiment."""

from __future__ import annotations

from pathlib import Path

import pytest

from gpsfsm.errors import InputError
from gpsfsm.grading.experiment import Answer, Cell, Key
from gpsfsm.grading.grader import Grade
from gpsfsm.grading.table_one import (
    Evaluation,
    Row,
    agreement_lines,
    comparison,
    evaluate,
    rows_of,
    table,
)
from tests.oracle import plan, to_xml

TASK = "interface: GoRunner\nplaces: {A: {x: 1}}\nsteps: [{do: A}]\n"
GOOD, BAD = to_xml(plan("demo/GoRunner x=1")), to_xml(plan("demo/GoRunner x=2"))


def answers(folder: Path, *texts: tuple[str, int, int, str | None]) -> list[Answer]:
    """Answers of models (by name) to tasks; without a text there is no file."""
    (folder / "task1.yaml").write_text(TASK)
    (folder / "task2.yaml").write_text(TASK.replace("x: 1", "x: 2"))
    results = []
    for model, task, iteration, text in texts:
        path = folder / f"{model}{task}{iteration}.xml"
        if text is not None:
            path.write_text(text)
        key = Key(Cell("s", model, "p", task), iteration)
        results.append(Answer(key, None if text is None else str(path), Grade.SUCCESS, 1.0 * task))
    return results


def test_rows_over_tasks_models_and_everything(tmp_path: Path) -> None:
    replies = answers(
        tmp_path, ("a", 1, 1, GOOD), ("a", 1, 2, BAD), ("a", 2, 1, GOOD), ("b", 1, 1, None)
    )
    evaluation = evaluate(replies, str(tmp_path))
    assert [one.graded.grade.value for one in evaluation] == [
        "success",
        "partial",
        "partial",
        "failed",
    ]
    assert [one.differs for one in evaluation] == [False, True, True, True]
    rows = {row.names: row.summary for row in table(evaluation)}
    assert list(rows) == [
        ("s", "a", "p", "1"),
        ("s", "a", "p", "2"),
        ("s", "a", "p", "all"),
        ("s", "b", "p", "1"),
        ("s", "b", "p", "all"),
        ("s", "all", "all", "all"),
        ("all", "all", "all", "all"),
    ]
    both = rows["s", "a", "p", "all"]
    assert (both.answers, both.grades[Grade.PARTIAL], both.confusion.equal) == (3, 2, 1)
    assert both.times is not None
    assert (both.times.mean, both.pooled) == (pytest.approx(4 / 3), 0.0)
    assert rows["all", "all", "all", "all"].answers == 4
    assert agreement_lines(evaluation)[-1] == "s/b/p/1: people say success, gpsfsm failed"


def test_equal_texts_are_graded_once_for_each_task(tmp_path: Path) -> None:
    replies = answers(tmp_path, ("a", 1, 1, GOOD), ("b", 1, 1, GOOD), ("a", 2, 1, GOOD))
    evaluation = Evaluation(str(tmp_path))
    gradeds = [evaluation.grade(one) for one in replies]
    assert [one.grade.value for one in gradeds] == ["success", "success", "partial"]
    assert [one.path for one in gradeds] == [one.path for one in replies]


def test_a_file_that_is_gone_is_undecided_and_a_task_that_is_not_there_an_error(
    tmp_path: Path,
) -> None:
    replies = answers(tmp_path, ("a", 1, 1, GOOD), ("a", 2, 1, GOOD))
    Path(str(replies[0].path)).unlink()
    graded = evaluate(replies, str(tmp_path))
    assert graded[0].graded.grade is Grade.UNDECIDED
    published = Row(("s", "a", "p"), (0, 1, 0), (150, 71))
    _, _, row, _, totals = comparison([published], rows_of(table(graded)))
    assert "| 0/1/0 (2, 1 undecided) | 1.50 ± 0.71 | differ | equal |" in row
    assert totals.startswith("1 of 1 published rows have answers here: 0 with equal counts")
    (tmp_path / "task2.yaml").unlink()
    with pytest.raises(InputError, match=r"task2\.yaml: there is no such file"):
        evaluate(replies, str(tmp_path))
