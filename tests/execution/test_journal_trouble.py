"""Files that are no journal, are damaged, or cannot be written: a clear error, nothing lost."""

from __future__ import annotations

import os
import shutil
import sqlite3
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from gpsfsm.execution.journal import Heading, Journal
from gpsfsm.execution.journal_errors import (
    DamagedJournalError,
    JournalBusyError,
    JournalError,
    JournalFullError,
    journal_error,
)
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.journal_rows import line
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.records import Input, Kind
from tests.execution.journaling import (
    LONG,
    LONG_SEED,
    SMALL,
    compiled,
    driver,
    ends_of_writes,
    exported,
    lines,
    opened_up,
    resume_journaled,
    run_journaled,
)

if TYPE_CHECKING:
    from collections.abc import Callable


def test_a_cut_off_log_still_has_its_beginning(tmp_path: Path) -> None:
    run_journaled(tmp_path / "whole.db", LONG, seed=LONG_SEED)
    log = copied_while_open(tmp_path)
    size = log.stat().st_size
    shown = []
    for cut_off in (1, 100, 5000, size // 2):
        log.write_bytes(log.read_bytes()[: size - cut_off])
        rows = lines(tmp_path / "copy.db")
        shown.append(len(rows))
        assert rows == lines(tmp_path / "whole.db")[: len(rows)]
        assert len(rows) in ends_of_writes(tmp_path / "whole.db")
    assert shown == sorted(shown, reverse=True)
    assert 0 < shown[-1] < shown[0]
    resume_journaled(tmp_path / "copy.db")
    assert exported(tmp_path / "copy.db") == exported(tmp_path / "whole.db")


def test_rubbish_behind_the_log_changes_nothing(tmp_path: Path) -> None:
    run_journaled(tmp_path / "whole.db", LONG, seed=LONG_SEED)
    log = copied_while_open(tmp_path)
    with log.open("ab") as target:
        target.write(b"\xde\xad" * 5000)
    assert lines(tmp_path / "copy.db") == lines(tmp_path / "whole.db")


def copied_while_open(folder: Path) -> Path:
    """Copies a journal with its log while it is open, as a crash would leave it; the log."""
    kernel = Kernel(compiled(LONG))
    path = folder / "open.db"
    with Journal(str(path), "power") as journal:
        sink = journal.begin(kernel, Heading(plan=LONG.encode(), seed=LONG_SEED, mode="test"))
        driver(kernel, sink, LONG_SEED).run()
        shutil.copy(path, folder / "copy.db")
        shutil.copy(f"{path}-wal", folder / "copy.db-wal")
    return folder / "copy.db-wal"


@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
def test_damage_in_the_middle_is_told_and_the_beginning_can_be_read(
    tmp_path: Path, share: float
) -> None:
    path = tmp_path / "j.db"
    run_journaled(path, LONG, seed=LONG_SEED)
    whole = lines(path)
    content = bytearray(path.read_bytes())
    place = int(len(content) * share) // 4096 * 4096
    content[place : place + 4096] = b"\xa5" * 4096
    path.write_bytes(content)
    actual: list[str] = []

    def read() -> None:
        with JournalReader(str(path)) as reader:
            for row in reader.events(1):
                actual.append(line(row))
            reader.verify(1)
            reader.check_file()  # there are pages that no event needs

    with pytest.raises(DamagedJournalError, match="damaged"):
        read()
    assert actual == whole[: len(actual)]


def test_a_damaged_beginning_is_no_journal(tmp_path: Path) -> None:
    path = tmp_path / "j.db"
    run_journaled(path)
    content = bytearray(path.read_bytes())
    content[:100] = bytes(100)
    path.write_bytes(content)
    for use in (JournalReader, Journal):
        with pytest.raises(JournalError, match="not a journal"):
            use(str(path))


def _text(path: Path) -> None:
    path.write_text("this is a letter, and it is longer than the head of a database. " * 10)


def _database(path: Path) -> None:
    connection = sqlite3.connect(path)
    connection.execute("CREATE TABLE event (run, seq)")
    connection.commit()
    connection.close()


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (_text, "not a journal of gpsfsm"),
        (_database, "not a journal of gpsfsm"),
        (Path.mkdir, "a folder"),
        (os.mkfifo, "not a regular file"),
    ],
)
def test_other_files_are_not_touched(
    tmp_path: Path, make: Callable[[Path], None], words: str
) -> None:
    path = tmp_path / "other.db"
    make(path)
    before = path.read_bytes() if path.is_file() else b""
    beside = {"other.db-lock"} if make is _database else set()
    for use in (JournalReader, Journal):
        with pytest.raises(JournalError, match=words):
            use(str(path))
    assert (path.read_bytes() if path.is_file() else b"") == before
    assert {each.name for each in tmp_path.iterdir()} == {"other.db", *beside}


