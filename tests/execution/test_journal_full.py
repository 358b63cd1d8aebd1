"""A disk that is full: a clear error, nothing lost, and what is there can be read."""

from __future__ import annotations

import resource
import sqlite3
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from gpsfsm.execution.journal import Heading, Journal
from gpsfsm.execution.journal_errors import JournalFullError, journal_error
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.records import Input, Kind
from tests.execution.crashing import ROOT
from tests.execution.journaling import (
    LONG,
    LONG_SEED,
    compiled,
    driver,
    exported,
    lines,
    resume_journaled,
    run_journaled,
)

if TYPE_CHECKING:
    from pathlib import Path


def test_a_full_disk_stops_the_run_and_loses_nothing(tmp_path: Path) -> None:
    path = tmp_path / "j.db"
    run_journaled(tmp_path / "whole.db", LONG, seed=LONG_SEED)
    whole = lines(tmp_path / "whole.db")
    kernel = Kernel(compiled(LONG))
    with Journal(str(path), "power") as journal:
        sink = journal.begin(kernel, Heading(plan=LONG.encode(), seed=LONG_SEED, mode="test"))
        pages = journal._connection.execute("PRAGMA page_count").fetchone()[0]
        journal._connection.execute(f"PRAGMA max_page_count = {pages + 3}")
        broken = driver(kernel, sink, LONG_SEED)
        with pytest.raises(JournalFullError, match=r"disk full.*make room, then resume"):
            broken.run()
        assert not broken._acting
        with pytest.raises(JournalFullError):
            sink.write(0, Input(Kind.PAUSE), [])
    rows = lines(path)
    assert 10 < len(rows) < len(whole)
    assert rows == whole[: len(rows)]
    resume_journaled(path)
    assert exported(path) == exported(tmp_path / "whole.db")


def test_a_limit_of_the_system_is_a_full_disk(tmp_path: Path) -> None:
    run_journaled(tmp_path / "whole.db", LONG, seed=LONG_SEED)
    (tmp_path / "plan.xml").write_text(LONG, encoding="utf-8")

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (250_000, 250_000))

    child = [sys.executable, "-m", "tests.execution.crash_child"]
    done = subprocess.run(
        [*child, str(tmp_path / "j.db"), str(tmp_path / "plan.xml"), str(LONG_SEED), "power"],
        cwd=ROOT,
        preexec_fn=limit,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert "JournalFullError" in done.stderr
    acknowledged = int(done.stdout.split()[-1])
    kept, whole = lines(tmp_path / "j.db"), lines(tmp_path / "whole.db")
    assert 10 < acknowledged <= len(kept) < len(whole)
    assert kept == whole[: len(kept)]
    resume_journaled(tmp_path / "j.db")
    assert lines(tmp_path / "j.db") == whole


@pytest.mark.parametrize("limit", [0, 5_000, 30_000, 40_000])
def test_a_disk_that_is_full_from_the_beginning(tmp_path: Path, limit: int) -> None:
    (tmp_path / "plan.xml").write_text(LONG, encoding="utf-8")

    def set_limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    child = [sys.executable, "-m", "tests.execution.crash_child"]
    done = subprocess.run(
        [*child, str(tmp_path / "j.db"), str(tmp_path / "plan.xml"), str(LONG_SEED), "power"],
        cwd=ROOT,
        preexec_fn=set_limit,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert done.stdout == ""
    message = done.stderr.splitlines()[-1]
    assert "JournalFullError" in message
    assert "Nothing of the plan has been run: make room, then run it again" in message
    run_journaled(tmp_path / "j.db", LONG, seed=LONG_SEED)  # there is room again
    run_journaled(tmp_path / "whole.db", LONG, seed=LONG_SEED)
    assert exported(tmp_path / "j.db") == exported(tmp_path / "whole.db")


@pytest.mark.parametrize("name", ["SQLITE_IOERR_SHMSIZE", "SQLITE_FULL"])
def test_a_full_disk_may_be_in_the_way_of_reading(name: str) -> None:
    error = sqlite3.OperationalError("what")
    error.sqlite_errorname = name
    assert "is the disk full?" in str(journal_error(error, "j.db", "read"))
    assert "resume" not in str(journal_error(error, "j.db", "read"))


@pytest.mark.parametrize("limit", [0, 5_000])
def test_a_journal_can_be_read_where_nothing_can_be_written(tmp_path: Path, limit: int) -> None:
    run_journaled(tmp_path / "j.db", LONG, seed=LONG_SEED)

    def set_limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    code = (
        "import sys; from tests.execution.journaling import exported; "
        "sys.stdout.write(exported(sys.argv[1]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, tmp_path / "j.db"],
        cwd=ROOT,
        preexec_fn=set_limit,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stderr == ""
    assert done.stdout == exported(tmp_path / "j.db")
