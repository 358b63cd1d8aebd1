"""Damage in a write-ahead log is found where SQLite says nothing."""

from __future__ import annotations

import os
import shutil
import sqlite3
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gpsfsm.execution.journal_loss import damage_of

if TYPE_CHECKING:
    from pathlib import Path

TRANSACTIONS = 12
FRAME = 4096 + 24


@pytest.fixture(scope="module")
def crashed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A database with a log, as SQLite leaves it in a crash: 12 transactions of several pages."""
    folder = tmp_path_factory.mktemp("log")
    connection = sqlite3.connect(folder / "open.db", isolation_level=None)
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("PRAGMA wal_autocheckpoint = 0")
    connection.execute("CREATE TABLE t (x)")
    connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")  # the log begins anew
    for number in range(TRANSACTIONS):
        connection.execute("INSERT INTO t VALUES (?)", (f"{number} " * 3000,))
    shutil.copy(folder / "open.db", folder / "a.db")
    shutil.copy(folder / "open.db-wal", folder / "a.db-wal")
    connection.close()
    return folder / "a.db"


def left(source: Path, folder: Path, log: bytes) -> int:
    """How many transactions SQLite finds with this log."""
    shutil.copy(source, folder / "b.db")
    (folder / "b.db-wal").write_bytes(log)
    (folder / "b.db-shm").unlink(missing_ok=True)
    connection = sqlite3.connect(f"file:{folder / 'b.db'}?mode=ro", uri=True)
    try:
        count: int = connection.execute("SELECT count(*) FROM t").fetchone()[0]
    finally:
        connection.close()
    return count


def test_a_whole_log_is_whole(crashed: Path, tmp_path: Path) -> None:
    assert damage_of(f"{crashed}-wal") is None
    log = crashed.with_name("a.db-wal").read_bytes()
    assert left(crashed, tmp_path, log) == TRANSACTIONS
    assert damage_of(str(tmp_path / "none-wal")) is None
    os.mkfifo(tmp_path / "pipe-wal")
    assert damage_of(str(tmp_path / "pipe-wal")) is None


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(data=st.data())
def test_what_is_not_told_costs_no_more_than_one_transaction(
    data: st.DataObject, crashed: Path, tmp_path: Path
) -> None:
    log = bytearray(crashed.with_name("a.db-wal").read_bytes())
    place = data.draw(st.integers(0, len(log) - 1))
    length = data.draw(st.sampled_from([1, 8, 700, 5000]))
    value = data.draw(st.sampled_from([0x00, 0xA5]))
    changed = bytes(byte ^ 0x5A if value else 0 for byte in log[place : place + length])
    log[place : place + length] = changed
    (tmp_path / "c-wal").write_bytes(log)
    damage = damage_of(str(tmp_path / "c-wal"))
    count = left(crashed, tmp_path, bytes(log))
    if damage is None:  # damage longer than a frame may take the ends of the last two
        assert count >= TRANSACTIONS - (1 if length < FRAME else 2)
    else:
        assert count < TRANSACTIONS
        assert damage.place <= place < len(log)


@pytest.mark.parametrize("cut", [0, 1, 31, 32, 33, 4000, 100_000])
def test_a_log_that_ends_early_may_come_of_a_crash(crashed: Path, tmp_path: Path, cut: int) -> None:
    log = crashed.with_name("a.db-wal").read_bytes()
    (tmp_path / "c-wal").write_bytes(log[:cut])
    assert damage_of(str(tmp_path / "c-wal")) is None


def test_frames_of_an_older_log_are_no_damage(tmp_path: Path) -> None:
    path = tmp_path / "a.db"
    connection = sqlite3.connect(path, isolation_level=None)
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("CREATE TABLE t (x)")
    for _ in range(5):
        connection.execute("INSERT INTO t VALUES (zeroblob(30000))")
    connection.execute("PRAGMA wal_checkpoint(RESTART)")
    connection.execute("INSERT INTO t VALUES (1)")  # overwrites the beginning of the log
    size = os.stat(f"{path}-wal").st_size  # noqa: PTH116
    assert size > 100_000
    assert damage_of(f"{path}-wal") is None
    connection.close()


@pytest.mark.parametrize("header", [bytes(32), b"\xff" * 32])
def test_a_log_without_its_beginning_is_damaged(
    crashed: Path, tmp_path: Path, header: bytes
) -> None:
    log = crashed.with_name("a.db-wal").read_bytes()
    (tmp_path / "c-wal").write_bytes(header + log[32:])
    damage = damage_of(str(tmp_path / "c-wal"))
    assert damage is not None
    assert damage.place == 0
    (tmp_path / "c-wal").write_bytes(header + log[32:100])
    assert damage_of(str(tmp_path / "c-wal")) is None  # there is no frame in it


def test_a_log_that_is_being_written_is_looked_at_twice(
    crashed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = crashed.with_name("a.db-wal").read_bytes()
    target = tmp_path / "c-wal"
    target.write_bytes(whole[:5000] + b"?" * 50 + whole[5050:])
    assert damage_of(str(target)) is not None
    monkeypatch.setattr("time.sleep", lambda _: target.write_bytes(whole))
    assert damage_of(str(target)) is None