def test_files_that_are_not_there(tmp_path: Path) -> None:
    with pytest.raises(JournalError, match="there is no such file"):
        JournalReader(str(tmp_path / "none.db"))
    with pytest.raises(JournalError, match="check that its folder exists"):
        Journal(str(tmp_path / "none" / "j.db"))
    assert not list(tmp_path.iterdir())


def test_an_empty_file_becomes_a_journal(tmp_path: Path) -> None:
    (tmp_path / "j.db").touch()
    with pytest.raises(JournalError, match="nothing has been written"):
        JournalReader(str(tmp_path / "j.db"))
    run_journaled(tmp_path / "j.db")
    assert exported(tmp_path / "j.db")


def test_a_journal_without_runs(tmp_path: Path) -> None:
    Journal(str(tmp_path / "j.db")).close()
    with (
        JournalReader(str(tmp_path / "j.db")) as reader,
        pytest.raises(JournalError, match="there is no run in this journal"),
    ):
        reader.run()


def test_a_run_that_is_not_there_is_told_of_one_that_is(tmp_path: Path) -> None:
    run_journaled(tmp_path / "j.db")
    with (
        JournalReader(str(tmp_path / "j.db")) as reader,
        pytest.raises(JournalError, match=r"no run 999 in .*; it holds run 1 alone$"),
    ):
        reader.run(999)


def test_a_newer_form_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "j.db"
    run_journaled(path)
    connection = opened_up(path)
    connection.execute("PRAGMA user_version = 99")
    connection.close()
    for use in (JournalReader, Journal):
        with pytest.raises(JournalError, match="newer gpsfsm"):
            use(str(path))


@pytest.mark.parametrize(
    ("table", "column", "value"),
    [
        ("event", "node", "'x'"),
        ("event", "hash", "1000000000000"),
        ("event", "data", "x'00'"),
        ("run", "header", "x'07'"),
        ("content", "bytes", "1000000000000"),
    ],
)
def test_a_forged_journal_is_damaged(tmp_path: Path, table: str, column: str, value: str) -> None:
    path = tmp_path / "j.db"
    run_journaled(path)
    connection = opened_up(path)
    connection.execute(f"ALTER TABLE {table} RENAME TO old")  # the forged one is not strict
    connection.execute(f"CREATE TABLE {table} AS SELECT * FROM old")  # noqa: S608
    connection.execute(f"UPDATE {table} SET {column} = {value}")  # noqa: S608
    connection.close()

    def read() -> None:
        with JournalReader(str(path)) as reader:
            reader.verify(1)

    with pytest.raises(DamagedJournalError, match="wrong type"):
        read()


def test_a_journal_without_its_tables_cannot_be_read(tmp_path: Path) -> None:
    path = tmp_path / "j.db"
    run_journaled(path)
    connection = opened_up(path)
    connection.execute("DROP TABLE event")
    connection.close()
    with (
        JournalReader(str(path)) as reader,
        pytest.raises(JournalError, match=r"cannot be read \(no such table"),
    ):
        reader.runs()


def test_one_process_at_a_time_writes(tmp_path: Path) -> None:
    path = str(tmp_path / "j.db")
    run_journaled(path)
    code = "import sys; from gpsfsm.execution.journal import Journal; Journal(sys.argv[1])"
    with Journal(path):
        with pytest.raises(JournalBusyError, match="another process writes"):
            Journal(path)
        other = subprocess.run(
            [sys.executable, "-c", code, path], capture_output=True, text=True, check=False
        )
        assert "JournalBusyError" in other.stderr
        with JournalReader(path) as reader:
            assert reader.run().events
    Journal(path).close()


