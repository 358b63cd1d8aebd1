"""``gpsfsm events --format mcap``: a file of bytes, and what it says where it can make none."""

from __future__ import annotations

import io
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest
from mcap.reader import make_reader

from gpsfsm.cli import main
from gpsfsm.streams import Stream
from tests.cli.support import environment, runner, write
from tests.conftest import REPO

PLAN = f"<Plan>\n{runner()}\n{runner(x='5')}\n</Plan>\n"
COMMAND = ("events", "run.db", "--format", "mcap")


@pytest.fixture(autouse=True)
def journal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=PLAN)
    world = str(REPO / "corpus/worlds/arena.yaml")
    main(["run", "a.xml", "--world", world, "--journal", "run.db", "--durability", "none"])
    capsys.readouterr()


def counts(content: bytes) -> dict[str, int]:
    summary = make_reader(io.BytesIO(content), validate_crcs=True).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    numbers = summary.statistics.channel_message_counts
    return {each.topic: numbers.get(each.id, 0) for each in summary.channels.values()}


def test_a_file_and_a_pipe_get_the_same_bytes(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*COMMAND, "--output-file", "run.mcap"]) == 0
    assert capsys.readouterr() == ("", "")
    process = subprocess.run(
        [sys.executable, "-m", "gpsfsm", *COMMAND],
        env=environment(),
        capture_output=True,
        check=True,
    )
    assert process.stdout == Path("run.mcap").read_bytes()
    assert process.stderr == b""
    assert main(["events", "run.db", "--format", "jsonl"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert counts(process.stdout)["/gpsfsm/events"] == len(lines) - 1
    assert counts(process.stdout)["/gpsfsm/pose"] > 20


@pytest.mark.parametrize("other", ["--list", "--queue"])
def test_a_recording_is_of_a_run(other: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*COMMAND, other, "--output-file", "run.mcap"]) == 2
    assert capsys.readouterr().err == f"gpsfsm: {other} and --format mcap cannot be used together\n"
    assert not Path("run.mcap").exists()


def test_no_bytes_go_to_a_terminal(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gpsfsm.cli.events.is_terminal", lambda stream: stream is Stream.OUT)
    assert main([*COMMAND]) == 2
    out, err = capsys.readouterr()
    assert (out, err) == (
        "",
        "gpsfsm: --format mcap is binary; name a file with --output\n",
    )
    assert main([*COMMAND, "--output-file", "run.mcap"]) == 0


def test_without_the_library_it_says_what_to_install(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    assert main([*COMMAND, "--output-file", "run.mcap"]) == 2
    text = "gpsfsm: --format mcap needs mcap: pip install 'gpsfsm[mcap]', or '.[mcap]' in a clone\n"
    assert capsys.readouterr().err == text
    assert main(["events", "run.db"]) == 0  # which needs none of it


def change(statement: str) -> None:
    with sqlite3.connect("run.db") as connection:
        for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type='trigger'"):
            connection.execute(f"DROP TRIGGER {name}")
        connection.execute(statement)
    connection.close()


def test_what_is_before_the_damage_is_recorded(capsys: pytest.CaptureFixture[str]) -> None:
    change("UPDATE event SET kind = 'WHAT' WHERE seq = 5")
    assert main([*COMMAND, "--output-file", "run.mcap"]) == 2
    first, second = capsys.readouterr().err.splitlines()
    damage = "run.db: event 5 of run 1 is not as it was written"
    assert first == f"gpsfsm: the recording has no poses of run 1: {damage}"
    assert second == f"gpsfsm: {damage}"
    assert counts(Path("run.mcap").read_bytes())["/gpsfsm/events"] == 4


def test_a_run_that_does_not_come_out_again_has_no_poses(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gpsfsm.running.history.KERNEL_VERSION", 0)
    assert main([*COMMAND, "--output-file", "run.mcap"]) == 0
    err = capsys.readouterr().err
    assert err.startswith("gpsfsm: the recording has no poses of run 1: run.db: run 1 was run by")
    number = counts(Path("run.mcap").read_bytes())
    assert (number["/gpsfsm/pose"], number["/gpsfsm/run"]) == (0, 3)
