"""Whatever happens to the files of a journal after a crash: no loss goes unnoticed."""

from __future__ import annotations

import shutil
import sqlite3
import subprocess
import sys
from contextlib import suppress
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gpsfsm.execution import journal_loss
from gpsfsm.execution.journal import Heading, Journal
from gpsfsm.execution.journal_errors import DamagedJournalError, JournalBusyError, JournalError
from gpsfsm.execution.journal_loss import Held, Seen, read_seen
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.queue import QueueKind, QueueRow
from tests.execution.crashing import begun
from tests.execution.journaling import (
    compiled,
    driver,
    exported,
    opened_up,
    resume_journaled,
    run_journaled,
)

if TYPE_CHECKING:
    from pathlib import Path

PLAN = "<Plan>" + '<Control type="sequential"><Runner interface="a" provider="p"/></Control>' * 60
PLAN += "</Plan>"
SEED = 4
PARTS = ("", "-wal", "-seen")


def killed(folder: Path, durability: str, write: int) -> int:
    """Leaves a journal ``j.db`` of a process that was killed; the last acknowledged event."""
    (folder / "plan.xml").write_text(PLAN, encoding="utf-8")
    words = [str(folder / "j.db"), str(folder / "plan.xml"), str(SEED), durability, "after"]
    with begun([*words, str(write)]) as process:
        printed, _ = process.communicate()
    assert process.returncode == -9
    return int(printed.split()[-1])


@pytest.fixture(scope="module")
def crashed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int]:
    folder = tmp_path_factory.mktemp("crashed")
    return folder / "j.db", killed(folder, "process", 25)


def copied(source: Path, folder: Path) -> Path:
    """A copy of a journal and what belongs to it; what was there before goes."""
    for each in folder.iterdir():
        each.unlink()
    for part in PARTS:
        shutil.copy(f"{source}{part}", folder / f"j.db{part}")
    return folder / "j.db"


def contents(path: Path) -> dict[str, bytes]:
    actual = (path.with_name(path.name + part) for part in PARTS)
    return {each.name: each.read_bytes() for each in actual if each.exists()}


def refused(path: Path, words: str = "missing at its end") -> None:
    """A writer and a reader both tell of damage, and nothing is changed."""
    before = contents(path)
    with pytest.raises(DamagedJournalError, match=words):
        Journal(str(path))
    assert contents(path) == before
    with pytest.raises(DamagedJournalError, match=words), JournalReader(str(path)) as reader:
        reader.check_end()


def events_in(path: Path) -> int:
    with suppress(JournalError), JournalReader(str(path)) as reader:
        return reader.run(1).events
    return 0


def test_after_a_crash_all_is_there_and_the_witness_goes(
    crashed: tuple[Path, int], tmp_path: Path
) -> None:
    path = copied(crashed[0], tmp_path)
    assert sorted(each.name for each in crashed[0].parent.glob("j.db*")) == [
        "j.db",
        "j.db-lock",
        "j.db-seen",
        "j.db-shm",
        "j.db-wal",
    ]
    with JournalReader(str(path)) as reader:
        assert reader.check_end() == ""
        assert reader.run().events > crashed[1]  # the last write was not told of
    resume_journaled(path)
    assert sorted(each.name for each in tmp_path.iterdir()) == ["j.db", "j.db-lock"]
    run_journaled(tmp_path / "whole.db", PLAN, seed=SEED)
    assert exported(path).splitlines()[1:] == exported(tmp_path / "whole.db").splitlines()[1:]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(data=st.data())
def test_no_damage_to_the_log_goes_unnoticed(
    data: st.DataObject, crashed: tuple[Path, int], tmp_path: Path
) -> None:
    path = copied(crashed[0], tmp_path)
    log = tmp_path / "j.db-wal"
    content = log.read_bytes()
    place = data.draw(st.integers(0, len(content) - 1))
    if data.draw(st.booleans(), label="cut off"):
        log.write_bytes(content[:place])
    else:
        log.write_bytes(content[:place] + bytes([content[place] ^ 0x41]) + content[place + 1 :])
    before = contents(path)
    try:
        Journal(str(path)).close()
    except DamagedJournalError:
        assert contents(path) == before
        assert events_in(path) < events_in(crashed[0])
    else:
        assert events_in(path) >= crashed[1]


def test_a_log_that_is_deleted_is_missed(crashed: tuple[Path, int], tmp_path: Path) -> None:
    path = copied(crashed[0], tmp_path)
    (tmp_path / "j.db-wal").unlink()
    refused(path, r"1 run and \d+ events that had been written are missing .*j\.db-wal is missing")