def test_a_writer_that_was_killed_holds_nothing_up(tmp_path: Path) -> None:
    path = str(tmp_path / "j.db")
    code = (
        "import sys, os; from gpsfsm.execution.journal import Journal; "
        "j = Journal(sys.argv[1]); os.kill(os.getpid(), 9)"
    )
    assert subprocess.run([sys.executable, "-c", code, path], check=False).returncode == -9
    Journal(path).close()


def test_a_reader_sees_what_is_written_while_it_looks(tmp_path: Path) -> None:
    path = str(tmp_path / "j.db")
    kernel = Kernel(compiled())
    with Journal(path) as journal:
        sink = journal.begin(kernel, Heading(plan=SMALL.encode()))
        with JournalReader(path) as reader:
            assert reader.run().events == 0
            sink.write(0, Input(Kind.BEGIN), kernel.step(Input(Kind.BEGIN))[0])
            assert reader.run().events == sink.seq > 0


def test_reading_leaves_things_as_they_are(tmp_path: Path) -> None:
    run_journaled(tmp_path / "j.db")
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    exported(tmp_path / "j.db")
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    (tmp_path / "crashed").mkdir()
    log = copied_while_open(tmp_path / "crashed")
    before = {path.name: path.read_bytes() for path in (log, tmp_path / "crashed" / "copy.db")}
    assert exported(tmp_path / "crashed" / "copy.db")
    assert before == {
        path.name: path.read_bytes() for path in (log, tmp_path / "crashed" / "copy.db")
    }


def test_who_may_not_write_is_told_so() -> None:
    # Root may write everything, so this happens in a process of somebody else.
    folder = Path(tempfile.mkdtemp())
    try:
        run_journaled(folder / "j.db")
        folder.chmod(0o555)
        (folder / "j.db").chmod(0o444)
        message = _as_somebody_else(folder / "j.db")
    finally:
        folder.chmod(0o755)
        shutil.rmtree(folder)
    assert message[0].startswith("JournalError: ")
    assert "read-only" in message[0] or "cannot be opened" in message[0]
    assert message[1].startswith("events: ")
    assert int(message[1].split()[1]) > 5


def _as_somebody_else(path: Path) -> list[str]:
    """What a process without rights is told when it writes to and reads a journal."""
    reading, writing = os.pipe()
    child = os.fork()
    if not child:
        answers = []
        try:
            if os.geteuid() == 0:
                os.setgid(65534)
                os.setuid(65534)
            try:
                Journal(str(path))
            except Exception as error:
                answers.append(f"{type(error).__name__}: {error}")
            try:
                with JournalReader(str(path)) as reader:
                    answers.append(f"events: {reader.run().events}")
            except Exception as error:
                answers.append(f"{type(error).__name__}: {error}")
        finally:
            os.write(writing, "\n".join(answers).encode())
            os._exit(0)
    os.close(writing)
    os.waitpid(child, 0)
    with open(reading, encoding="utf-8") as source:  # noqa: PTH123
        return source.read().splitlines()


@pytest.mark.parametrize(
    ("name", "kind", "words"),
    [
        ("SQLITE_READONLY_DBMOVED", JournalError, "read-only"),
        ("SQLITE_IOERR_WRITE", JournalFullError, "is the disk full"),
        ("SQLITE_FULL", JournalFullError, "is the disk full"),
        ("SQLITE_BUSY_SNAPSHOT", JournalBusyError, "another process"),
        ("SQLITE_CORRUPT_INDEX", DamagedJournalError, "damaged"),
        ("SQLITE_SCHEMA", DamagedJournalError, "damaged"),
        ("SQLITE_NOMEM", JournalError, r"cannot be written \(what\)"),
    ],
)
def test_every_error_has_words(name: str, kind: type[JournalError], words: str) -> None:
    error = sqlite3.OperationalError("what")
    error.sqlite_errorname = name
    failure = journal_error(error, "j.db", "written")
    assert type(failure) is kind
    with pytest.raises(kind, match=f"^j.db: .*{words}"):
        raise failure
