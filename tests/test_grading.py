"""Grades by the paper's rubric, and their agreement with those that people gave."""

from __future__ import annotations

import csv
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.grading import Grade, Grader
from gpsfsm.tasks.load import load_task, read_task
from tests.oracle import par_any, plan, rec, seq, to_xml

NAVIGATION = Path("experiments/navigation")
TASK = read_task(b"interface: GoRunner\nplaces: {A: {x: 1}, B: {x: 2}}\nsteps: [{do: A, else: B}]")
A, B = "demo/GoRunner x=1", "demo/GoRunner x=2"
RIGHT = to_xml(plan(A, rec(B)))
WRONG = to_xml(plan(B))


def grade(text: str) -> tuple[str, bool, bool | None]:
    found = Grader(TASK).grade(text, "a.xml")
    return found.grade.value, found.syntax, found.theory


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        (RIGHT, ("success", True, True)),
        (WRONG, ("partial", True, False)),
        (f"Here it is:\n```xml\n{RIGHT}```\nGood luck!", ("success", True, True)),
        (RIGHT.replace("</Plan>", ""), ("partial", False, True)),
        (WRONG.replace("</Plan>", ""), ("failed", False, False)),
        (RIGHT.replace("sequential", "serial"), ("success", True, True)),
        ("I cannot do that.", ("failed", False, False)),
        ("", ("failed", False, False)),
        ("<Plan/>", ("partial", True, False)),
    ],
)
def test_the_rubric(text: str, wanted: tuple[str, bool, bool | None]) -> None:
    assert grade(text) == wanted


def test_a_behaviour_tree_is_graded_by_the_same_task_file() -> None:
    task = load_task(NAVIGATION / "task1.yaml")
    tree = (
        '<root BTCPP_format="4"><BehaviorTree ID="T"><MoveTo location="{}"/></BehaviorTree></root>'
    )
    grades = [Grader(task).grade(tree.format(name), "t.xml").grade for name in ("StationA", "Dock")]
    assert grades == [Grade.SUCCESS, Grade.PARTIAL]


def test_an_example_that_is_returned_fails_however_it_is_written() -> None:
    task = load_task(NAVIGATION / "task2.yaml")
    go = "capabilities2_runner_nav2/WaypointRunner x={} y={}".format
    shown = [go(5, 5), rec(go("0.0", 0)), go(2, 2), go(3, 1)]
    for whole in (
        plan(*shown),
        plan(seq(*shown)),
        plan(seq(*shown[:2]), par_any(shown[2]), shown[3]),
    ):
        found = Grader(task).grade(to_xml(whole), "a.xml")
        assert (found.grade, found.reason) == (Grade.FAILED, "example returned: it is example.xml")
    other = Grader(task).grade(to_xml(plan(*shown[:3])), "a.xml")
    assert other.grade is Grade.PARTIAL


@given(st.text(max_size=80))
def test_no_answer_breaks_the_grader(text: str) -> None:
    assert Grader(TASK).grade(text, "a.xml").grade is Grade.FAILED


def test_grades_are_those_that_people_gave(shared_corpus: Path) -> None:
    """Of the plans of GPT and CodeLlama all, of all plans at least 98 in 100."""
    root = shared_corpus / "experiment1"
    graders = {n: Grader(load_task(NAVIGATION / f"task{n}.yaml")) for n in range(1, 6)}
    matrix: Counter[tuple[str, str, str]] = Counter()
    with (root / "labels.csv").open() as file:
        for row in csv.DictReader(file):
            if row["system"] == "fabric" and row["human"] != "?":
                text = (root / row["path"]).read_bytes()
                ours = graders[int(row["task"])].grade(text, row["path"]).grade
                matrix[row["model"], row["human"], ours.value[0].upper()] += 1
    wrong = {key: count for key, count in matrix.items() if key[1] != key[2]}
    assert {model for model, _, _ in wrong} <= {"llamachat"}
    assert sum(wrong.values()) <= 0.02 * matrix.total()
    assert matrix.total() > 280
