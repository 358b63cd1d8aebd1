"""``gpsfsm run`` with several plans: those that are given, and those that plans submit."""

from __future__ import annotations

import json
import re
import shutil
import signal
import sqlite3
import subprocess
from typing import TYPE_CHECKING

import pytest

from gpsfsm.cli import main
from gpsfsm.execution.journal_read import JournalReader
from tests.cli.support import REJECTED, run, runner, shell, start, write
from tests.conftest import REPO

if TYPE_CHECKING:
    from pathlib import Path

HOME = REPO / "corpus" / "worlds" / "home.yaml"
MISSION = REPO / "corpus" / "missions" / "ask_and_replan.xml"
WAIT = "generic_capabilities/WaitRunner"
PROMPT = "prompt_capabilities/PromptPlanRunner"
SET = "fabric_capabilities/FabricSetPlanRunner"


def plan(*runners: str) -> str:
    return "<Plan>\n" + "\n".join(runners) + "\n</Plan>\n"


def wait(seconds: float) -> str:
    return f'<Runner interface="{WAIT}" provider="{WAIT}" seconds="{seconds}"/>'


def setting(task: str) -> str:
    """Have the model write a plan, and submit it."""
    ask = f'<Runner interface="{PROMPT}" provider="{PROMPT}" replan="false" uuid="u" flush="true"'
    return f'{ask} task="{task}"/>\n<Runner interface="{SET}" provider="{SET}"/>'


def world(folder: Path, task: str, answer: str) -> str:
    """A world whose model answers a task."""
    results = {"world": 1, "answers": [{"to": "PromptPlanRunner", "asked": task, "text": answer}]}
    (folder / "world.yaml").write_text(json.dumps(results), encoding="utf-8")
    return "world.yaml"


def ran(*arguments: str, capsys: pytest.CaptureFixture[str], code: int = 0) -> tuple[str, str]:
    exit_code = main(["run", *arguments])
    out, err = capsys.readouterr()
    assert exit_code == code, (exit_code, out, err)
    return out, err


def queue_rows(journal: str | Path) -> list[tuple[str, int, int]]:
    """The rows of the plan queue: what, which plan, who."""
    with JournalReader(str(journal)) as reader:
        assert reader.verify_queue()
        return [(kind, number, by) for _, _, kind, number, by, _, _ in reader.queue()]


def exported(folder: Path, *runs: int) -> list[bytes]:
    completeds = [
        run("events", "run.db", "--run", f"{number}", "--format", "jsonl", "--verify", cwd=folder)
        for number in runs
    ]
    assert [done.returncode for done in completeds] == [0] * len(runs)
    return [done.stdout for done in completeds]


def test_two_plans(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=plan(runner()), b=plan(runner(x="5"), runner(x="7")))
    arguments = ("--seed", "3", "--failure", "0")
    out, _ = ran("a.xml", "b.xml", *arguments, "--journal", "run.db", capsys=capsys)
    first, _ = ran("a.xml", *arguments, capsys=capsys)
    second, _ = ran("b.xml", "--seed", "4", "--failure", "0", capsys=capsys)
    assert out == f"== plan 1: a.xml\n{first}== plan 2: b.xml\n{second}"
    assert queue_rows("run.db") == [
        ("SUBMITTED", 1, 0), ("SUBMITTED", 2, 0),
        ("BEGUN", 1, 0), ("RUN", 1, 0), ("ENDED", 1, 0),
        ("BEGUN", 2, 0), ("RUN", 2, 0), ("ENDED", 2, 0),
    ]  # fmt: skip
    for number in ("1", "2"):
        assert main(["replay", "run.db", "--run", number]) == 0
        assert "and simulated again" in capsys.readouterr().out


def test_lines_of_json_have_a_heading_for_each_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=plan(runner()), b=plan(runner(x="5")))
    both, _ = ran("a.xml", "b.xml", "--failure", "0", "--format", "json", capsys=capsys)
    one, _ = ran("a.xml", "--failure", "0", "--format", "json", capsys=capsys)
    assert both.startswith(one)
    assert [json.loads(line).get("journal") for line in both.splitlines()].count(1) == 2


