from __future__ import annotations

import json
import sqlite3
from contextlib import closing
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from gpsfsm.execution.journal_rows import chained, queue_line
from tests.cli.support import ACCEPTED, REJECTED, run, write

COLUMNS = ("seq", "at_us", "kind", "plan", "by", "data", "message")


def generate(*answers: str, task: str = "go") -> None:
    """Leave a session behind in run.db."""
    journal = Path("run.db")
    if journal.exists():
        generated(journal, answers, task)
    else:
        journal.write_bytes(only(answers, task))


@cache
def only(answers: tuple[str, ...], task: str) -> bytes:
    """A journal with this one session. Many tests begin with the same one."""
    with TemporaryDirectory() as folder:
        generated(Path(folder) / "run.db", answers, task)
        assert not (Path(folder) / "run.db-wal").exists()  # all is in the one file
        return (Path(folder) / "run.db").read_bytes()


def generated(journal: Path, answers: tuple[str, ...], task: str) -> None:
    lines = "".join(json.dumps({"answer": answer}) + "\n" for answer in answers)
    Path("answers.jsonl").write_text(lines)
    done = run(
        *("generate", task, "--model", "replay:answers.jsonl", "--journal", journal),
        *("--attempts", str(len(answers)), "--format", "json"),
    )
    assert done.returncode in (0, 1), done.stderr.decode()


def attempts(*arguments: str) -> tuple[int, str, str]:
    """Exit code, standard output, standard error."""
    done = run("attempts", *arguments)
    return done.returncode, done.stdout.decode(), done.stderr.decode()


def change(column: str, value: object, seq: int, *, link: bool) -> None:
    """Change a row behind the back of gpsfsm; ``link``: as if it had been written so."""
    with closing(sqlite3.connect("run.db")) as database, database:
        selected = database.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'")
        for (name,) in selected.fetchall():
            database.execute(f'DROP TRIGGER "{name}"')
        place = COLUMNS.index(column)
        rows = database.execute(f"SELECT {', '.join(COLUMNS)} FROM queue ORDER BY seq").fetchall()  # noqa: S608
        rows[seq - 1] = (*rows[seq - 1][:place], value, *rows[seq - 1][place + 1 :])
        digest = b""
        for row in rows:
            digest = chained(digest, queue_line(row))
            database.execute(
                "UPDATE queue SET kind = ?, plan = ?, data = ?, message = ? WHERE seq = ?",
                (row[2], row[3], row[5], row[6], row[0]),
            )
            if link:
                database.execute("UPDATE queue SET hash = ? WHERE seq = ?", (digest, row[0]))


def test_sessions_and_their_attempts() -> None:
    generate(REJECTED, ACCEPTED, task="go\nhome")
    generate(REJECTED, task="stay")
    code, out, _ = attempts("run.db")
    assert code == 0
    assert out.splitlines() == [
        "session 1: replay:answers.jsonl: go home",
        "  attempt 1: rejected, 1 error (GP307); 0.0 s",
        "  attempt 2: accepted; 0.0 s",
        "  a plan was accepted",
        "",
        "session 2: replay:answers.jsonl: stay",
        "  attempt 1: rejected, 1 error (GP307); 0.0 s",
        "  no plan: no plan was accepted in 1 attempt",
    ]
    assert attempts("run.db", "--session", "2")[1] == "\n".join(out.splitlines()[5:]) + "\n"


def test_one_attempt_with_all_that_was_said() -> None:
    generate(REJECTED, ACCEPTED)
    code, out, _ = attempts("run.db", "--show", "2")
    assert code == 0
    titles = [line for line in out.splitlines() if line.startswith("== ")]
    assert titles == ["== the last message to the model", "== the answer", "== the result"]
    assert "Your plan was rejected: 1 error" in out
    assert "\n   Write instead:\n" in out
    assert "The plan is accepted.\n" in out


SESSION_KEYS = {
    *("session", "plan", "task", "model", "template", "template_sha256", "prompt_sha256"),
    *("library_sha256", "seed", "rounds", "candidates", "why"),
    *("accepted", "interrupted", "reason", "attempts"),
}
ATTEMPT_KEYS = {
    *("round", "candidate", "asked", "answer", "model", "finish", "latency_s", "requests"),
    *("accepted", "plan", "told", "errors", "warnings", "decided", "repairs", "findings"),
}


