"""``gpsfsm gate``: exit codes, strictness, what is written, and receipts."""

from __future__ import annotations

import json
import os
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
from lxml import etree

import gpsfsm
from gpsfsm.cli import main
from gpsfsm.cli._gating import _BUDGET_MS, _LEAST_MEMORY_MB, _MAX_BUDGET_MS, _MEMORY_MB
from gpsfsm.gating import GateOptions, Verdict, gate_text
from gpsfsm.gating.gate_process import (
    DEFAULT_BUDGET_MS,
    DEFAULT_MEMORY_MB,
    LEAST_MEMORY_MB,
    MAX_BUDGET_MS,
)
from tests.cli.support import ACCEPTED, BROKEN, REJECTED, WARNED, run, runner, shell, write

HUGE = "<Plan>" + runner() * 60_000 + "</Plan>"
ALONE = "accepted (structure only: no task was given)"


class InThisProcess:
    """Decides as the worker does. Starting a worker is what takes time here."""

    def __init__(
        self, options: GateOptions, *, budget_ms: int, memory_mb: int, started: object
    ) -> None:
        self.options = options
        assert budget_ms >= 1
        assert memory_mb >= LEAST_MEMORY_MB

    def __enter__(self) -> InThisProcess:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def __call__(self, text: bytes, name: str) -> Verdict:
        return gate_text(text, name, self.options)


class Nobody:
    def end(self) -> None:
        pass


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gpsfsm.gating.Gate", InThisProcess)
    monkeypatch.setattr("gpsfsm.gating.gate_process.start_worker", Nobody)


def gate(
    *arguments: str, capsys: pytest.CaptureFixture[str], code: int = 0, errors: bool = False
) -> str:
    assert main(["gate", *arguments]) == code
    output = capsys.readouterr()
    assert (output.err != "") == errors
    return output.err if errors else output.out


@pytest.mark.usefixtures("here")
def test_the_verdict_is_the_exit_code(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=ACCEPTED, b=REJECTED, c=BROKEN, d="<Plan/>")
    assert gate("a.xml", capsys=capsys) == f"a.xml: {ALONE}\n"
    text = gate("b.xml", capsys=capsys, code=1)
    assert text.splitlines()[0].startswith("b.xml:2:3: error GP307 ")
    assert text.splitlines()[1:] == ["b.xml: rejected: findings: 1 finding of level error or worse"]
    assert "rejected: findings" in gate("c.xml", capsys=capsys, code=1)
    assert "rejected: empty" in gate("d.xml", capsys=capsys, code=1)
    assert gate("d.xml", "--allow-empty", capsys=capsys) == f"d.xml: {ALONE}\n"
    text = gate("a.xml", "missing.xml", "b.xml", capsys=capsys, code=2)
    assert "missing.xml: undecided: unreadable: cannot be read: No such file or directory" in text
    assert text.endswith("3 plans: 1 accepted, 1 rejected, 1 undecided\n")


@pytest.mark.usefixtures("here")
def test_nothing_is_not_accepted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "no plan is given" in gate(capsys=capsys, code=2, errors=True)
    assert "no plan is given" in gate("", capsys=capsys, code=2, errors=True)
    (tmp_path / "empty").mkdir()
    assert "undecided: unreadable" in gate("empty", capsys=capsys, code=2)


def test_what_takes_too_long_is_refused_and_the_others_are_decided(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=HUGE, b="<Plan>", c="<Plan")
    text = gate("a.xml", "--budget-ms", "1", capsys=capsys, code=2)
    line = "a.xml: undecided: inconclusive: the plan is undecided after 1 ms (--budget-ms)"
    assert line in text.splitlines()
    text = gate(".", "--budget-ms", "400", capsys=capsys, code=2)
    assert "a.xml: undecided: inconclusive" in text
    assert "b.xml: rejected: findings" in text
    assert (_BUDGET_MS, _MAX_BUDGET_MS) == (DEFAULT_BUDGET_MS, MAX_BUDGET_MS)
    assert (_MEMORY_MB, _LEAST_MEMORY_MB) == (DEFAULT_MEMORY_MB, LEAST_MEMORY_MB)


