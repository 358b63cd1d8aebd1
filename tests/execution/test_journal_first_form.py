"""Journals of the first form, which an earlier gpsfsm has written: read, checked and gone on with.

The files in ``journals`` were written by gpsfsm 0.1.0 before there was a second form, and so was
what is shown of them.
"""

from __future__ import annotations

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from gpsfsm.cli import main
from gpsfsm.execution.journal import Heading, Journal
from gpsfsm.execution.journal_errors import DamagedJournalError
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.kernel import Kernel
from tests.execution.journaling import compiled, exported, opened_up

OLD = Path(__file__).parent / "journals"
NOT_COVERED = (
    "gpsfsm: form_1.db: an earlier gpsfsm has written to this journal: no hash covers its "
    "dates, times and file names\n"
)


@pytest.fixture
def old(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for each in OLD.iterdir():
        shutil.copy(each, tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path / "form_1.db"


def shown(capsys: pytest.CaptureFixture[str], *words: str, code: int = 0) -> tuple[str, str]:
    assert main([*words]) == code
    out, err = capsys.readouterr()
    return out, err


@pytest.mark.parametrize(
    ("words", "file", "note"),
    [
        (("events", "form_1.db"), "form_1.events.txt", ""),
        (("events", "form_1.db", "--verify"), "form_1.events.txt", NOT_COVERED),
        (("attempts", "form_1.db"), "form_1.attempts.txt", ""),
        (
            ("events", "form_1.db", "--queue", "--format", "jsonl", "--wall-clock"),
            "form_1.queue.jsonl",
            NOT_COVERED,
        ),
        (
            ("events", "form_1.db", "--run", "2", "--format", "jsonl", "--wall-clock"),
            "form_1.run_2.jsonl",
            NOT_COVERED,
        ),
        (("events", "form_1_crashed.db", "--format", "jsonl"), "form_1_crashed.jsonl", ""),
    ],
)
def test_it_is_shown_as_before(
    old: Path,
    capsys: pytest.CaptureFixture[str],
    words: tuple[str, ...],
    file: str,
    note: str,
) -> None:
    before = old.read_bytes()
    out, err = shown(capsys, *words)
    assert out == (OLD / file).read_text(encoding="utf-8")
    assert err == note
    assert old.read_bytes() == before


@pytest.mark.parametrize("words", [("replay", "form_1.db"), ("resume", "form_1_crashed.db")])
def test_what_was_run_by_other_rules_is_not_run_again(
    words: tuple[str, str], old: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its times are those of kernel 2, in which each action took a microsecond more."""
    before = exported(old.with_name(words[1]))
    _, err = shown(capsys, *words, code=2)
    assert "(kernel 2), whose rules differ from those of this gpsfsm" in err
    assert exported(old.with_name(words[1])) == before


def test_a_crashed_one_is_checked(old: Path) -> None:
    with JournalReader(str(old.with_name("form_1_crashed.db"))) as reader:
        assert reader.check() == ""
        reader.verify_all()
        assert not reader.covers_wall_times


def test_what_is_written_into_it_from_now_on_is_covered(old: Path) -> None:
    shown_before = [exported(old, number) for number in (1, 2, 3)]
    with Journal(str(old), "none") as journal:
        journal.begin(Kernel(compiled()), Heading(plan=b"a", file="a.xml"))
    assert [exported(old, number) for number in (1, 2, 3)] == shown_before
    with closing(opened_up(old)) as connection:
        connection.execute("UPDATE run SET file = 'b.xml' WHERE run = 1")
    with JournalReader(str(old)) as reader:
        assert reader.run(1).file == "b.xml"  # nobody can know
    for statement in ("file = 'b.xml'", "wall_us = wall_us + 1", "wall_hash = x''"):
        shutil.copy(old, "copy.db")
        with closing(opened_up("copy.db")) as connection:
            connection.execute(f"UPDATE run SET {statement} WHERE run = 4")  # noqa: S608
        with (
            JournalReader("copy.db") as reader,
            pytest.raises(DamagedJournalError, match="the heading of run 4 is not as it was"),
        ):
            reader.run(4)


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE event SET message = 'x' WHERE run = 1 AND seq = 5",
        "DELETE FROM event WHERE run = 1 AND seq = 5",
        "UPDATE event SET input = 2 WHERE run = 1 AND seq = 1",
        "DELETE FROM queue WHERE seq = 3",
        "DROP TABLE content",
    ],
)
def test_damage_in_it_is_noticed(
    old: Path, statement: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with closing(opened_up(old)) as connection:
        connection.execute(statement)
    for words in (("events",), ("events", "--verify"), ("replay",)):
        _, err = shown(capsys, *words, "form_1.db", code=2)
        assert "form_1.db: " in err


def test_it_gets_its_second_form_with_the_first_write_alone(old: Path) -> None:
    Journal(str(old), "none").close()
    with closing(sqlite3.connect(old)) as connection:
        assert connection.execute("PRAGMA user_version").fetchone() == (1,)
    with Journal(str(old), "none") as journal:
        journal.begin(Kernel(compiled()), Heading(plan=b"a"))
    with closing(sqlite3.connect(old)) as connection:
        assert connection.execute("PRAGMA user_version").fetchone() == (2,)
        kinds = [kind for (kind,) in connection.execute("SELECT kind FROM mark ORDER BY seq")]
    assert kinds == ["UPGRADED", "OPENED", "CLOSED"]
