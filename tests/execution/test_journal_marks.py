"""What the file of a journal itself tells: that it was left open, and where each run ends."""

from __future__ import annotations

import shutil
import sqlite3
import threading
import time
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.cli import main
from gpsfsm.execution.journal import Heading, Journal
from gpsfsm.execution.journal_errors import DamagedJournalError, JournalError
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.queue import QueueKind, QueueRow
from gpsfsm.execution.replay import Comparing, simulate_again
from tests.cli.support import runner, start
from tests.execution.crashing import begun
from tests.execution.journaling import (
    compiled,
    cut,
    driver,
    ends_of_writes,
    exported,
    opened_up,
    resume_journaled,
    run_journaled,
)

if TYPE_CHECKING:
    from collections.abc import Callable

PLAN = "<Plan>" + '<Runner interface="a" provider="p"/>' * 40 + "</Plan>"


@pytest.fixture(scope="module")
def crashed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A journal of a process that was killed when it had acknowledged 20 writes."""
    folder = tmp_path_factory.mktemp("crashed")
    (folder / "plan.xml").write_text(PLAN, encoding="utf-8")
    words = [str(folder / "j.db"), str(folder / "plan.xml"), "4", "process", "after", "20"]
    with begun(words) as process:
        printed, _ = process.communicate()
    assert process.returncode == -9
    assert int(printed.split()[-1]) > 30
    return folder / "j.db"


def checked(path: str) -> str:
    """What a reader notes about a journal as a whole."""
    with JournalReader(path) as reader:
        return reader.check()


def copied(source: Path, folder: Path, *parts: str) -> str:
    for part in ("", *parts):
        shutil.copy(f"{source}{part}", folder / f"j.db{part}")
    return str(folder / "j.db")


@pytest.mark.parametrize("empty", [False, True])
@pytest.mark.parametrize(
    "words",
    [
        ("events", "j.db"),
        ("events", "j.db", "--list"),
        ("events", "j.db", "--queue"),
        ("attempts", "j.db"),
        ("replay", "j.db"),
        ("resume", "j.db"),
    ],
    ids=" ".join,
)
def test_a_crashed_journal_that_was_copied_without_its_log_says_so(
    words: tuple[str, ...],
    crashed: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    *,
    empty: bool,
) -> None:
    monkeypatch.chdir(tmp_path)
    path = copied(crashed, tmp_path)
    if empty:
        (tmp_path / "j.db-wal").touch()
    assert main([*words]) == 2
    error = capsys.readouterr().err
    assert error.startswith("gpsfsm: j.db: the journal is incomplete")
    assert "more was acknowledged" in error
    assert "Copy j.db-wal and j.db-seen to it" in error
    assert "run it again" not in error
    before = (tmp_path / "j.db").read_bytes()
    with pytest.raises(DamagedJournalError, match="incomplete"):
        Journal(path)
    assert (tmp_path / "j.db").read_bytes() == before


@pytest.mark.parametrize("parts", [("-wal",), ("-wal", "-seen")])
def test_with_its_log_it_is_whole(crashed: Path, tmp_path: Path, parts: tuple[str, ...]) -> None:
    path = copied(crashed, tmp_path, *parts)
    with JournalReader(path) as reader:
        assert reader.check() == ""
        assert reader.run().events > 30
    resume_journaled(path)
    run_journaled(tmp_path / "whole.db", PLAN, seed=4)
    assert exported(path).splitlines()[1:] == exported(tmp_path / "whole.db").splitlines()[1:]
    assert sorted(each.name for each in tmp_path.glob("j.db*")) == ["j.db", "j.db-lock"]


def test_nothing_is_acknowledged_before_the_file_is_marked(tmp_path: Path) -> None:
    path = tmp_path / "j.db"
    with Journal(str(path), "power") as journal:
        journal.write_queue(0, QueueRow(QueueKind.SUBMITTED, 1))
        alone = tmp_path / "alone.db"
        shutil.copy(path, alone)
    with pytest.raises(DamagedJournalError, match="incomplete"):
        checked(str(alone))
    assert checked(str(path)) == ""


def test_a_reader_that_stays_holds_no_event_up(tmp_path: Path) -> None:
    """Then the file is marked as soon as it goes."""
    path = tmp_path / "j.db"
    run_journaled(path)
    watching = sqlite3.connect(path, isolation_level=None)
    watching.execute("BEGIN")
    watching.execute("SELECT * FROM run").fetchall()
    with Journal(str(path), "power") as journal:
        began = time.monotonic()
        journal.begin(Kernel(compiled()), Heading(plan=b"a"))
        assert time.monotonic() - began < 3  # it does not wait for the reader
        watching.close()
        journal.write_queue(0, QueueRow(QueueKind.SUBMITTED, 1))
        shutil.copy(path, tmp_path / "alone.db")
    with pytest.raises(DamagedJournalError, match="incomplete"):
        checked(str(tmp_path / "alone.db"))


def test_a_reader_that_goes_soon_is_waited_for(tmp_path: Path) -> None:
    """So the file is marked before the first event is acknowledged."""
    path = tmp_path / "j.db"
    run_journaled(path)
    watching = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
    watching.execute("BEGIN")
    watching.execute("SELECT * FROM run").fetchall()
    with Journal(str(path), "power") as journal:
        leaving = threading.Timer(0.15, watching.close)
        leaving.start()
        journal.begin(Kernel(compiled()), Heading(plan=b"a"))
        shutil.copy(path, tmp_path / "alone.db")
        assert journal._connection.execute("PRAGMA busy_timeout").fetchone() == (5000,)
        leaving.join()
    with pytest.raises(DamagedJournalError, match="incomplete"):
        checked(str(tmp_path / "alone.db"))


def test_a_log_that_another_program_has_moved_is_not_missed(crashed: Path, tmp_path: Path) -> None:
    path = copied(crashed, tmp_path, "-wal", "-seen")
    with sqlite3.connect(path) as other:
        other.execute("SELECT * FROM run").fetchall()
    other.close()
    assert not (tmp_path / "j.db-wal").exists()
    assert checked(path) == ""
    resume_journaled(path)


# -- the ends of closed journals --------------------------------------------------------------


def _forged(path: Path, *statements: str) -> None:
    connection = opened_up(path)
    for statement in statements:
        connection.execute(statement)
    connection.close()


@pytest.mark.parametrize(
    ("statement", "words"),
    [
        ("DELETE FROM event WHERE run = 1 AND seq = LAST", r"event \d+ of run 1 is missing"),
        (
            "DELETE FROM event WHERE run = 1 AND seq > LAST - 3",
            r"events \d+ to \d+ of run 1 are",
        ),
        ("DELETE FROM event WHERE run = 1", r"events 1 to \d+ of run 1 are missing"),
        ("DELETE FROM event WHERE run = 1 AND seq = 5", "event 5 of run 1 is missing"),
        ("DELETE FROM event WHERE run = 1 AND seq IN (5, 6)", "events 5 to 6 of run 1 are missing"),
        ("UPDATE event SET wall_us = wall_us + 1 WHERE run = 1 AND seq = 3", "event 3 .*date and"),
        ("UPDATE event SET record = 0 WHERE run = 1 AND input = 0 AND seq < 9", "event . of run 1"),
        ("UPDATE event SET provider = 'q' WHERE run = 1 AND interface = ''", "event . of run 1 is"),
        ("UPDATE run SET file = 'other.xml' WHERE run = 1", "heading of run 1 .*its file, or its"),
        ("UPDATE run SET wall_us = wall_us - 1 WHERE run = 1", "heading of run 1 .* its time"),
        (
            "UPDATE ending SET hash = zeroblob(32) WHERE run = 1",
            "the end of run 1 is not as recorded",
        ),
        ("UPDATE ending SET ended = '' WHERE run = 1", "the end of run 1 is not as recorded"),
        ("DELETE FROM ending WHERE run = 1", "the end of run 1 is not recorded"),
    ],
)
def test_what_a_run_lacks_is_noticed(tmp_path: Path, statement: str, words: str) -> None:
    path = tmp_path / "j.db"
    for seed in (1, 2):
        run_journaled(path, seed=seed)
    _forged(path, statement.replace("LAST", "(SELECT max(seq) FROM event WHERE run = 1)"))
    with JournalReader(str(path)) as reader:
        with pytest.raises(DamagedJournalError, match=rf"j\.db: .*{words}"):
            list(reader.events(1))
        with pytest.raises(DamagedJournalError):
            reader.verify_all()
        assert len(list(reader.events(2))) == reader.run(2).events


@pytest.mark.parametrize(
    ("statement", "words"),
    [
        ("DELETE FROM run WHERE run = 2", "1 run that had been written are missing"),
        ("DELETE FROM queue WHERE seq = 2", "1 decision of the plan queue that had been written"),
        ("DELETE FROM mark WHERE kind = 'CLOSED'", "incomplete"),
        ("UPDATE mark SET kind = 'OPENED'", "incomplete"),
        ("UPDATE mark SET kind = 'X'", "its marks were changed"),
        ("DELETE FROM mark", "its marks were changed"),
        ("DROP TABLE mark", "table mark differs, or is missing"),
        ("CREATE TABLE more (x)", "table more differs"),
        (
            "CREATE TRIGGER t AFTER INSERT ON event BEGIN DELETE FROM event; END",
            "trigger t differs",
        ),
    ],
)
@pytest.mark.parametrize("use", [checked, Journal])
def test_what_the_file_lacks_is_noticed(
    tmp_path: Path, statement: str, words: str, use: Callable[[str], object]
) -> None:
    path = tmp_path / "j.db"
    for seed in (1, 2):
        run_journaled(path, seed=seed)
    with Journal(str(path), "none") as journal:
        for plan in (1, 2):
            journal.write_queue(0, QueueRow(QueueKind.SUBMITTED, plan))
    _forged(path, "PRAGMA foreign_keys = OFF", statement)
    with pytest.raises(DamagedJournalError, match=rf"j\.db: .*{words}"):
        use(str(path))


@pytest.fixture
def queued(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A journal with a queue of two plans, which every command shows."""
    monkeypatch.chdir(tmp_path)
    for name in ("a.xml", "b.xml"):
        Path(name).write_text(f"<Plan>\n{runner()}\n</Plan>\n", encoding="utf-8")
    assert main(["run", "a.xml", "b.xml", "--failure", "0", "--journal", "j.db"]) == 0
    for option in ("--list", "--queue"):
        assert main(["events", "j.db", option]) == 0
    return tmp_path / "j.db"