def test_a_refused_plan_does_not_keep_others_from_running(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=plan(runner()), b=REJECTED, c=plan(runner(x="9")))
    out, err = ran(
        "a.xml", "b.xml", "c.xml", "--failure", "0", "--journal", "run.db", capsys=capsys, code=1
    )
    assert "b.xml:2:3: error GP307" in err
    assert "b.xml: the plan has errors, so it is not run" in err
    assert re.findall("^== .*", out, re.MULTILINE) == ["== plan 1: a.xml", "== plan 3: c.xml"]
    assert out.count("COMPLETED") == 2
    assert ("REFUSED", 2, 0) in queue_rows("run.db")
    with JournalReader("run.db") as reader:
        (data,) = [row[5] for row in reader.queue() if row[2] == "REFUSED"]
    assert json.loads(data)["findings"][0].startswith("GP307 at line 2: ")


def test_the_worst_exit_code_counts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=plan(runner()), b=plan(runner(), runner(), runner()), c=REJECTED)
    out, _ = ran("a.xml", "b.xml", "--failure", "1", capsys=capsys, code=1)
    assert out.count("GAVE_UP") == 2
    arguments = ("--failure", "0", "--max-elements", "3")
    out, err = ran("c.xml", "b.xml", "a.xml", *arguments, capsys=capsys, code=2)
    assert ("GP103" in err, "GP307" in err, out.count("COMPLETED")) == (True, True, 1)
    assert "nowhere.xml" in ran("a.xml", "nowhere.xml", capsys=capsys, code=2)[1]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["a.xml", "a.xml", "--scenario", "x"], "--scenario takes one plan"),
        (["a.xml", "a.xml", "--max-plans", "1"], "more plans than --max-plans allows"),
        (["a.xml", "--bond", "3"], "--bond needs --real"),
        (["-", "--real", "--bond", "3"], "--bond cannot be used with a plan on standard input"),
    ],
)
def test_options_that_make_no_sense(
    arguments: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=plan(runner()))
    assert said in ran(*arguments, capsys=capsys, code=2)[1]


def test_a_plan_that_a_model_writes_runs_next_in_the_same_world(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    journal = str(tmp_path / "run.db")
    out, err = ran(str(MISSION), "--world", str(HOME), "--journal", journal, capsys=capsys)
    assert err == ""
    first, second = out.split("== plan 2 from FabricSetPlanRunner\n")
    assert "FabricSetPlanRunner says: queued as plan 2" in first
    assert not first.startswith("==")
    # the way back is as long as the way there: the robot has not been put back to its dock
    way = re.findall(r"([\d.]+) s  line \d  WaypointRunner \(x=\d.0, y=\d.0\) succeeded", out)
    assert [float(seconds) > 10 for seconds in way] == [True, True]
    assert second.endswith(": 1 started, 1 succeeded, 0 failed\n")
    assert ("SUBMITTED", 2, 1) in queue_rows(journal)
    for number in ("1", "2"):
        assert main(["replay", journal, "--run", number]) == 0
        assert "and simulated again" in capsys.readouterr().out


def test_what_is_submitted_runs_behind_what_waits(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=plan(setting("write")), b=plan(wait(3)))
    name = world(tmp_path, "write", plan(wait(2)))
    out, _ = ran("a.xml", "b.xml", "--world", name, capsys=capsys)
    assert re.findall("^== .*", out, re.MULTILINE) == [
        "== plan 1: a.xml",
        "== plan 2: b.xml",
        "== plan 3 from FabricSetPlanRunner",
    ]


def test_a_plan_with_errors_that_a_model_writes_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=plan(setting("write")), b=plan(wait(3)))
    name = world(tmp_path, "write", REJECTED)
    out, err = ran("a.xml", "b.xml", "--world", name, "--journal", "run.db", capsys=capsys, code=1)
    assert "plan 3 from FabricSetPlanRunner:2:3: error GP307" in err
    assert "failed: the plan was refused: GP307 at line 2: " in out
    assert ("REFUSED", 3, 1) in queue_rows("run.db")
    assert out.splitlines()[-1].startswith("COMPLETED")
    assert main(["replay", "run.db", "--run", "1"]) == 0
    assert "and simulated again" in capsys.readouterr().out