def test_the_fields_of_the_data_are_a_promise() -> None:
    generate(REJECTED, ACCEPTED)
    code, out, _ = attempts("run.db", "--format", "json")
    data = json.loads(out)
    assert (code, data["version"], sorted(data)) == (0, 1, ["sessions", "version"])
    (session,) = data["sessions"]
    assert set(session) == SESSION_KEYS
    assert [set(each) for each in session["attempts"]] == [ATTEMPT_KEYS] * 2


def test_into_a_file() -> None:
    generate(ACCEPTED)
    code, out, _ = attempts("run.db", "-o", "told.txt")
    assert (code, out) == (0, "")
    assert Path("told.txt").read_text().startswith("session 1: ")
    assert attempts("run.db", "-o", "run.db")[0] == 2


def test_a_task_and_an_answer_play_no_tricks_on_a_terminal() -> None:
    nasty = "\x1b]0;owned\x07\x9b2J\u202e"
    generate(f"{nasty}{REJECTED}", task=f"go{nasty}")
    shown = attempts("run.db")[1] + attempts("run.db", "--show", "1")[1]
    assert not set("\x1b\x07\x9b\u202e").intersection(shown)
    assert "owned" in shown


def test_runs_are_none_of_its_business() -> None:
    write(Path(), plan=ACCEPTED)
    assert run("run", "plan.xml", "--journal", "run.db").returncode == 0
    code, out, err = attempts("run.db")
    assert (code, out) == (2, "")
    assert err == "gpsfsm: run.db: no model was asked in this journal\n"
    generate(ACCEPTED)
    assert attempts("run.db")[1].startswith("session 1: ")
    assert run("replay", "run.db").returncode == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "gpsfsm.db: "),
        (("absent.db",), "absent.db: "),
        (("foreign.db",), "foreign.db: this is not a journal of gpsfsm"),
        (("folder",), "folder: "),
        (("run.db", "--session", "2"), "there is no session 2 in run.db; it holds session 1 alone"),
        (("run.db", "--show", "2"), "there is no attempt 2; the session has 1 attempt"),
        (("run.db", "--show", "1", "--format", "json"), "--show cannot be used with --format json"),
        (("run.db", "--session", "0"), "--session"),
    ],
)
def test_what_cannot_be_shown(arguments: tuple[str, ...], message: str) -> None:
    generate(ACCEPTED)
    Path("foreign.db").write_bytes(b"no database" * 100)
    Path("folder").mkdir()
    code, out, err = attempts(*arguments)
    assert (code, out) == (2, "")
    assert message in err


def test_another_database_is_no_journal() -> None:
    with closing(sqlite3.connect("other.db")) as database, database:
        database.execute("CREATE TABLE queue (seq)")
    code, out, err = attempts("other.db")
    assert (code, out) == (2, "")
    assert "other.db: " in err


DEEP = '{"a": ' * 5000 + "1" + "}" * 5000


@pytest.mark.parametrize(
    ("column", "value"),
    [
        *[("data", data) for data in ("{", "[1]", '"x"', "7", "{}", DEEP, '{"round": 1e400}')],
        *[("kind", kind) for kind in ("DREAMT", "GENERATED", "\x1b[2J")],
        ("plan", 9),
    ],
)
@pytest.mark.parametrize("seq", [1, 2])
def test_a_row_that_makes_no_sense_is_told(column: str, value: object, seq: int) -> None:
    generate(ACCEPTED)
    change(column, value, seq, link=True)
    code, out, err = attempts("run.db")
    assert (code, out) == (2, "")
    assert err.startswith("gpsfsm: run.db: ")
    assert "\x1b" not in err


def test_a_row_that_was_changed_is_told() -> None:
    generate(REJECTED)
    change("message", "a plan was accepted", 3, link=False)
    code, out, err = attempts("run.db")
    assert (code, out) == (2, "")
    assert "decision 3 of the plan queue is not as it was written" in err