@pytest.mark.parametrize(
    ("statement", "words"),
    [
        ("DELETE FROM event WHERE run = 1 AND seq = 5", "event 5 of run 1 is missing"),
        ("DELETE FROM event WHERE run = 1 AND seq < 3", "events 1 to 2 of run 1 are missing"),
        ("UPDATE event SET seq = 0 WHERE run = 1 AND seq = 5", "event 5 of run 1 is missing"),
        (
            "UPDATE event SET seq = -seq WHERE run = 1; DELETE FROM ending",
            "are not numbered from 1 on",
        ),
        ("DELETE FROM queue WHERE seq = 2", "decision 2 of the plan queue is missing"),
    ],
)
def test_every_reader_notices_a_gap(
    queued: Path, capsys: pytest.CaptureFixture[str], statement: str, words: str
) -> None:
    _forged(queued, *statement.split(";"))
    for option in ("--list", "--queue"):
        assert main(["events", queued.name, option]) == 2
        error = capsys.readouterr().err
        assert error.startswith("gpsfsm: j.db: ")
        assert words in error


def test_the_list_notices_a_gap_in_a_file_of_any_size(
    queued: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("gpsfsm.execution.journal_read._LARGEST", 0)
    assert main(["events", queued.name, "--list"]) == 0
    _forged(queued, "DELETE FROM event WHERE run = 1 AND seq = 5")
    assert main(["events", queued.name, "--list"]) == 2
    assert capsys.readouterr().err == (
        "gpsfsm: j.db: event 5 of run 1 is missing: the journal is damaged\n"
    )


@pytest.mark.parametrize("after", [0, 3])
@pytest.mark.parametrize("opened", [True, False])
def test_a_run_that_ends_while_it_is_read_is_no_damage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, after: int, *, opened: bool
) -> None:
    """``opened``: the process that goes on with it has begun before the reader looked."""
    path = tmp_path / "j.db"
    run_journaled(tmp_path / "whole.db")
    last = ends_of_writes(tmp_path / "whole.db")[-2]
    cut(tmp_path / "whole.db", path, last)
    rows, left = JournalReader._rows, [1]

    def slow(reader: JournalReader, statement: str, *values: object, types: str) -> Any:
        if "'ENDED'" in statement and left:
            left.pop()
            _go_on(journal) if opened else resume_journaled(path)
        return rows(reader, statement, *values, types=types)

    with ExitStack() as stack:
        if opened:
            journal = stack.enter_context(Journal(str(path), "none"))
            journal.write_queue(0, QueueRow(QueueKind.SUBMITTED, 1))
        monkeypatch.setattr(JournalReader, "_rows", slow)
        reader = stack.enter_context(JournalReader(str(path)))
        if after:
            seqs = [row.seq for row in reader.events(1, after=after)]
            assert seqs == [*range(after + 1, last + 1)]
        else:
            assert reader.run(1).events == last
        assert not left
        assert reader.run(1).status.ended