@pytest.mark.usefixtures("here")
def test_a_limit_of_steps_is_a_refusal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=f"<Plan>{runner()}{runner()}</Plan>")
    text = gate("a.xml", "--consistent", "--total-rlimit", "1", capsys=capsys, code=2)
    assert "a.xml: undecided: inconclusive" in text


@pytest.mark.usefixtures("here")
def test_neither_comments_nor_files_that_lie_about_excuse_anything(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The author of a plan is no judge: only what the call names counts."""
    write(tmp_path, a=f"<!-- gpsfsm: ignore GP307 because I say so -->{REJECTED}")
    (tmp_path / "gpsfsm.toml").write_text('ignore = ["ALL"]\nfail-on = "never"\n', "utf-8")
    assert main(["check", "a.xml"]) == 0
    capsys.readouterr()
    gate("a.xml", capsys=capsys, code=1)
    gate("a.xml", "--ignore", "ALL", capsys=capsys, code=1)
    accepted = gate("a.xml", "--allow-suppressions", capsys=capsys).splitlines()[-1]
    assert accepted == f"a.xml: {ALONE}, 1 finding suppressed by comments"


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("hidden", [(), ("--ignore", "GP307")])
def test_what_comments_excuse_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], hidden: tuple[str, ...]
) -> None:
    """In the lines of a check, whatever becomes of the plan; options hide no error."""
    comment = "<!-- gpsfsm: ignore GP307 because I say so -->"
    write(tmp_path, a=f"{comment}{REJECTED}", b=f"{comment}{REJECTED}{REJECTED}")
    assert main(["check", "a.xml", "--quiet", "--allow-suppressions", "--ignore", "GP302"]) == 0
    (line,) = capsys.readouterr().out.splitlines()
    assert "suppressed error GP307" in line
    words = ("--allow-suppressions", *hidden)
    assert gate("a.xml", *words, capsys=capsys) == (
        f"{line}\na.xml: {ALONE}, 1 finding suppressed by comments\n"
    )
    (plan,) = receipt(capsys, "a.xml", *words)["plans"]
    (message,) = plan["suppressed_findings"]
    assert (message["rule"], message["justification"]) == ("GP307", "I say so")
    for name in ("junit", "markdown", "github"):
        assert "I say so" in gate("a.xml", *words, "--format", name, capsys=capsys)
    refused = gate("b.xml", "--fail-on", "warning", *words, capsys=capsys, code=1)
    assert ": error GP101 " in refused
    (plan,) = receipt(capsys, "a.xml", *hidden, code=1)["plans"]
    assert plan["suppressed_findings"] == []


@pytest.mark.usefixtures("here")
def test_a_configuration_file_that_is_named_counts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=WARNED)
    (tmp_path / "strict.toml").write_text('fail-on = "warning"\nquiet = true\n', "utf-8")
    (tmp_path / "lax.toml").write_text('fail-on = "never"\n', "utf-8")
    assert "GP203" in gate("a.xml", "--config", "strict.toml", capsys=capsys, code=1)
    gate("a.xml", "--config", "strict.toml", "--fail-on", "error", capsys=capsys)
    text = gate("a.xml", "--config", "lax.toml", capsys=capsys, code=2, errors=True)
    assert "'fail-on' must be error or warning for a gate" in text
    gate("a.xml", "--config", "missing.toml", capsys=capsys, code=2, errors=True)


@pytest.mark.usefixtures("here")
def test_a_file_that_may_not_be_read_does_not_keep_others_from_being_decided(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Reading tells why it fails; the command line must not refuse all paths for one."""
    write(tmp_path, a=ACCEPTED, b=ACCEPTED)
    (tmp_path / "b.xml").chmod(0)
    monkeypatch.setattr(os, "access", lambda *_, **__: False)
    if os.geteuid() == 0:  # who may read everything
        assert gate("a.xml", "b.xml", capsys=capsys).endswith("2 plans: 2 accepted\n")
        return
    text = gate("a.xml", "b.xml", capsys=capsys, code=2)
    assert f"a.xml: {ALONE}\n" in text
    assert "b.xml: undecided: unreadable: cannot be read: Permission denied\n" in text


@pytest.mark.usefixtures("here")
def test_behaviour_trees_are_refused_unless_allowed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, t='<root BTCPP_format="4"><BehaviorTree ID="a"><Go/></BehaviorTree></root>')
    assert main(["gate", "t.xml"]) == 1
    assert "; with --allow-trees, it decides them" in capsys.readouterr().err
    assert gate("t.xml", "--allow-trees", capsys=capsys) == f"t.xml: {ALONE}\n"
    (tmp_path / "t.xml").write_text((tmp_path / "t.xml").read_text(), encoding="utf-16")
    assert main(["gate", "t.xml"]) == 1
    assert "; with --allow-trees, it decides them" in capsys.readouterr().err


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("example", ["a.xml", "t.xml"])
def test_a_task_may_name_plans_and_trees_that_are_no_answers(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], example: str
) -> None:
    tree = '<root BTCPP_format="4"><BehaviorTree ID="a"><Sequence><Go/></Sequence></BehaviorTree>'
    write(tmp_path, a=ACCEPTED, t=f"{tree}</root>")
    task = "task: Go.\nactions:\n  go: {interface: Go}\nsteps:\n  - do: go\nothers: allowed\n"
    task += f"not_answers: [{example}]\n"
    (tmp_path / "task.yaml").write_text(task, "utf-8")
    text = gate("a.xml", "--task", "task.yaml", capsys=capsys, code=1)
    assert "GP601" in text
    assert ("GP609" in text) == (example == "a.xml")


