"""``gpsfsm fuzz``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from gpsfsm.cli import main
from tests.cli.support import BROKEN, run, write
from tests.cli.terminal import Terminal, gpsfsm
from tests.fuzzing.support import control, go, plan

SAFE = plan(go("A"), go("B"))
ORPHAN = f"<Plan>\n  {control('parallel_any', go('A'), go('B'))}\n</Plan>\n"
MINE = """
def never_fails(run):
    "Nothing fails."
    assert not [event for event in run.events if event.kind == "FAILED"], "something fails"
"""
TASK = """
actions:
  a: {interface: A}
  b: {interface: B}
steps:
  - do: a
  - do: b
"""


def said(*arguments: str, capsys: pytest.CaptureFixture[str], code: int) -> str:
    assert main(["fuzz", *arguments]) == code
    out, err = capsys.readouterr()
    assert err == ""
    return out


def complained(*arguments: str, capsys: pytest.CaptureFixture[str]) -> str:
    assert main(["fuzz", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    return err


@pytest.fixture(autouse=True)
def _plans(_empty_folder: None) -> None:
    write(Path(), safe=SAFE, orphan=ORPHAN, broken=BROKEN)
    Path("mine.py").write_text(MINE)
    Path("task.yaml").write_text(TASK)


def test_nothing_found(capsys: pytest.CaptureFixture[str]) -> None:
    out = said("safe.xml", "--runs", "20", capsys=capsys, code=0)
    assert out.splitlines() == [
        "safe.xml: 20 runs, seed 0",
        "  held: ends, every run completes or gives up",
        "  held: no-orphan, when the plan completes, no runner is active any more",
        "  held: no-overlap, no two runners hold the same resource at once",
        "  held: replays, the journal of every run leads to the same events again",
    ]


def test_what_is_found_is_told_like_a_finding(capsys: pytest.CaptureFixture[str]) -> None:
    out = said(
        "orphan.xml", "--runs", "40", "--faults", "failed", "--property", "no-orphan",
        capsys=capsys, code=1,
    )  # fmt: skip
    first, *_, last = out.splitlines()
    text = "A at line 2 column 32 is still active when the plan completes"
    assert first == f"orphan.xml:2:32: warning fuzz no-orphan: {text}"
    assert "   | (element /Plan/Control[1]/Runner[1])\n" in out
    assert (
        "= scenario in which the plan completes:\n     1. 0 s: A at line 2 column 32 starts\n"
        in out
    )
    assert "1 s: the plan completes\n" in out
    holds = "when the plan completes, no runner is active any more"
    assert last == f"  broken (2 kinds): no-orphan, {holds}"


def test_as_data(capsys: pytest.CaptureFixture[str]) -> None:
    out = said("orphan.xml", "--runs", "30", "--format", "json", capsys=capsys, code=1)
    data: dict[str, Any] = json.loads(out)
    assert (data["fuzz"], data["plan"], data["runs"], data["seed"]) == (1, "orphan.xml", 30, 0)
    assert {one["name"]: one["broken"] for one in data["properties"]} == {
        **{"ends": 1, "no-orphan": 2, "no-overlap": 0, "replays": 0}
    }
    assert {each["name"] for each in data["findings"]} == {"ends", "no-orphan"}
    assert all(each["scenario"]["story"] for each in data["findings"])


def test_a_corpus_is_kept_and_played_first(capsys: pytest.CaptureFixture[str]) -> None:
    options = ("orphan.xml", "--property", "ends", "--corpus", "cases", "--seed", "3")
    out = said(*options, "--runs", "40", capsys=capsys, code=1)
    (case,) = Path("cases").glob("*.json")
    assert f"hint: gpsfsm fuzz --replay {case} plays this run again" in out
    before = case.read_bytes()
    out = said(*options, "--runs", "1", capsys=capsys, code=1)
    assert "orphan.xml: 2 runs, seed 3, 1 of them from the corpus\n" in out
    assert case.read_bytes() == before
    assert [*Path("cases").iterdir()] == [case]
    out = said("safe.xml", "--corpus", "cases", "--runs", "1", capsys=capsys, code=0)
    assert "1 case of other plans left out" in out


def test_a_case_is_played_again_without_the_plan(capsys: pytest.CaptureFixture[str]) -> None:
    options = ("orphan.xml", "--property", "ends", "--corpus", "cases")
    said(*options, "--runs", "40", capsys=capsys, code=1)
    (case,) = Path("cases").glob("*.json")
    Path("orphan.xml").unlink()
    out = said("--replay", str(case), capsys=capsys, code=1)
    assert "error fuzz ends: the plan" in out
    assert "orphan.xml: 1 run, seed 0\n  broken (1 kind): ends" in out
    mended = plan(control("parallel_any", go("A"), go("B")), control("recovery", go("C")))
    Path("mended.xml").write_text(mended)
    output = complained("safe.xml", "--replay", str(case), capsys=capsys)
    assert "the case does not fit safe.xml" in output
    assert main(["run", "mended.xml", "--scenario", str(case), "--format", "plain"]) in (0, 1)


def test_a_function_is_imported_only_if_it_is_asked_for(
    capsys: pytest.CaptureFixture[str],
) -> None:
    name = "mine.py:never_fails"
    options = ("--property", name, "--runs", "20", "--corpus", "cases")
    out = said("safe.xml", *options, capsys=capsys, code=1)
    assert f"error fuzz {name}: something fails" in out
    (case,) = Path("cases").glob("*.json")
    output = complained("--replay", str(case), capsys=capsys)
    assert f"if you trust it, name it with --property {name}" in output
    said("--replay", str(case), "--property", name, capsys=capsys, code=1)


def test_a_task_file(capsys: pytest.CaptureFixture[str]) -> None:
    said("safe.xml", "--task", "task.yaml", "--runs", "50", capsys=capsys, code=0)
    write(Path(), wrong=plan(go("B"), go("A")))
    out = said("wrong.xml", "--task", "task.yaml", "--runs", "5", capsys=capsys, code=1)
    assert "error fuzz task: " in out


def test_mutants(capsys: pytest.CaptureFixture[str]) -> None:
    out = said("safe.xml", "--mutate", "--task", "task.yaml", capsys=capsys, code=0)
    assert out == (
        "safe.xml: 7 mutants: the task file notices 7 of 7 (100%); "
        "0 the same as the plan; 0 undecided\n"
    )
    out = said("safe.xml", "--mutate", "--select", "GP307", capsys=capsys, code=1)
    assert out.splitlines()[0] == "safe.xml:1:7: missed drop: drops A at line 1 column 7"
    assert "the rules notice 0 of 7 (0%)" in out
    out = said(
        "safe.xml", "--mutate", "--select", "GP307", "--format", "json", capsys=capsys, code=1
    )
    data = json.loads(out)
    assert data["score"] == 0.0
    assert data["counts"] == {"equal": 0, "noticed": 0, "missed": 7, "undecided": 0}
    assert data["mutants"][0] == {
        "operator": "drop",
        "line": 1,
        "column": 7,
        "element": "/Plan/Runner[1]",
        "told": "drops A at line 1 column 7",
        "notice": "missed",
        "by": [],
    }


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "no plan is given"),
        (("missing.xml",), "missing.xml: cannot be read"),
        (("broken.xml",), "broken.xml: the text has errors"),
        (("safe.xml", "--faults", "rain"), "there is no fault 'rain'"),
        (("safe.xml", "--property", "order"), "there is no property 'order'"),
        (("safe.xml", "--property", "no_such:f"), "cannot be imported"),
        (("safe.xml", "--task", "missing.yaml"), "missing.yaml"),
        (("safe.xml", "--select", "GP3"), "--select needs --mutate"),
        (("safe.xml", "--mutate", "--faults", "hang"), "--faults and --mutate cannot be used"),
        (("safe.xml", "--mutate", "--select", "GP999"), "GP999"),
        (("safe.xml", "--timeout", "nan"), "'--timeout': nan is not a finite number"),
        (("safe.xml", "--corpus", ""), "--corpus needs a name"),
        (("--replay", "missing.json"), "missing.json: cannot be read"),
        (("--replay", "mine.py"), "mine.py:2:1: is not JSON"),
        (("safe.xml", "--replay", "mine.py", "--runs", "3"), "--runs cannot be used with --replay"),
        (("--replay", "mine.py", "--jobs", "2"), "--jobs cannot be used with --replay"),
        (("safe.xml", "--jobs", "many"), "'many' is not a value of --jobs"),
        (("safe.xml", "--engine", "fabric-v1"), "not as fabric-v1 does"),
        (("safe.xml", "--assume", "line 7 fails"), "line 7 contains no runner"),
        (("safe.xml", "--assume", "A fails and not A fails"), "admit no scenario"),
        (
            ("safe.xml", "--assume", "A fails iff B succeeds", "--assume", "all * succeed"),
            "admit no",
        ),
        (("safe.xml", "--mutate", "--assume", "line 1:7 fails"), "names a place of the plan"),
    ],
)
def test_what_cannot_be_done_is_told(
    arguments: tuple[str, ...], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert message in complained(*arguments, capsys=capsys)


def test_the_bytes_do_not_depend_on_the_jobs(capsys: pytest.CaptureFixture[str]) -> None:
    """Findings, their plainest runs, kept cases and mutants; also of a property of a file."""
    name = "mine.py:never_fails"
    Path("folder").mkdir()
    for arguments, code in (
        (("orphan.xml", "--runs", "90"), 1),
        (("orphan.xml", "--runs", "70", "--property", name, "--task", "task.yaml"), 1),
        (("safe.xml", "--runs", "70", "--consistent", "--assume", "any A fails"), 0),
        (("safe.xml", "--mutate", "--task", "task.yaml"), 0),
    ):
        corpus = () if "--mutate" in arguments else ("--corpus", "folder")
        actual = []
        for jobs in ("1", "2"):
            for case in Path("folder").iterdir():
                case.unlink()
            out = said(*arguments, *corpus, "--jobs", jobs, capsys=capsys, code=code)
            cases = {case.name: case.read_bytes() for case in Path("folder").iterdir()}
            actual.append((out, cases))
        assert actual[0] == actual[1]


def test_what_is_assumed_never_fails_is_found_to_hold(capsys: pytest.CaptureFixture[str]) -> None:
    options = ("--runs", "40", "--property", "completes")
    said("safe.xml", *options, capsys=capsys, code=1)
    sure = ("--assume", "all * succeed")
    said("safe.xml", *options, *sure, capsys=capsys, code=0)
    said("safe.xml", "--corpus", "cases", "--runs", "9", "--property", "completes",
         capsys=capsys, code=1)  # fmt: skip
    out = said("safe.xml", "--corpus", "cases", "--runs", "1", *sure, capsys=capsys, code=0)
    assert "1 case of other plans or scenarios left out" in out
    assert main(["fuzz", "safe.xml", "--runs", "1", "--assume", "never fails: Fly"]) == 0
    assert "matches no runner of the plan: Fly" in capsys.readouterr().err


def test_assumptions_make_mutants_equal(capsys: pytest.CaptureFixture[str]) -> None:
    """What follows a step that never fails as its recovery does nothing."""
    write(Path(), guarded=plan(go("A"), control("recovery", go("B"))))
    options = ("guarded.xml", "--mutate", "--format", "json", "--select", "GP307")
    usual = json.loads(said(*options, capsys=capsys, code=1))
    sure = json.loads(said(*options, "--assume", "all A succeed", capsys=capsys, code=1))
    assert sure["counts"]["equal"] > usual["counts"]["equal"]


def test_an_engine_of_the_settings_is_not_passed_over(capsys: pytest.CaptureFixture[str]) -> None:
    Path("gpsfsm.toml").write_text('engine = "fabric-v2"\n')
    output = complained("safe.xml", capsys=capsys)
    assert "fuzz runs plans by the paper's semantics, not as fabric-v2 does" in output
    said("safe.xml", "--engine", "paper", "--runs", "3", capsys=capsys, code=0)


def test_a_plan_without_runners_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    write(Path(), empty="<Plan/>")
    assert "has no runner" in complained("empty.xml", capsys=capsys)


def test_standard_input_and_the_help() -> None:
    done = run("fuzz", "-", "--runs", "5", stdin=SAFE.encode())
    assert done.returncode == 0
    assert done.stdout.startswith(b"<stdin>: 5 runs, seed 0\n")
    assert b"Run the plan in PATH many times" in run("fuzz", "--help").stdout


def test_a_progress_bar_is_shown_on_a_terminal_only(tmp_path: Path) -> None:
    command = gpsfsm("fuzz", "safe.xml", "--runs", "400")
    with Terminal(command, tmp_path) as terminal:
        shown = terminal.until("seed 0")
    assert "runs" in shown
    assert "/400" in shown