def _go_on(journal: Journal) -> None:
    with JournalReader(journal.path) as reader:
        kernel = Kernel(compiled(reader.content(reader.run(), "plan").decode()))
        sink = Comparing(kernel, reader.events(1), journal.go_on(kernel, 1))
        simulate_again(driver(kernel, sink, 1), sink)


def test_ends_are_recorded_once_and_anew_after_more(tmp_path: Path) -> None:
    path = tmp_path / "j.db"
    run_journaled(path)
    Journal(str(path), "none").close()
    with Journal(str(path), "none") as journal:
        journal.write_queue(0, QueueRow(QueueKind.SUBMITTED, 1))
    with JournalReader(str(path)) as reader:
        reader.verify_all()
    connection = sqlite3.connect(path)
    ends = connection.execute("SELECT run, rows FROM ending ORDER BY run").fetchall()
    kinds = [kind for (kind,) in connection.execute("SELECT kind FROM mark ORDER BY seq")]
    connection.close()
    assert [run for run, _ in ends] == [0, 1]
    assert kinds == ["MADE", "OPENED", "CLOSED", "OPENED", "CLOSED"]


def test_a_flipped_bit_in_the_schema_is_damage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Wherever it is: each command tells of the journal, none of a defect of gpsfsm."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.xml").write_text(f"<Plan>\n{runner()}\n</Plan>\n", encoding="utf-8")
    run = ["run", "a.xml", "--failure", "0", "--journal"]
    assert main([*run, "whole.db"]) == 0
    content = (tmp_path / "whole.db").read_bytes()
    begin = content.index(b"CREATE TRIGGER ending_DELETE")  # the first one in the page
    places = [at for at in range(begin, 4096) if 32 <= content[at] < 127][::181]
    assert len(places) > 15
    for number, place in enumerate(places):
        changed = bytes([content[place] ^ (4, 0x80)[number % 2]])  # the second one is no text
        (tmp_path / "j.db").write_bytes(content[:place] + changed + content[place + 1 :])
        for words in (["events", "j.db"], ["replay", "j.db"], ["resume", "j.db"], [*run, "j.db"]):
            capsys.readouterr()
            assert main(words) == 2, (place, words)
            error = capsys.readouterr().err
            assert "j.db: " in error
            assert "defect" not in error