def test_plans_that_submit_plans_come_to_an_end(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    again = plan(setting("again"))
    write(tmp_path, a=again)
    arguments = ("--world", world(tmp_path, "again", again), "--journal", "run.db")
    out, _ = ran("a.xml", *arguments, "--max-plans", "3", capsys=capsys, code=1)
    assert "failed: QueueFullError: the queue takes no more than 3 plans" in out
    assert (out.count("COMPLETED"), out.count("GAVE_UP")) == (2, 1)
    assert main(["replay", "run.db"]) == 0  # the last one, which could not submit
    capsys.readouterr()
    out, _ = ran("a.xml", *arguments, capsys=capsys, code=1)
    assert out.count("COMPLETED") == 19
    assert main(["replay", "run.db"]) == 0


def killed(folder: Path, at: bytes, *arguments: str) -> None:
    """Kill a run once a line with these words is there."""
    with start("run", *arguments, "--journal", "run.db", cwd=folder) as process:
        assert process.stdout is not None
        while at not in (line := process.stdout.readline()):
            assert line
        process.send_signal(signal.SIGKILL)
        process.communicate(timeout=30)


def test_after_a_crash_the_queue_goes_on_as_if_nothing_had_happened(tmp_path: Path) -> None:
    write(tmp_path, a=plan(wait(1)), b=plan(setting("write"), wait(90)), c=plan(wait(2)))
    name = world(tmp_path, "write", plan(runner(), wait(5)))
    whole = tmp_path / "whole"
    shutil.copytree(tmp_path, whole)
    arguments = ("a.xml", "b.xml", "c.xml", "--world", name)
    killed(tmp_path, b"WaitRunner (seconds=90) started", *arguments, "--speed", "20")
    assert b"RUNNING" in run("events", "run.db", "--list", cwd=tmp_path).stdout
    done = run("resume", "run.db", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, b"")
    assert re.findall(b"(?m)^== .*", done.stdout) == [
        b"== plan 3: c.xml",
        b"== plan 4 from FabricSetPlanRunner",
    ]
    assert run("run", *arguments, "--journal", "run.db", cwd=whole).returncode == 0
    assert exported(tmp_path, 1, 2, 3, 4) == exported(whole, 1, 2, 3, 4)
    assert queue_rows(tmp_path / "run.db").count(("SUBMITTED", 4, 2)) == 1
    for number in ("2", "4"):
        assert run("replay", "run.db", "--run", number, cwd=tmp_path).returncode == 0
    done = run("resume", "run.db", cwd=tmp_path)
    assert b"run 4 has ended already: COMPLETED" in done.stderr


def test_a_crash_in_the_plan_that_a_model_has_written(tmp_path: Path) -> None:
    whole = tmp_path / "whole"
    whole.mkdir()
    arguments = (str(MISSION), "--world", str(HOME))
    killed(tmp_path, b"line 2  WaypointRunner (x=0.0", *arguments, "--speed", "30")
    assert run("resume", "run.db", cwd=tmp_path).returncode == 0
    assert run("run", *arguments, "--journal", "run.db", cwd=whole).returncode == 0
    assert exported(tmp_path, 1, 2) == exported(whole, 1, 2)


def test_a_crash_while_real_plans_wait(tmp_path: Path) -> None:
    write(tmp_path, a=plan(wait(1)), b=plan(wait(0.1)))
    killed(tmp_path, b"started", "a.xml", "b.xml", "--real")
    done = run("resume", "run.db", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, b"")
    done = run("resume", "run.db", "--real", cwd=tmp_path)
    assert done.returncode == 0
    lines = done.stdout.decode().splitlines()
    assert lines[0].endswith("the run continues in another process")
    assert "== plan 2: b.xml" in lines
    assert lines[-1].endswith(": 1 started, 1 succeeded, 0 failed")


def test_real_plans(tmp_path: Path) -> None:
    write(tmp_path, a=plan(wait(0.1)), b=plan(runner()), c=plan(wait(0.2)))
    done = run("run", "a.xml", "b.xml", "c.xml", "--real", "--journal", "run.db", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stdout.count(b"COMPLETED") == 2
    assert b"the plan cannot be run for real" in done.stderr
    assert queue_rows(tmp_path / "run.db").count(("RUN", 2, 0)) == 0
    with JournalReader(str(tmp_path / "run.db")) as reader:
        nonces = [each.options["nonce"] for each in reader.runs()]
    assert len(set(nonces)) == 2


@pytest.mark.parametrize("how", [["--speed", "1"], ["--real"]])
def test_ctrl_c_cancels_what_waits_too(how: list[str], tmp_path: Path) -> None:
    write(tmp_path, a=plan(wait(50)), b=plan(wait(60)))
    with start("run", "a.xml", "b.xml", "--journal", "run.db", *how, cwd=tmp_path) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"== plan 1: a.xml\n"
        assert process.stdout.readline().endswith(b"WaitRunner (seconds=50) started\n")
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=30)
    assert (process.returncode, out.count(b"CANCELLED")) == (130, 1)
    assert b"Traceback" not in err
    assert ("CANCEL", 2, 0) in queue_rows(tmp_path / "run.db")
    assert b"run 1 has ended already" in run("resume", "run.db", cwd=tmp_path).stderr


@pytest.mark.parametrize("silent", [True, False])
def test_a_bond_that_is_lost_stops_everything(silent: bool, tmp_path: Path) -> None:
    write(tmp_path, a=plan(wait(50)), b=plan(wait(0.1)))
    arguments = ["a.xml", "b.xml", "--journal", "run.db", "--real"]
    bond = ["--bond", "0.7" if silent else "40"]
    with start("run", *arguments, *bond, cwd=tmp_path, stdin=subprocess.PIPE) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdin.write(b"still here\n")
        process.stdin.flush()
        assert process.stdout.readline() == b"== plan 1: a.xml\n"
        if silent:
            lines, said = process.stdout.readlines(), process.stderr.read()
            process.wait(30)
            process.stdin.close()
        else:
            out, said = process.communicate(timeout=30)
            lines = out.splitlines()
    assert process.returncode == 1
    text = b"\n".join(lines)
    reason = b"no beat for 0.7 s" if silent else b"the input has ended"
    assert b"the run is cancelled: the bond is lost: " + reason in text
    assert b"CANCELLED after" in text
    assert b"plan 2" not in text
    assert b"the bond is lost, so 1 plan has not begun\n'gpsfsm resume'" in said
    rows = queue_rows(tmp_path / "run.db")
    assert ("BOND_LOST", 0, 0) in rows
    assert ("BEGUN", 2, 0) not in rows


def test_a_bond_without_a_client_lets_nothing_begin_and_says_so(tmp_path: Path) -> None:
    write(tmp_path, a=plan(wait(50)), b=plan(wait(50)))
    done = shell("$NEW_GPSFSM run a.xml b.xml --real --bond 40 <&-", tmp_path)
    assert done.returncode == 1
    assert b"gpsfsm: the bond is lost, so " in done.stderr
    assert b"succeeded" not in done.stdout


def test_a_run_of_an_earlier_command_is_resumed_alone(tmp_path: Path) -> None:
    write(tmp_path, a=plan(wait(40)), b=plan(wait(1)), c=plan(wait(2)))
    killed(tmp_path, b"started", "a.xml", "b.xml", "--seed", "2", "--speed", "20")
    assert run("run", "c.xml", "--journal", "run.db", cwd=tmp_path).returncode == 0
    rows = queue_rows(tmp_path / "run.db")
    assert b"run 2 has ended already" in run("resume", "run.db", cwd=tmp_path).stderr
    done = run("resume", "run.db", "--run", "1", cwd=tmp_path)
    assert (done.returncode, done.stdout.count(b"COMPLETED")) == (0, 1)
    assert queue_rows(tmp_path / "run.db") == rows
    whole = run("run", "a.xml", "--seed", "2", "--format", "json", cwd=tmp_path).stdout
    assert exported(tmp_path, 1) == [whole]


def test_damaged_decisions_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=plan(wait(1)))
    ran("a.xml", "--journal", "run.db", capsys=capsys)
    with sqlite3.connect("run.db") as connection:
        for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type='trigger'"):
            connection.execute(f"DROP TRIGGER {name}")
        connection.execute("UPDATE queue SET data = '{' WHERE kind = 'RUN'")
    connection.close()
    for command in ("resume", "replay"):
        assert main([command, "run.db"]) == 2
        assert "of the plan queue is" in capsys.readouterr().err