@pytest.mark.usefixtures("here")
def test_a_task_and_an_engine_count(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=ACCEPTED)
    task = "task: Speak.\nactions:\n  speak: {interface: SpeechRunner}\nsteps:\n  - do: speak\n"
    (tmp_path / "task.yaml").write_text(task, "utf-8")
    assert "GP601" in gate("a.xml", "--task", "task.yaml", capsys=capsys, code=1)
    gate("a.xml", "--task", "missing.yaml", capsys=capsys, code=2, errors=True)
    text = gate("a.xml", "--engine", "fabric-v2", "--format", "json", capsys=capsys, code=1)
    (plan,) = json.loads(text)["plans"]
    assert plan["facts"]["engine"]["name"] == "fabric-v2"
    assert plan["facts"]["engine"]["hangs"] == "sometimes"
    assert {each["rule"] for each in plan["findings"]} == {"GP708"}


@pytest.mark.usefixtures("here")
def test_one_decision_is_written_in_several_formats(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=ACCEPTED, b=REJECTED)
    (tmp_path / "summary.md").write_text("before\n", "utf-8")
    names = ("json", "sarif", "junit", "gitlab", "github")
    reports = [word for name in names for word in ("--report", f"{name}={name}.out")]
    text = gate("a.xml", "b.xml", *reports, "--summary", "summary.md", capsys=capsys, code=1)
    assert text.endswith("2 plans: 1 accepted, 1 rejected\n")
    receipt = json.loads(Path("json.out").read_text("utf-8"))
    assert [each["verdict"] for each in receipt["plans"]] == ["accepted", "rejected"]
    assert receipt["accepted"] is False
    sarif = json.loads(Path("sarif.out").read_text("utf-8"))
    levels = [each["level"] for each in sarif["runs"][0]["results"]]
    assert levels.count("error") == 1
    junit = etree.parse("junit.out").getroot()
    assert (junit.get("tests"), junit.get("failures"), junit.get("errors")) == ("2", "1", "0")
    assert json.loads(Path("gitlab.out").read_text("utf-8"))
    assert "::error file=b.xml" in Path("github.out").read_text("utf-8")
    summary = Path("summary.md").read_text("utf-8")
    assert summary.startswith("before\n### gpsfsm ")
    assert "| b.xml | **rejected** |" in summary


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--report", "sarif"), "--report takes NAME=FILE"),
        (("--report", "=x"), "there is no format ''"),
        (("--report", "xlsx=x"), "there is no format 'xlsx'"),
        (("--format", "xlsx"), "there is no format 'xlsx'"),
        (("--report", "sarif=a.xml"), "gpsfsm: writing a.xml would overwrite a plan"),
        (("--summary", "a.xml"), "gpsfsm: writing a.xml would overwrite a plan"),
        (("--report", "json=x", "--report", "sarif=./x"), "would be written twice"),
        (("--report", "json=x", "--summary", "x"), "would be written twice"),
        (("-o", "x", "--report", "json=x"), "would be written twice"),
        (("--report", "sarif=no/such/x"), "its folder does not exist"),
        (("--summary", ""), "cannot write"),
        (("--summary", "no/such/x"), "cannot write"),
        (("--fail-on", "never"), "'never'"),
        (("--budget-ms", "0"), "0 is not in the range"),
        (("--assume", "(("), "expected a claim"),
        (("--verify", "missing.json"), "missing.json: cannot be read"),
        (("--engine", "fabric-v2", "--solver", "structural"), "structural"),
    ],
)
def test_what_makes_no_sense_is_told_and_nothing_is_accepted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: tuple[str, ...], message: str
) -> None:
    write(tmp_path, a=ACCEPTED)
    assert main(["gate", "a.xml", *options]) == 2
    assert message in capsys.readouterr().err
    assert Path("a.xml").read_text("utf-8") == ACCEPTED