def test_a_link_to_a_journal_is_the_journal(crashed: tuple[Path, int], tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    path, link = copied(crashed[0], tmp_path / "there"), tmp_path / "link.db"
    link.symlink_to(path)
    with Journal(str(link)), pytest.raises(JournalBusyError):
        Journal(str(path))
    copied(crashed[0], tmp_path / "there")
    (tmp_path / "there" / "j.db-wal").unlink()
    refused(link, r"there/j\.db-wal is missing")
    assert list(tmp_path.glob("link.db?*")) == []


def test_a_log_without_its_journal_is_not_thrown_away(
    crashed: tuple[Path, int], tmp_path: Path
) -> None:
    path = copied(crashed[0], tmp_path)
    path.unlink()
    before = contents(path)
    with pytest.raises(DamagedJournalError, match=r"put the journal back, or move .*j\.db-wal"):
        Journal(str(path))
    assert contents(path) == before
    (tmp_path / "j.db-wal").unlink()
    run_journaled(path)  # whoever deletes both wants a new one
    assert exported(path)


@pytest.mark.parametrize("witness", [None, b"", b"gpsfseen", b"gpsfseen" + b"\xff" * 200])
def test_without_a_witness_the_log_is_looked_at(
    crashed: tuple[Path, int], tmp_path: Path, witness: bytes | None
) -> None:
    path = copied(crashed[0], tmp_path)
    (tmp_path / "j.db-seen").unlink()
    if witness is not None:
        (tmp_path / "j.db-seen").write_bytes(witness)
    log = tmp_path / "j.db-wal"
    content = log.read_bytes()
    log.write_bytes(content[:9000] + b"?" + content[9001:])
    refused(path, r"j\.db-wal is damaged at byte 8,272, and what was written behind")
    log.write_bytes(content)
    resume_journaled(path)


def test_a_file_that_only_has_its_name_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "j.db-seen").write_text("what I have seen")
    with pytest.raises(JournalError, match="not a gpsfsm file; move it away"):
        Journal(str(tmp_path / "j.db"))
    assert (tmp_path / "j.db-seen").read_text() == "what I have seen"


def start_anew(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "boot").write_text("01234567-89ab-cdef-0123-456789abcdef\n")
    monkeypatch.setattr(journal_loss, "_BOOT", folder / "boot")


