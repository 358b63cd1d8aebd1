"""``gpsfsm grade`` and ``gpsfsm check --task``."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import pytest

from gpsfsm.checking.option_table import BY_NAME, NO_EFFECT
from gpsfsm.cli import main
from gpsfsm.grading.grade_tables import streamed
from gpsfsm.grading.grader import Grade, Graded
from tests.cli.support import run
from tests.oracle import plan, rec, to_xml

TASK = "interface: GoRunner\nplaces: {A: {x: 1}, B: {x: 2}}\nsteps: [{do: A, else: B}]\n"
A, B = "demo/GoRunner x=1", "demo/GoRunner x=2"
TEXTS = {
    "good": to_xml(plan(A, rec(B))),
    "half": to_xml(plan(A)),
    "none": "no plan today",
}
HALF = (
    "GP605 when 'A' fails, the plan does not try 'B': "
    "GoRunner (x=1) at line 2 fails; the plan gives up without trying 'B'"
)


def folder(path: Path, labels: str = "") -> None:
    (path / "task.yaml").write_text(TASK)
    (path / "answers").mkdir()
    for name, text in TEXTS.items():
        (path / "answers" / f"{name}.xml").write_text(text)
    if labels:
        (path / "labels.csv").write_text(labels)


def test_assumptions_that_admit_no_scenario_make_no_grade(tmp_path: Path) -> None:
    folder(tmp_path)
    answer = tmp_path / "answer.xml"
    answer.write_text(to_xml(plan(A, A)))
    assumption = "line 2 succeeds and line 3 fails"
    result = run(
        "grade", "--task", str(tmp_path / "task.yaml"), str(answer), "--consistent",
        "--assume", assumption,
    )  # fmt: skip
    assert result.returncode == 2
    assert "undecided: the assumptions and options admit no scenario" in result.stdout.decode()
    assert b"success " not in result.stdout.splitlines()[0]


def test_grades_are_told(tmp_path: Path) -> None:
    folder(tmp_path)
    done = run("grade", "--task", "task.yaml", "answers", cwd=tmp_path)
    assert done.returncode == 0
    lines = done.stdout.decode().splitlines()
    assert lines[0] == "success    answers/good.xml"
    assert lines[1:3] == ["partial    answers/half.xml", f"           {HALF}"]
    assert lines[3] == "failed     answers/none.xml"
    assert lines[-1] == "3 answers: 1 success, 1 partial, 1 failed"


def test_grades_as_csv(tmp_path: Path) -> None:
    folder(tmp_path)
    done = run("grade", "--task", "task.yaml", "--table", "csv", "answers", cwd=tmp_path)
    rows = list(csv.DictReader(io.StringIO(done.stdout.decode())))
    assert list(rows[0]) == ["path", "grade", "syntax", "theory", "reason"]
    assert [(row["grade"], row["syntax"], row["theory"]) for row in rows] == [
        ("success", "right", "right"),
        ("partial", "right", "wrong"),
        ("failed", "wrong", "wrong"),
    ]
    assert rows[1]["reason"] == HALF


def test_grades_as_markdown_and_json(tmp_path: Path) -> None:
    folder(tmp_path)
    done = run("grade", "--task", "task.yaml", "--table", "md", "answers", cwd=tmp_path)
    assert done.stdout.decode().splitlines()[:3] == [
        "| path | grade | syntax | theory | reason |",
        "| --- | --- | --- | --- | --- |",
        "| answers/good.xml | success | right | right | the task is fulfilled |",
    ]
    done = run("grade", "--task", "task.yaml", "--table", "json", "answers", cwd=tmp_path)
    content = json.loads(done.stdout)
    assert content["totals"] == {"success": 1, "partial": 1, "failed": 1, "undecided": 0}
    assert content["answers"][0]["theory"] is True


def test_grades_as_json_lines(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder(tmp_path, labels="path,human\nanswers/half.xml,S\nanswers/none.xml,F\n")
    monkeypatch.chdir(tmp_path)
    base = ["grade", "--task", "task.yaml", "answers"]
    assert main([*base, "--table", "json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert main([*base, "--format", "jsonl"]) == 0
    text = capsys.readouterr().out
    entries = [json.loads(line) for line in text.splitlines()]
    assert [entry.pop("version") for entry in entries] == [document["version"]] * 3
    assert entries == document["answers"]
    assert main([*base, "--table", "jsonl", "-o", "a.jsonl"]) == 0
    assert Path("a.jsonl").read_text() == text
    assert main([*base, "--table", "jsonl", "--labels", "labels.csv"]) == 0
    done = capsys.readouterr()
    humans = [json.loads(line)["human"] for line in done.out.splitlines()]
    assert humans == [None, "success", "failed"]
    assert done.err.startswith("agreement with the labels: 1 of 2")
    assert main([*base, "--format", "jsonl", "--by", "folder"]) == 2
    assert "--by cannot be used with jsonl" in capsys.readouterr().err


def test_each_line_comes_as_soon_as_its_grade(capsys: pytest.CaptureFixture[str]) -> None:
    grades = (Graded(path, Grade.FAILED, False, False, "\u202e") for path in "ab")
    lines = streamed(grades, None, "jsonl", "-")
    for path in "ab":
        next(lines)
        line = capsys.readouterr().out
        assert "\u202e" not in line
        assert json.loads(line)["path"] == path
        assert json.loads(line)["reason"] == "\u202e"
    assert list(streamed([], None, "jsonl", "-")) == []


def test_the_agreement_with_labels(tmp_path: Path) -> None:
    labels = "path,human\nanswers/good.xml,S\nanswers/half.xml,F\nanswers/none.xml,?\nother.xml,P\n"
    folder(tmp_path, labels)
    words = ("grade", "--task", "task.yaml", "--labels", "labels.csv", "answers")
    decoded = run(*words, cwd=tmp_path).stdout.decode()
    assert decoded.endswith(
        "agreement with the labels: 1 of 2 (50.0 %, kappa 0.333)\n"
        "people \\ gpsfsm    success    partial     failed\n"
        "success                  1          0          0\n"
        "partial                  0          0          0\n"
        "failed                   0          1          0\n"
        "answers/half.xml: people say failed, gpsfsm partial\n"
    )
    done = run(*words, "--table", "csv", cwd=tmp_path)
    assert done.stderr.decode().startswith("agreement with the labels: 1 of 2")
    matrix = json.loads(run(*words, "--table", "json", cwd=tmp_path).stdout)["agreement"]["matrix"]
    assert matrix["failed"] == {"success": 0, "partial": 1, "failed": 0, "undecided": 0}


def test_what_cannot_be_read_ends_in_a_message(tmp_path: Path) -> None:
    folder(tmp_path, "path,human\nanswers/good.xml,excellent\n")
    done = run("grade", "answers", "--task", "none.yaml", cwd=tmp_path)
    assert (done.returncode, b"none.yaml" in done.stderr) == (2, True)
    done = run("grade", "answers", "--task", "task.yaml", "--labels", "labels.csv", cwd=tmp_path)
    assert done.returncode == 2
    assert b"labels.csv:2: 'excellent' is not a grade; write S, P or F" in done.stderr
    done = run("grade", "missing.xml", "--task", "task.yaml", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stdout.decode().startswith("undecided  missing.xml\n           not read: ")
    assert run("grade", "--task", "task.yaml", cwd=tmp_path).returncode == 2


def test_check_with_a_task(tmp_path: Path) -> None:
    folder(tmp_path)
    words = ("check", "--task", "task.yaml", "--select", "GP6")
    assert run(*words, "answers/good.xml", cwd=tmp_path).returncode == 0
    done = run(*words, "-q", "answers/half.xml", cwd=tmp_path)
    assert (done.returncode, done.stdout.decode()) == (
        1,
        "answers/half.xml:1:1: error GP605 skipped-alternative: "
        "when 'A' fails, the plan does not try 'B'\n",
    )
    assert run(*words, "--jobs", "2", "answers", cwd=tmp_path).returncode == 1
    assert run("check", "answers/half.xml", cwd=tmp_path).returncode == 0


def test_assumptions_hold_for_tasks_too(tmp_path: Path) -> None:
    folder(tmp_path)
    words = ("check", "--task", "task.yaml", "--assume", "never fails: GoRunner")
    assert run(*words, "answers/half.xml", cwd=tmp_path).returncode == 0


@pytest.mark.parametrize("name", NO_EFFECT["grade"])
def test_what_a_grade_does_not_depend_on_is_refused(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    option = BY_NAME[name]
    values = {"deadline": "5", "energy_limit": "5", "max_scenarios": "1", "total_rlimit": "9"}
    values |= {"select": "GP3", "ignore": "GP3", "engine": "fabric-v2", "tolerate": "1"}
    folder(tmp_path)
    task, plan = tmp_path / "task.yaml", tmp_path / "answers"
    words = [option.flag, *([values[name]] if name in values else [])]
    assert main(["grade", str(plan), "--task", str(task), *words]) == 2
    output = capsys.readouterr()
    assert not output.out
    assert f"{option.flag} has no effect on grade: {NO_EFFECT['grade'][name]}" in output.err


def test_a_shared_configuration_may_set_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "gpsfsm.toml").write_text('deadline = 5.0\nselect = ["GP3"]\nmax-scenarios = 1\n')
    folder(tmp_path)
    monkeypatch.chdir(tmp_path)
    assert main(["grade", "answers", "--task", "task.yaml"]) == 0
    assert "1 success" in capsys.readouterr().out