def receipt(capsys: pytest.CaptureFixture[str], *arguments: str, code: int = 0) -> Any:
    options = ("--format", "json", "-o", "receipt.json")
    gate(*arguments, *options, capsys=capsys, code=code)
    return json.loads(Path("receipt.json").read_text("utf-8"))


@pytest.mark.usefixtures("here")
def test_a_receipt_tells_the_plan_that_was_accepted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=ACCEPTED, b=REJECTED)
    receipt(capsys, "a.xml", "b.xml", code=1)
    verify = ("--verify", "receipt.json")
    assert gate("a.xml", *verify, capsys=capsys) == "a.xml: as accepted\n"
    text = gate("b.xml", *verify, capsys=capsys, code=1)
    assert text == "b.xml: not as accepted: the plan is another one\n"
    text = gate("a.xml", *verify, "--fail-on", "warning", capsys=capsys, code=1)
    assert text == "a.xml: not as accepted: the options are others\n"
    text = gate("a.xml", *verify, "--no-builtin-capabilities", capsys=capsys, code=1)
    assert text == "a.xml: not as accepted: the capabilities are others\n"
    assert gate("a.xml", *verify, "--budget-ms", "7", capsys=capsys) == "a.xml: as accepted\n"
    gate("a.xml", "missing.xml", *verify, capsys=capsys, code=2)
    write(tmp_path, a=ACCEPTED.replace("Plan>\n", "Plan> \n", 1))
    gate("a.xml", *verify, capsys=capsys, code=1)


@pytest.mark.usefixtures("here")
def test_the_call_in_python_has_the_same_digests(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=WARNED)
    (plan,) = receipt(capsys, "a.xml")["plans"]
    assert plan["digests"] == asdict(gpsfsm.gate(Path("a.xml"), budget_ms=None).digests)
    (plan,) = receipt(capsys, "a.xml", "--fail-on", "warning", "--engine=fabric-v1", code=1)[
        "plans"
    ]
    other = gpsfsm.gate(Path("a.xml"), budget_ms=None, fail_on="warning", engine="fabric-v1")
    assert plan["digests"] == asdict(other.digests)


