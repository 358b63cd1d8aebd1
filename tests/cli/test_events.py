"""``gpsfsm events``, ``gpsfsm replay`` and ``gpsfsm resume``."""

from __future__ import annotations

import json
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from lxml import etree

from gpsfsm.cli import main
from gpsfsm.execution.journal import Heading
from tests.cli.support import environment, run, runner, start, write
from tests.execution.journaling import run_journaled

if TYPE_CHECKING:
    from pathlib import Path

PLAN = f"""<Plan>
{runner()}
<Control type="recovery">
{runner(x="5")}
</Control>
{runner(x="7")}
</Plan>
"""
WAIT = "generic_capabilities/WaitRunner"
WAITS = f"""<Plan>
<Runner interface="{WAIT}" provider="{WAIT}" seconds="1"/>
<Runner interface="{WAIT}" provider="{WAIT}" seconds="4"/>
</Plan>
"""


def shown(*arguments: str, capsys: pytest.CaptureFixture[str], code: int = 0) -> str:
    exit_code = main(list(arguments))
    out, err = capsys.readouterr()
    assert exit_code == code, (exit_code, out, err)
    return err if code else out


@pytest.fixture
def journal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """Two runs of a plan, with different seeds."""
    write(tmp_path, a=PLAN)
    for seed in ("1", "3"):
        main(["run", "a.xml", "--seed", seed, "--journal", "run.db", "--durability", "none"])
    capsys.readouterr()
    return "run.db"


def test_a_table(journal: str, capsys: pytest.CaptureFixture[str]) -> None:
    lines = shown("events", journal, capsys=capsys).splitlines()
    assert lines[0].split() == ["event", "time", "kind", "what", "has", "happened"]
    assert lines[1] == "     1       0.000 s  BEGIN       the run begins"
    assert re.fullmatch(r" +\d+ +[\d.]+ s  ENDED       the run has ended: COMPLETED", lines[-1])
    walled = shown("events", journal, "--wall-clock", capsys=capsys).splitlines()
    assert len(walled) == len(lines)
    assert re.match(r"     1  20\d\d-\d\d-\d\d \d\d:\d\d:\d\d\.\d{6} ", walled[1])


def test_the_run_of_a_number(journal: str, capsys: pytest.CaptureFixture[str]) -> None:
    listed = shown("events", journal, "--list", capsys=capsys).splitlines()
    assert [line.split()[0] for line in listed] == ["1", "2"]
    assert "seed 1  drawn  a.xml" in listed[0]
    first = shown("events", journal, "--run", "1", capsys=capsys)
    assert first != shown("events", journal, capsys=capsys)
    text = shown("events", journal, "--run", "3", capsys=capsys, code=2)
    assert text == "gpsfsm: there is no run 3 in run.db; it holds runs 1 to 2\n"


def test_lines_of_json_are_what_run_writes(
    journal: str, capsys: pytest.CaptureFixture[str]
) -> None:
    exported = shown("events", journal, "--format", "jsonl", "--verify", capsys=capsys)
    assert exported == shown("run", "a.xml", "--seed", "3", "--format", "json", capsys=capsys)
    events = [json.loads(line) for line in exported.splitlines()]
    assert not any("wall_us" in event for event in events)
    walled = shown("events", journal, "--format", "jsonl", "--wall-clock", capsys=capsys)
    assert all("wall_us" in json.loads(line) for line in walled.splitlines())