def test_a_file_with_a_byte_or_two_is_no_journal(tmp_path: Path) -> None:
    run_journaled(tmp_path / "j.db")
    content = (tmp_path / "j.db").read_bytes()
    for size in (1, 100, 511):
        (tmp_path / "j.db").write_bytes(content[:size])
        for use in (JournalReader, Journal):
            with pytest.raises(
                JournalError, match=f"not a journal of gpsfsm: it ends after {size} byte"
            ):
                use(str(tmp_path / "j.db"))


# -- the lock ---------------------------------------------------------------------------------


def test_who_deletes_the_lock_file_lets_nobody_write(tmp_path: Path) -> None:
    """Two processes: the first one writes on, the second one is refused, whatever is deleted."""
    (tmp_path / "a.xml").write_text(
        f"<Plan>\n{runner()}\n{runner(x='40')}\n{runner(x='90')}\n</Plan>\n", encoding="utf-8"
    )
    words = ("run", "a.xml", "--failure", "0", "--journal", "j.db")
    with start(*words, "--speed", "20", cwd=tmp_path) as first:
        assert first.stdout is not None
        assert first.stdout.readline()
        for _ in range(2):
            (tmp_path / "j.db-lock").unlink()
            with start(*words, cwd=tmp_path) as second:
                _, error = second.communicate(timeout=60)
            assert second.returncode == 2
            assert b"j.db: another process writes to this journal" in error
        first.communicate(timeout=60)
        assert first.returncode == 0
    with JournalReader(str(tmp_path / "j.db")) as reader:
        reader.verify_all()
        assert len(reader.runs()) == 1
    with start(*words, cwd=tmp_path) as third:
        assert third.communicate(timeout=60)
        assert third.returncode == 0


def test_readers_of_the_same_process_do_not_let_go_of_the_lock(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text(f"<Plan>\n{runner()}\n</Plan>\n", encoding="utf-8")
    path = tmp_path / "j.db"
    run_journaled(path)
    with Journal(str(path), "none"):
        for _ in range(2):
            with JournalReader(str(path)) as reader:
                reader.check()
        (tmp_path / "j.db-lock").unlink()
        with pytest.raises(JournalError, match="another process writes"):
            Journal(str(path))  # which must not let go of it either
        with start("run", "a.xml", "--journal", "j.db", cwd=tmp_path) as other:
            _, error = other.communicate(timeout=60)
        assert other.returncode == 2
        assert b"another process writes to this journal" in error
    Journal(str(path), "none").close()