def test_what_cannot_be_told_is_no_acceptance(tmp_path: Path) -> None:
    write(tmp_path, a=ACCEPTED)
    for command in ("$NEW_GPSFSM gate a.xml >&-", "$GPSFSM gate a.xml > /dev/full"):
        assert shell(command, tmp_path).returncode == 2


@pytest.mark.usefixtures("here")
def test_a_receipt_of_another_version_accepts_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=ACCEPTED)
    accepted_plans = receipt(capsys, "a.xml")
    digests = accepted_plans["plans"][0]["digests"]
    assert set(digests) == {"plan", "capabilities", "options", "version", "all"}
    digests["version"] = "0.0.0"
    changed = dict(digests)
    for name, message in (("all", "this is another version"), ("version", "contradicts itself")):
        digests |= (
            changed | {"all": "0"} | ({"version": gpsfsm.__version__} if name == "version" else {})
        )
        Path("receipt.json").write_text(json.dumps(accepted_plans), "utf-8")
        assert message in gate("a.xml", "--verify", "receipt.json", capsys=capsys, code=1)


@pytest.mark.parametrize(
    "content",
    ["", "{}", "[]", "null", "[" * 100_000, '{"version": 1, "plans": []}', '{"version": 3}'],
)
def test_what_is_no_receipt_accepts_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str
) -> None:
    write(tmp_path, a=ACCEPTED)
    Path("receipt.json").write_text(content, "utf-8")
    gate("a.xml", "--verify", "receipt.json", capsys=capsys, code=2, errors=True)
    if content.endswith('"plans": []}'):
        text = gate("a.xml", "--verify", "receipt.json", capsys=capsys, code=2, errors=True)
        assert "version 1, of an earlier gpsfsm" in text
        assert "decide again with 'gpsfsm gate --format json'" in text
    Path("receipt.json").write_text('{"version": 3, "plans": []}', "utf-8")
    text = gate("a.xml", "--verify", "receipt.json", capsys=capsys, code=1)
    assert text == "a.xml: not as accepted: no plan was accepted\n"


def test_the_output_is_the_same_in_every_process(tmp_path: Path) -> None:
    write(tmp_path, a=ACCEPTED, b=REJECTED)
    output = {
        run("gate", "a.xml", "b.xml", "--format", "json", env={"PYTHONHASHSEED": seed}).stdout
        for seed in ("1", "2")
    }
    assert len(output) == 1


def test_standard_input_and_prose_are_read(tmp_path: Path) -> None:
    done = run("gate", "-", stdin=ACCEPTED.encode())
    assert (done.returncode, done.stdout) == (
        0,
        f"<stdin>: {ALONE}\n".encode(),
    )
    answer = f"Sure!\n{ACCEPTED}".encode()
    assert run("gate", "-", stdin=answer).returncode == 1
    assert run("gate", "-", "--from-response", stdin=answer).returncode == 0


def test_to_ignore_warnings_that_refuse_nothing_is_refused(
    here: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plan = str(tmp_path / "a.xml")
    Path(plan).write_text(ACCEPTED)
    assert main(["gate", plan, "--ignore", "GP111,GP203"]) == 2
    output = capsys.readouterr()
    assert not output.out
    assert "--ignore has no effect on a gate that lets warnings pass" in output.err
    assert "add --fail-on warning" in output.err
    assert main(["gate", plan, "--ignore", "GP302", "--fail-on", "warning"]) == 0
    (tmp_path / "shared.toml").write_text('ignore = ["GP111"]\n')  # it is for check as well
    assert main(["gate", plan, "--config", str(tmp_path / "shared.toml")]) == 0
