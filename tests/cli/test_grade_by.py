"""``gpsfsm grade --by``: rows of groups, with the grades of people and the times of models."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import pytest

from tests.cli.support import run
from tests.oracle import plan, rec, to_xml

TASK = "interface: GoRunner\nplaces: {A: {x: 1}, B: {x: 2}}\nsteps: [{do: A, else: B}]\n"
GOOD = to_xml(plan("demo/GoRunner x=1", rec("demo/GoRunner x=2")))
HALF = to_xml(plan("demo/GoRunner x=1"))
LABELS = """path,human,model,round,seconds
answers/m1/1.xml,S,m 1,2,1.0
answers/m1/2.xml,S,m 1,10,2.0
answers/m2/1.xml,P,m 2,2,6.0
"""
GRADE = ("grade", "--task", "task.yaml")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "task.yaml").write_text(TASK)
    (tmp_path / "labels.csv").write_text(LABELS)
    for name, text in (("m1/1", GOOD), ("m1/2", HALF), ("m2/1", HALF), ("m2/3", "nothing")):
        (tmp_path / f"answers/{name}.xml").parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / f"answers/{name}.xml").write_text(text)
    return tmp_path


def test_a_row_for_each_folder(folder: Path) -> None:
    done = run(*GRADE, "answers", "--by", "folder", cwd=folder)
    assert done.returncode == 0
    assert done.stdout.decode().splitlines() == [
        "folder      answers  S/P/F",
        "answers/m1  2        1/1/0",
        "answers/m2  2        0/1/1",
        "all         4        1/2/1",
        "",
        "4 answers: 1 success, 2 partial, 1 failed",
    ]


def test_rows_of_columns_of_the_labels_with_people_and_times(folder: Path) -> None:
    words = (*GRADE, "answers", "--labels", "labels.csv", "--by", "model,round", "--table")
    lines = run(*words, "md", cwd=folder).stdout.decode().splitlines()
    assert lines[0] == (
        "| model | round | answers | S/P/F | people S/P/F | equal"
        " | mean, s | deviation, s | pooled, s |"
    )
    assert lines[2:7] == [
        "| ? | ? | 1 | 0/0/1 | 0/0/0 | 0 of 0 |  |  |  |",
        "| m 1 | 2 | 1 | 1/0/0 | 1/0/0 | 1 of 1 | 1.00 |  |  |",
        "| m 1 | 10 | 1 | 0/1/0 | 1/0/0 | 0 of 1 | 2.00 |  |  |",
        "| m 2 | 2 | 1 | 0/1/0 | 0/1/0 | 1 of 1 | 6.00 |  |  |",
        "| all |  | 4 | 1/2/1 | 2/1/0 | 2 of 3 | 3.00 | 2.65 |  |",
    ]
    assert "agreement with the labels: 2 of 3 (66.7 %, kappa 0.400)" in lines


def test_groups_as_csv_and_json(folder: Path) -> None:
    words = (*GRADE, "answers", "--labels", "labels.csv", "--by", "model", "--table")
    done = run(*words, "csv", cwd=folder)
    rows = list(csv.DictReader(io.StringIO(done.stdout.decode())))
    assert [row["model"] for row in rows] == ["?", "m 1", "m 2", "all"]
    assert [rows[1][name] for name in ("mean_s", "deviation_s", "timed")] == [
        "1.5",
        "0.707107",
        "2",
    ]
    assert rows[3]["pooled_s"] == "0.707107"
    assert done.stderr.decode().startswith("agreement with the labels: 2 of 3")
    content = json.loads(run(*words, "json", cwd=folder).stdout)
    assert [group["group"] for group in content["groups"]] == [
        {"model": "?"},
        {"model": "m 1"},
        {"model": "m 2"},
    ]
    assert content["all"]["seconds"]["pooled"] == pytest.approx(0.5**0.5)
    assert content["agreement"]["kappa"] == pytest.approx(0.4)
    assert [one["human"] for one in content["answers"]] == ["success", "success", "partial", None]


def test_the_grade_of_people_stands_beside_ours(folder: Path) -> None:
    done = run(*GRADE, "answers", "--labels", "labels.csv", "--table", "csv", cwd=folder)
    rows = list(csv.DictReader(io.StringIO(done.stdout.decode())))
    assert list(rows[0]) == ["path", "grade", "human", "syntax", "theory", "reason"]
    assert [row["human"] for row in rows] == ["success", "success", "partial", "?"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--by", "model"), "--by: there is no column 'model'; write folder or name a file with"),
        (
            ("--by", "folder,size", "--labels", "labels.csv"),
            "--by: there is no column 'size'; write folder or one of path, human, model, round,",
        ),
        (("--by", "", "--labels", "labels.csv"), "--by: there is no column ''"),
    ],
)
def test_a_column_that_is_not_there(folder: Path, words: tuple[str, ...], message: str) -> None:
    done = run(*GRADE, "answers", *words, cwd=folder)
    assert (done.returncode, done.stdout) == (2, b"")
    assert message in done.stderr.decode()


def test_no_answers_no_groups(folder: Path) -> None:
    (folder / "empty").mkdir()
    done = run(*GRADE, "empty", "--by", "folder", cwd=folder)
    assert done.returncode == 2
    assert b"Traceback" not in done.stdout