def test_a_picture(journal: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ("events", journal, "--format", "svg", "--output-file", "a.svg")
    assert shown(*arguments, capsys=capsys) == ""
    root = etree.fromstring((tmp_path / "a.svg").read_bytes())
    assert root.tag == "{http://www.w3.org/2000/svg}svg"
    assert "a.xml: COMPLETED after" in "".join(root.itertext())
    assert "would overwrite" in shown(
        "events", journal, "--output-file", journal, capsys=capsys, code=2
    )


@pytest.mark.parametrize("command", ["events", "replay", "resume"])
def test_what_is_no_journal(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.db").write_bytes(b"hello" * 1000)
    assert "a.db" in shown(command, "a.db", capsys=capsys, code=2)
    assert "nowhere.db" in shown(command, "nowhere.db", capsys=capsys, code=2)
    assert not (tmp_path / "nowhere.db").exists()
    assert f"gpsfsm {command} run.db" in shown(command, capsys=capsys, code=2)


def test_a_replay(journal: str, capsys: pytest.CaptureFixture[str]) -> None:
    text = shown("replay", journal, "--run", "1", capsys=capsys)
    assert re.fullmatch(
        r"run 1 \(\w+\): replayed and simulated again; all \d+ events are the same\n", text
    )


def test_a_journal_that_was_changed(journal: str, capsys: pytest.CaptureFixture[str]) -> None:
    with sqlite3.connect(journal) as connection:
        for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type='trigger'"):
            connection.execute(f"DROP TRIGGER {name}")
        connection.execute("UPDATE event SET at_us = at_us + 1 WHERE kind = 'SUCCEEDED'")
    connection.close()
    assert "not as it was written" in shown("replay", journal, capsys=capsys, code=2)


def test_a_replay_that_differs(
    journal: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As with another version of gpsfsm, whose runners draw otherwise."""
    monkeypatch.setattr("gpsfsm.simulation.makers._USUAL_S", (2.0, 11.0))
    monkeypatch.setattr("gpsfsm.simulation.makers._bounds", lambda *_: (2.0, 11.0))
    text = shown("replay", journal, capsys=capsys, code=1)
    assert "the replay differs from the journal at event" in text


def test_a_run_that_has_ended_is_not_touched(
    journal: str, capsys: pytest.CaptureFixture[str]
) -> None:
    before = shown("events", journal, "--format", "jsonl", capsys=capsys)
    assert main(["resume", journal]) == 0
    assert "run 2 has ended already: COMPLETED" in capsys.readouterr().err
    assert shown("events", journal, "--format", "jsonl", capsys=capsys) == before


def killed(folder: Path, *arguments: str) -> None:
    """Kill a run once its first line is there."""
    with start("run", *arguments, cwd=folder) as process:
        assert process.stdout is not None
        assert process.stdout.readline()
        process.send_signal(signal.SIGKILL)
        process.communicate(timeout=30)


def test_a_simulated_run_that_was_killed(tmp_path: Path) -> None:
    write(tmp_path, a=PLAN)
    killed(tmp_path, "a.xml", "--speed", "0.1", "--seed", "3", "--journal", "run.db")
    assert b"RUNNING" in run("events", "run.db", "--list", cwd=tmp_path).stdout
    done = run("replay", "run.db", cwd=tmp_path)
    assert done.stdout.startswith(b"run 1 (not ended): replayed without")
    shutil.copytree(tmp_path, tmp_path / "copy")
    done = run("resume", "run.db", cwd=tmp_path)
    assert done.returncode == 0
    assert b"started" in done.stdout
    assert not done.stdout.startswith(b"     0.000 s  line 2")  # that is no news
    exported = run("events", "run.db", "--format", "jsonl", cwd=tmp_path).stdout
    whole = run("run", "a.xml", "--seed", "3", "--format", "json", cwd=tmp_path).stdout
    assert exported == whole
    news = run("resume", "run.db", "--format", "json", cwd=tmp_path / "copy").stdout
    assert news
    assert exported.endswith(news)
    assert len(news) < len(exported)


def test_a_real_run_that_was_killed(tmp_path: Path) -> None:
    write(tmp_path, a=WAITS.replace('"4"', '"0.1"'))
    killed(tmp_path, "a.xml", "--real", "--allow-host", "robot", "--journal", "run.db")
    done = run("resume", "run.db", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, b"")
    assert b"lets real runners act; if that is what you want, add --real --allow-host robot" in (
        done.stderr
    )
    done = run("resume", "run.db", "--real", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, b"")
    assert b"the journal recorded: --allow-host robot; " in done.stderr
    done = run("resume", "run.db", "--real", "--allow-host", "robot", cwd=tmp_path)
    assert done.returncode == 0
    lines = done.stdout.decode().splitlines()
    assert lines[0].endswith("the run continues in another process")
    assert "WaitRunner (seconds=1) is asked again" in lines[1]
    assert lines[-1].endswith(": 2 started, 2 succeeded, 0 failed")
    assert run("replay", "run.db", cwd=tmp_path).returncode == 0


@pytest.fixture
def crashed(tmp_path: Path) -> str:
    """A journal of a killed run whose log has lost its last event since."""
    write(tmp_path, a=PLAN)
    run("run", "a.xml", "--seed", "3", "--journal", "run.db", cwd=tmp_path)
    killed(tmp_path, "a.xml", "--speed", "0.1", "--seed", "3", "--journal", "run.db")
    log = tmp_path / "run.db-wal"
    log.write_bytes(log.read_bytes()[:-1])
    return "run.db"


def test_a_journal_without_its_end(
    crashed: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = (tmp_path / "run.db").read_bytes(), (tmp_path / "run.db-wal").read_bytes()
    missing = r"gpsfsm: run\.db: the journal is damaged: \d+ events? that had been written are"
    for arguments in (
        ("events", crashed),
        ("events", crashed, "--format", "jsonl"),
        ("events", crashed, "--format", "svg"),
        ("events", crashed, "--list"),
        ("events", crashed, "--queue"),
    ):
        assert main(list(arguments)) == 2
        out, err = capsys.readouterr()
        assert out
        assert re.match(missing, err)
    for command in ("replay", "resume", "run"):
        assert main([command, *(["a.xml", "--journal"] if command == "run" else []), crashed]) == 2
        out, err = capsys.readouterr()
        assert out == ""
        assert re.match(missing, err)
        assert "begin another journal" in err
    assert before == ((tmp_path / "run.db").read_bytes(), (tmp_path / "run.db-wal").read_bytes())


def test_what_is_before_the_damage_is_shown(
    journal: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with sqlite3.connect(journal) as connection:
        for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type='trigger'"):
            connection.execute(f"DROP TRIGGER {name}")
        connection.execute("UPDATE event SET kind = 'WHAT' WHERE seq = 5")
    connection.close()
    for output_format, words in (("table", "LOADING"), ("svg", "</svg>")):
        arguments = ["events", journal, "--format", output_format, "--run", "1"]
        assert main(arguments) == 2
        out, err = capsys.readouterr()
        assert words in out
        assert err == "gpsfsm: run.db: event 5 of run 1 is not as it was written\n"
        assert main([*arguments, "--verify"]) == 2
        out, err = capsys.readouterr()
        assert out == ""
        assert "not as it was written" in err


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (("kernel", "1"), "whose rules differ from those of this gpsfsm"),
        (("kernel", "true"), r"(kernel True)"),
        (("kernel", '"\\u001b[31m"'), r"(kernel \x1b[31m)"),
        (("version", '"0.0.7"'), "was run by gpsfsm 0.0.7, this is gpsfsm"),
    ],
)
def test_another_version(
    changed: tuple[str, str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    name, value = changed
    plain = Heading.text

    def text(heading: Heading) -> str:
        return re.sub(rf'"{name}":[^,}}]*', lambda _: f'"{name}":{value}', plain(heading))

    write(tmp_path, a=PLAN)
    with monkeypatch.context() as patched:
        patched.setattr(Heading, "text", text)
        main(["run", "a.xml", "--seed", "3", "--journal", "run.db", "--durability", "none"])
    capsys.readouterr()
    assert main(["replay", "run.db"]) == (0 if name == "version" else 2)
    assert message in capsys.readouterr().err


def test_a_run_of_another_kernel_is_not_resumed(tmp_path: Path) -> None:
    write(tmp_path, a=PLAN)
    killed(tmp_path, "a.xml", "--speed", "0.1", "--seed", "3", "--journal", "run.db")
    code = (
        "import sys, gpsfsm.execution.kernel as kernel; kernel.VERSION = 99; "
        "from gpsfsm.cli import main; sys.exit(main(['resume', 'run.db']))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env=environment(),
        capture_output=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (2, b"")
    assert b"(kernel 99): it would not come out the same. Use gpsfsm" in done.stderr
    assert run("resume", "run.db", cwd=tmp_path).returncode == 0


def test_what_became_of_the_plans(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=WAITS, b=WAITS)
    assert main(["run", "a.xml", "b.xml", "--journal", "run.db", "--durability", "none"]) == 0
    assert main(["run", "b.xml", "--journal", "run.db", "--durability", "none"]) == 0
    capsys.readouterr()
    assert shown("events", "run.db", "--queue", "--run", "2", capsys=capsys) == (
        "queue 1 of 2: 2 plans: 2 COMPLETED\n"
        "decision          time   plan  kind          what has happened\n"
        "       1       0.000 s      1  SUBMITTED     a.xml is queued\n"
        "       2       0.000 s      2  SUBMITTED     b.xml is queued\n"
        "       3       0.000 s      1  BEGUN         it is its turn\n"
        "       4       0.000 s      1  RUN           it is run 1 of this journal\n"
        "       5       5.000 s      1  ENDED         it has ended: COMPLETED\n"
        "       6       5.000 s      2  BEGUN         it is its turn\n"
        "       7       5.000 s      2  RUN           it is run 2 of this journal\n"
        "       8      10.000 s      2  ENDED         it has ended: COMPLETED\n"
    )
    last = shown("events", "run.db", "--queue", "--verify", capsys=capsys)
    assert last.startswith("queue 2 of 2: 1 plan: 1 COMPLETED\n")
    first = shown("events", "run.db", "--run", "2", capsys=capsys).splitlines()
    assert first[0] == "plan 2 of 2 in queue 1"
    assert shown("events", "run.db", capsys=capsys).startswith(" event")
    walled = shown("events", "run.db", "--queue", "--wall-clock", capsys=capsys).splitlines()
    assert re.match(r"       1  20\d\d-\d\d-\d\d \d\d:\d\d:\d\d\.\d{6} ", walled[2])


def test_the_queue_as_data(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=WAITS)
    for journal in ("run.db", "again.db"):
        main(["run", "a.xml", "--journal", journal, "--durability", "none"])
    capsys.readouterr()
    text = shown("events", "run.db", "--queue", "--format", "jsonl", capsys=capsys)
    assert text == shown("events", "again.db", "--queue", "--format", "jsonl", capsys=capsys)
    rows = [json.loads(line) for line in text.splitlines()]
    assert [row["kind"] for row in rows] == ["SUBMITTED", "BEGUN", "RUN", "ENDED"]
    assert rows[0]["data"]["text"] == WAITS
    assert [row["seq"] for row in rows] == [1, 2, 3, 4]
    walled = shown(
        "events", "run.db", "--queue", "--format", "jsonl", "--wall-clock", capsys=capsys
    )
    assert all("wall_us" in json.loads(line) for line in walled.splitlines())
    for other in (["--list"], ["--format", "svg"]):
        output = shown("events", "run.db", "--queue", *other, capsys=capsys, code=2)
        assert f"--queue and {' '.join(other)} cannot be used together" in output


def test_a_journal_without_a_queue(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run_journaled(tmp_path / "run.db")
    for arguments in ([], ["--run", "1"]):
        text = shown("events", "run.db", "--queue", *arguments, capsys=capsys, code=2)
        assert text.startswith("gpsfsm: run.db: there is no plan queue")


def test_a_journal_that_no_command_has_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As a program in Python may, without a table of capabilities."""
    run_journaled("run.db")
    for command in ("events", "replay"):
        text = shown(command, "run.db", capsys=capsys, code=2)
        assert text.startswith("gpsfsm: run.db: run 1 has no table of capabilities")
        assert "defect" not in text
    assert '"kind":"ENDED"' in shown("events", "run.db", "--format", "jsonl", capsys=capsys)
