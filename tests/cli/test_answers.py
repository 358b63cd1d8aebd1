"""Answers of models as JSON lines: each line is an answer, and none is skipped."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gpsfsm
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.checking import inputs as module
from gpsfsm.checking.check import options_for
from gpsfsm.checking.inputs import FIELDS, Input, find_inputs, read_bytes
from gpsfsm.cli import main
from gpsfsm.errors import UsageError
from gpsfsm.report.json import plan_line, schema
from tests.cli.support import ACCEPTED, REJECTED, run

RESPONSES = Path(__file__).parents[3] / "shared" / "corpus" / "experiment1" / "responses.jsonl"
TASK = "task: Go.\nactions:\n  go: {interface: Go}\nsteps:\n  - do: go\n"
PROSE = f"Sure, here is the plan:\n```xml\n{ACCEPTED}\n```"


def lines(folder: Path, *records: object, name: str = "answers.jsonl") -> str:
    path = folder / name
    texts = (each if isinstance(each, str) else json.dumps(each) for each in records)
    path.write_text("".join(f"{each}\n" for each in texts), "utf-8")
    return str(path)


def checked(capsys: pytest.CaptureFixture[str], *arguments: str, code: int) -> list[dict[str, Any]]:
    assert main(["check", *arguments, "--format", "jsonl"]) == code
    return [json.loads(line) for line in capsys.readouterr().out.splitlines()]


def test_each_line_is_an_answer(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = lines(tmp_path, {"id": 1, "response": PROSE}, {"response": REJECTED})
    plans = checked(capsys, file, code=1)
    assert [each["path"] for each in plans] == [f"{file}:1", f"{file}:2"]
    assert [each["verdict"] for each in plans] == ["accepted", "rejected"]
    (error,) = (each for each in plans[1]["findings"] if each["severity"] == "error")
    assert error["location"]["line"] == 2  # of the answer


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("", "is an empty line"),
        ("{", "is not JSON: "),
        ("[" * 100_000, "is not JSON"),
        ("[]", "is not a JSON object"),
        ('{"response": 3}', "has no text in any of response, response_text, "),
        ("{}", "has no text in any of "),
        (
            '{"response": "a", "plan": "b"}',
            "has a text in response and plan; name the right one with --field",
        ),
        ('{"response": "a", "response": "b"}', "is not JSON: the key 'response' occurs twice"),
    ],
)
def test_a_line_without_an_answer_is_unreadable(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], line: str, why: str
) -> None:
    file = lines(tmp_path, {"response": ACCEPTED}, line, {"response": ACCEPTED})
    plans = checked(capsys, file, code=2)
    assert [each["verdict"] for each in plans] == ["accepted", "undecided", "accepted"]
    (finding,) = plans[1]["findings"]
    assert (finding["rule"], plans[1]["path"]) == ("GP901", f"{file}:2")
    assert why in finding["message"]


def test_bytes_that_are_no_text_cost_their_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "a.ndjson"
    good = json.dumps({"plan": ACCEPTED}).encode()
    file.write_bytes(b'\xef\xbb\xbf{"plan": "\xff"}\r\n' + good + b"\r\n" + good)
    plans = checked(capsys, str(file), code=2)
    assert [each["verdict"] for each in plans] == ["undecided", "accepted", "accepted"]
    assert "is not UTF-8 at byte 11 of the line" in plans[0]["findings"][0]["message"]


def test_the_field_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record = {"response": REJECTED, "x": {"y": ACCEPTED, "n": 1}, "a.b": ACCEPTED}
    file = lines(tmp_path, record)
    for field, code in (("x.y", 0), ("a.b", 0), ("response", 1), ("x.z", 2), ("x", 2), ("x.n", 2)):
        assert len(checked(capsys, file, "--field", field, code=code)) == 1
    done = run("check", "-", "--field", "x.y", "--format", "jsonl", stdin=Path(file).read_bytes())
    assert (done.returncode, json.loads(done.stdout)["path"]) == (0, "<stdin>:1")


def test_a_field_without_lines_makes_no_sense(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.xml").write_text(ACCEPTED, "utf-8")
    assert main(["check", str(tmp_path / "a.xml"), "--field", "x"]) == 2
    assert "--field needs JSON lines" in capsys.readouterr().err


def test_plans_and_answers_are_read_differently(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = lines(tmp_path, {"response": ACCEPTED})
    (tmp_path / "a.xml").write_text(ACCEPTED, "utf-8")
    assert main(["check", file, str(tmp_path / "a.xml")]) == 2
    assert "check them in two calls" in capsys.readouterr().err
    assert main(["check", file, str(tmp_path / "a.xml"), "--from-response"]) == 0


def test_bounds_and_files_without_lines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = lines(tmp_path, *([{"plan": "a"}] * 3))
    monkeypatch.setattr(module, "MOST_LINES", 2)
    paths = list(find_inputs([file]))
    assert [each.path for each in paths] == [f"{file}:1", f"{file}:2", file]
    assert paths[-1].problem == "holds 3 lines; only the first 2 are read"
    empty = lines(tmp_path, name="empty.jsonl")
    assert [each.problem for each in find_inputs([empty])] == ["holds no answer: it is empty"]
    assert "No such file" in next(find_inputs([str(tmp_path / "none.jsonl")])).problem
    monkeypatch.setattr(module, "MOST_LINES_BYTES", 10)
    assert len(list(find_inputs([file]))) == 1
    assert next(find_inputs([file])).problem


@given(st.lists(st.text(max_size=20), min_size=1, max_size=6), st.sampled_from(FIELDS))
def test_what_is_written_is_read(answers: list[str], field: str) -> None:
    for text in answers:
        assert module._answer(json.dumps({"id": 1, field: text}).encode(), None).decode() == text
        nested = json.dumps({"a": {"b": text}}, ensure_ascii=False).encode()
        assert module._answer(nested, "a.b").decode() == text


def test_the_gate_takes_the_plan_of_each_line_as_it_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = lines(tmp_path, {"response": ACCEPTED}, {"response": PROSE})
    assert main(["gate", file, "--format", "json"]) == 1
    plans = json.loads(capsys.readouterr().out)["plans"]
    assert [each["verdict"] for each in plans] == ["accepted", "rejected"]


def test_the_gate_takes_a_field(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = lines(tmp_path, {"response": REJECTED, "x": {"y": ACCEPTED}})
    receipt = str(tmp_path / "receipt.json")
    assert main(["gate", file]) == 1
    assert main(["gate", file, "--field", "x.y", "--format", "json", "-o", receipt]) == 0
    assert main(["gate", file, "--field", "x.y", "--verify", receipt]) == 0
    assert main(["gate", file, "--verify", receipt]) == 1
    assert f"{file}:1: as accepted" in capsys.readouterr().out


@pytest.mark.parametrize("command", ["check", "gate", "grade"])
def test_no_report_overwrites_the_answers(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    file = lines(tmp_path, {"response": ACCEPTED})
    before = Path(file).read_bytes()
    (tmp_path / "task.yaml").write_text(TASK, "utf-8")
    assert main([command, file, "--task", str(tmp_path / "task.yaml"), "-o", file]) == 2
    assert "would overwrite a plan" in capsys.readouterr().err
    assert Path(file).read_bytes() == before


def test_each_line_obeys_the_schema_and_is_one_line() -> None:
    document = schema()
    entry = {"$ref": "#/$defs/plan", "$defs": document["$defs"]}
    for text in (ACCEPTED, REJECTED, "no\nplan \ud800"):
        report = replace(check_text(text, "a\n\ud800.xml", CheckOptions()))
        line = plan_line(report)
        assert line.count("\n") == 1
        plan = json.loads(line)
        assert plan.pop("version") == document["properties"]["version"]["const"]
        assert plan == report.to_dict()
        jsonschema.validate(plan, entry)


def test_options_are_kept_without_answers() -> None:
    options = CheckOptions()
    assert options_for([Input("a.xml")], options) is options
    with pytest.raises(UsageError):
        options_for([Input("a.xml"), Input("a.jsonl:1", answers="a.jsonl")], options)


@pytest.mark.skipif(not RESPONSES.is_file(), reason="the shared answers are not here")
@pytest.mark.parametrize("jobs", [1, 2])
def test_real_answers_are_graded_as_one_by_one(tmp_path: Path, jobs: int) -> None:
    file = tmp_path / "answers.jsonl"
    real = RESPONSES.read_text("utf-8").splitlines()[::60]
    file.write_text("\n".join(real), "utf-8")
    (tmp_path / "task.yaml").write_text(TASK, "utf-8")
    table = gpsfsm.grade(file, tmp_path / "task.yaml", jobs=jobs)
    alone = [
        gpsfsm.grade(json.loads(each)["response"].encode(), tmp_path / "task.yaml").grades[0]
        for each in real
    ]
    assert [each.grade for each in table.grades] == [each.grade for each in alone]
    assert [each.path for each in table.grades] == [f"{file}:{n}" for n in range(1, len(real) + 1)]
    texts = [read_bytes(each, 1 << 20).decode() for each in find_inputs([str(file)])]
    assert texts == [json.loads(each)["response"] for each in real]