def test_a_power_failure_may_take_what_it_is_allowed_to(
    crashed: tuple[Path, int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = copied(crashed[0], tmp_path)
    log = tmp_path / "j.db-wal"
    log.write_bytes(log.read_bytes()[:60_000])
    refused(path)
    start_anew(tmp_path, monkeypatch)
    with JournalReader(str(path)) as reader:
        end = reader.check_end()
    assert "the machine crashed, which the durability 'process' does not survive" in end
    with Journal(str(path)) as journal:
        assert journal.note == end
    resume_journaled(path)


def test_a_power_failure_may_not_take_what_it_must_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    killed(tmp_path, "power", 25)
    start_anew(tmp_path, monkeypatch)
    log = tmp_path / "j.db-wal"
    content = log.read_bytes()
    log.write_bytes(content[:60_000])
    refused(tmp_path / "j.db")
    log.write_bytes(content[:-9000] + b"????" + content[-8996:])
    refused(tmp_path / "j.db", "damaged")


def test_a_witness_of_another_journal_says_nothing(
    crashed: tuple[Path, int], tmp_path: Path
) -> None:
    run_journaled(tmp_path / "j.db")
    shutil.copy(f"{crashed[0]}-seen", tmp_path / "j.db-seen")
    with JournalReader(str(tmp_path / "j.db")) as reader:
        assert reader.check_end() == ""


def test_runs_and_decisions_count_as_well(tmp_path: Path) -> None:
    path = tmp_path / "j.db"
    with Journal(str(path), "none") as journal:
        journal.begin(Kernel(compiled()), Heading(plan=b"a"))
        shutil.copy(path, tmp_path / "early.db")
        shutil.copy(f"{path}-wal", tmp_path / "early.db-wal")
        journal.write_queue(0, QueueRow(QueueKind.SUBMITTED, 1))
        journal.begin(Kernel(compiled()), Heading(plan=b"b"), queued=(0, 1))
        shutil.copy(f"{path}-seen", tmp_path / "early.db-seen")
    refused(tmp_path / "early.db", "1 run and 2 decisions of the plan queue that had been written")


def test_whoever_reads_meanwhile_misses_nothing(tmp_path: Path) -> None:
    path = str(tmp_path / "j.db")
    kernel = Kernel(compiled(PLAN))
    with Journal(path, "none") as journal:
        sink = journal.begin(kernel, Heading(plan=PLAN.encode(), seed=SEED))
        running, looked = driver(kernel, sink, SEED), 0
        running.watchers.append(lambda *_: check(path))

        def check(place: str) -> None:
            nonlocal looked
            with JournalReader(place) as reader:
                assert reader.check_end() == ""
            looked += 1

        running.run()
        seen = read_seen(path)
        assert seen is not None
        assert seen.held.events == sink.seq
    assert looked > 20


def test_a_reader_of_the_same_process_does_not_let_go_of_the_log(tmp_path: Path) -> None:
    """Closing a file takes away the locks of a process on it, and then others remove the log."""
    path = tmp_path / "j.db"
    code = "import sqlite3, sys; c = sqlite3.connect(sys.argv[1]); c.execute('SELECT * FROM run')"
    with Journal(str(path)) as journal:
        with JournalReader(str(path)):
            pass
        subprocess.run([sys.executable, "-c", f"{code}.fetchall(); c.close()", path], check=True)
        assert (tmp_path / "j.db-wal").exists()
        journal.begin(Kernel(compiled()), Heading(plan=b"a"))
    with JournalReader(str(path)) as reader:
        assert len(reader.runs()) == 1


def test_the_lock_leaves_one_file(crashed: tuple[Path, int], tmp_path: Path) -> None:
    assert not (crashed[0].parent / "j.db-lock-journal").exists()
    (tmp_path / "j.db-lock-journal").touch()  # of an earlier version
    run_journaled(tmp_path / "j.db")
    assert sorted(each.name for each in tmp_path.iterdir()) == ["j.db", "j.db-lock"]


def test_nothing_is_appended_to_a_damaged_file(tmp_path: Path) -> None:
    path = tmp_path / "j.db"
    for seed in range(3):
        run_journaled(path, PLAN, seed=seed)
    content = path.read_bytes()
    refusals = 0
    for place in range(4096, len(content), 4096):
        damaged = content[:place] + b"\xa5" * 4096 + content[place + 4096 :]
        path.write_bytes(damaged)
        with pytest.raises(DamagedJournalError, match=r"damaged|not as it was written"):
            Journal(str(path))
        assert path.read_bytes() == damaged
        refusals += 1
    assert refusals > 5
    path.write_bytes(content)
    run_journaled(path)


@pytest.mark.parametrize(
    "change", ["UPDATE event SET at_us = 7 WHERE run = 2 AND seq = 5", "UPDATE queue SET by = 3"]
)
def test_nothing_is_appended_to_what_was_changed(tmp_path: Path, change: str) -> None:
    path = tmp_path / "j.db"
    for seed in range(2):
        run_journaled(path, seed=seed)
    with Journal(str(path), "none") as journal:
        journal.write_queue(0, QueueRow(QueueKind.SUBMITTED, 1))
    connection = opened_up(path)
    assert connection.execute(change).rowcount == 1
    connection.close()
    with pytest.raises(DamagedJournalError, match="not as it was written"):
        Journal(str(path))


def test_what_cannot_be_noted_stops_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = Seen(str(tmp_path / "j.db"), "process", Held(1, 2, 3, "ab" * 16))

    def full(*_: object) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.pwrite", full)
    seen.add(events=5)
    monkeypatch.undo()
    observed = read_seen(str(tmp_path / "j.db"))
    assert observed is not None
    assert (observed.held, observed.durability, observed.exact) == (
        Held(1, 2, 3, "ab" * 16),
        "process",
        True,
    )
    seen.add(runs=1, events=5, decisions=2)
    observed = read_seen(str(tmp_path / "j.db"))
    assert observed is not None
    assert observed.held == Held(2, 12, 5, "ab" * 16)
    seen.close(remove=True)
    assert not list(tmp_path.iterdir())


def test_forged_counts_are_damage(tmp_path: Path) -> None:
    run_journaled(tmp_path / "j.db")
    connection = sqlite3.connect(tmp_path / "j.db")
    connection.execute("ALTER TABLE queue RENAME TO old")
    connection.execute("CREATE TABLE queue (seq)")
    connection.execute("INSERT INTO queue VALUES ('many')")
    connection.commit()
    connection.close()
    with (
        JournalReader(str(tmp_path / "j.db")) as reader,
        pytest.raises(DamagedJournalError, match="wrong type"),
    ):
        reader.check_end()
