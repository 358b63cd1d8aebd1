"""Journals that were left behind or damaged, and options without a value: the words for them."""

from __future__ import annotations

import os
import signal
import sqlite3
from contextlib import closing
from typing import TYPE_CHECKING

import pytest

from gpsfsm.cli import main
from tests.cli.support import ACCEPTED, REJECTED, run, runner, start, write
from tests.execution.journaling import opened_up

if TYPE_CHECKING:
    from pathlib import Path

PLAN = f"<Plan>\n{runner()}\n{runner(x='5')}\n</Plan>\n"
WAIT = "generic_capabilities/WaitRunner"
WAITS = f'<Plan>\n<Runner interface="{WAIT}" provider="{WAIT}" seconds="50"/>\n</Plan>\n'


def complaint(*arguments: str, capsys: pytest.CaptureFixture[str], code: int = 2) -> str:
    exit_code = main(list(arguments))
    out, err = capsys.readouterr()
    assert exit_code == code, (exit_code, out, err)
    return err


def killed(folder: Path, kind: str = "ENDED", when: str = "before") -> None:
    """Leaves a journal of a run that was killed at a row of its queue."""
    arguments = ["run", "a.xml", "--failure", "0", "--journal", "run.db"]
    done = run(kind, "1", when, *arguments, cwd=folder, module="tests.cli.killed_run")
    assert done.returncode == -signal.SIGKILL


@pytest.mark.parametrize("option", ["--journal", "--world", "--scenario"])
def test_a_file_without_a_name_is_refused(
    option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=PLAN)
    error = complaint("run", "a.xml", option, "", capsys=capsys)
    assert f"{option} needs the name of a file, not an empty one" in error
    assert [each.name for each in tmp_path.iterdir()] == ["a.xml"]


@pytest.mark.parametrize(
    ("command", "name"), [(signal.SIGTERM, "SIGTERM"), (signal.SIGHUP, "SIGHUP")]
)
def test_who_ends_a_run_is_told_how_to_abort_it(
    command: signal.Signals, name: str, tmp_path: Path
) -> None:
    write(tmp_path, a=WAITS)
    with start("run", "a.xml", "--speed", "1", cwd=tmp_path) as process:
        assert process.stdout is not None
        assert process.stdout.readline().endswith(b"started\n")
        process.send_signal(command)
        _, err = process.communicate(timeout=30)
    assert err.decode() == (
        f"gpsfsm: the run is being cancelled because of {name}; a second signal aborts it\n"
    )


# -- nothing has been run ---------------------------------------------------------------------


def _no_run(folder: Path) -> None:
    killed(folder, "SUBMITTED", "after")


def _no_rows(folder: Path) -> None:
    killed(folder, "SUBMITTED", "before")


def _no_tables(folder: Path) -> None:
    (folder / "run.db").touch()


@pytest.mark.parametrize("leave", [_no_run, _no_rows, _no_tables])
def test_a_journal_of_which_nothing_has_been_run(
    leave: object, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=PLAN)
    assert callable(leave)
    leave(tmp_path)
    error = complaint("resume", "run.db", capsys=capsys)
    assert error == (
        "gpsfsm: run.db: it contains no run. If it is a copy, copy run.db-wal and run.db-seen "
        "as well; otherwise nothing of the plan has been run: run it again\n"
    )
    assert main(["run", "a.xml", "--failure", "0", "--journal", "run.db"]) == 0


# -- damage -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "arguments",
    [
        ("events", "run.db"),
        ("events", "run.db", "--run", "1"),
        ("events", "run.db", "--format", "svg"),
        ("events", "run.db", "--verify"),
        ("events", "run.db", "--list"),
        ("events", "run.db", "--queue"),
        ("replay", "run.db"),
        ("resume", "run.db"),
        ("run", "a.xml", "--journal", "run.db"),
    ],
    ids=" ".join,
)
@pytest.mark.parametrize("share", [0.3, 0.7])
def test_a_heading_that_is_lost_with_the_log_is_damage(
    arguments: tuple[str, ...], share: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=PLAN)
    killed(tmp_path)
    log = tmp_path / "run.db-wal"
    os.truncate(log, int(log.stat().st_size * share))
    error = complaint(*arguments, capsys=capsys)
    assert "the journal is damaged" in error
    assert "missing at its end; run.db-wal is cut off" in error


@pytest.mark.parametrize(
    "witness", [b"", b"gpsfseen", b"gpsfseen" + b"\x07" * 68], ids=["empty", "cut off", "flipped"]
)
@pytest.mark.parametrize("command", ["events", "replay", "resume", "run"])
def test_a_witness_that_cannot_be_read_is_told_of(
    command: str, witness: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=PLAN)
    killed(tmp_path)
    (tmp_path / "run.db-seen").write_bytes(witness)
    more = ("a.xml", "--failure", "0", "--journal") if command == "run" else ()
    error = complaint(command, *more, "run.db", capsys=capsys, code=0)
    assert error.startswith("gpsfsm: run.db-seen is empty or damaged, so whether the end of run.db")
    if command in ("resume", "run"):  # then it is as it must be again, and goes with the end
        assert not (tmp_path / "run.db-seen").exists()
        assert complaint("events", "run.db", capsys=capsys, code=0) == ""


@pytest.mark.parametrize("command", ["events", "replay", "resume"])
def test_a_plan_that_is_no_text_is_damaged(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=PLAN)
    killed(tmp_path)
    with closing(opened_up(tmp_path / "run.db")) as connection:
        connection.execute("ALTER TABLE content RENAME TO old")  # the forged one is not strict
        connection.execute("CREATE TABLE content AS SELECT * FROM old")
        change = "UPDATE content SET bytes = CAST(x'3cff1b5b' AS TEXT) WHERE length(bytes) < 999"
        connection.execute(change)
    error = complaint(command, "run.db", capsys=capsys)
    if command == "events":  # it goes on behind the first damage
        assert "run.db: the plan of run 1 is damaged" in error
    assert "run.db: the journal is damaged: its table content differs" in error
    assert "Could not decode" not in error
    assert "\x1b" not in error


def test_text_that_is_no_text_anywhere_else_is_damage(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=PLAN)
    main(["run", "a.xml", "--failure", "0", "--journal", "run.db"])
    with closing(opened_up(tmp_path / "run.db")) as connection:
        assert isinstance(connection, sqlite3.Connection)
        connection.execute("UPDATE event SET message = CAST(x'ff1b' AS TEXT) WHERE seq = 5")
    capsys.readouterr()
    assert "the journal is damaged (a text in it cannot be decoded)" in complaint(
        "events", "run.db", capsys=capsys
    )


@pytest.mark.parametrize(
    ("text", "end"),
    [
        ("no plan at all", "it is not run\n"),
        ('<Plan><Control type="odd"/></Plan>', "it is not run\n"),
        (REJECTED, "it is not run; --force runs it anyway\n"),
        (ACCEPTED.replace('x="1"', "x=1"), "it is not run; --force runs it anyway\n"),
    ],
)
def test_force_is_offered_only_where_it_helps(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    text: str,
    end: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    write(tmp_path, a=text)
    assert main(["run", "a.xml"]) == 1
    refused = capsys.readouterr().err
    assert refused.endswith(end)
    forced = main(["run", "a.xml", "--force", "--failure", "0"])
    assert forced == (0 if "--force" in refused else 2)
