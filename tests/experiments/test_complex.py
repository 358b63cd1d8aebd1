"""The complex tasks: some of our plans fulfil them, and others do not, for known reasons."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.grading.grader import Grade, Grader
from gpsfsm.model.finding import Severity
from gpsfsm.tasks.load import load_task

COMPLEX = Path("experiments/complex")
NUMBERS = ("1", "2", "3")
with (COMPLEX / "labels.csv").open(encoding="utf-8") as _file:
    ROWS = list(csv.DictReader(_file))


@pytest.mark.parametrize("row", ROWS, ids=[row["path"] for row in ROWS])
def test_the_grade_is_the_one_written_down_and_so_is_why(row: dict[str, str]) -> None:
    task = load_task(COMPLEX / f"complex{row['task']}.yaml")
    graded = Grader(task).grade((COMPLEX / row["path"]).read_bytes(), row["path"])
    assert graded.grade.value[0].upper() == row["human"]
    assert (row["why"] or "the task is fulfilled") in graded.reason


@pytest.mark.parametrize(
    "row", [row for row in ROWS if row["human"] == "S"], ids=lambda r: r["path"]
)
def test_a_plan_that_fulfils_its_task_has_no_error(row: dict[str, str]) -> None:
    """The tasks can be done with the runners of the built-in library."""
    options = CheckOptions(task=load_task(COMPLEX / f"complex{row['task']}.yaml"))
    report = check_text((COMPLEX / row["path"]).read_bytes(), row["path"], options)
    assert [one for one in report.findings if one.severity is Severity.ERROR] == []


@pytest.mark.parametrize("number", NUMBERS)
def test_every_plan_is_listed_and_each_task_has_both_kinds(number: str) -> None:
    listed = {row["path"]: row["human"] for row in ROWS if row["task"] == number}
    files = (COMPLEX / f"complex{number}").glob("*.xml")
    assert sorted(listed) == sorted(f"complex{number}/{file.name}" for file in files)
    assert list(listed.values()).count("S") >= 2
    assert list(listed.values()).count("P") >= 5


@pytest.mark.parametrize("number", NUMBERS)
def test_no_plan_does_for_another_task(number: str) -> None:
    grader = Grader(load_task(COMPLEX / f"complex{number}.yaml"))
    others = [row for row in ROWS if row["task"] != number and row["human"] == "S"]
    for row in others:
        graded = grader.grade((COMPLEX / row["path"]).read_bytes(), row["path"])
        assert graded.grade is Grade.PARTIAL
