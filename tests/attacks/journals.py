"""Damaged journals: whoever reads one shows what the whole one shows, or says that it is damaged.

Journals of real runs are copied, the copy is damaged, in its bytes, by SQL, or by taking away files
beside it, and put to every command that reads journals.
"""

from __future__ import annotations

import atexit
import io
import os
import shutil
import sqlite3
import tempfile
from contextlib import closing, contextmanager, redirect_stderr, redirect_stdout
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from hypothesis import strategies as st

from gpsfsm.cli import main
from gpsfsm.execution.journal import Journal
from gpsfsm.execution.journal_file import settle
from tests.campaigns.base import Pair
from tests.cli.regenerating import ARGUMENTS, answers
from tests.cli.support import runner
from tests.execution.journaling import opened_up

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

PAGE = 4096
NAME = "j.db"
PARTS = ("", "-wal", "-seen")
SHAPES = ("one run", "several runs", "a queue", "attempts", "crashed")
COMMANDS = (
    ("events", NAME),
    ("events", NAME, "--list"),
    ("events", NAME, "--run", "1", "--format", "jsonl", "--wall-clock"),
    ("events", NAME, "--verify"),
    ("events", NAME, "--queue", "--wall-clock"),
    ("attempts", NAME),
    ("replay", NAME),
    ("resume", NAME, "--durability", "none"),
)
"""The last one may write, so it comes last."""

_FALSE = ("no model was asked", "there is no plan queue", "no run is in it", "there is no run in")
"""What must not be said of a damaged journal, unless it is true of the whole one."""


class Damage(NamedTuple):
    """One kind of damage; ``places`` are numbers that say where, for a journal of any size."""

    kind: str
    places: tuple[int, ...]


class Case(NamedTuple):
    """A shape of a journal, and what happens to a copy of it."""

    shape: str
    damages: tuple[Damage, ...]


Answer = tuple[int, str, str]


# -- the journals -----------------------------------------------------------------------------


def _plan(steps: int) -> str:
    wait = '<Control type="recovery">' + runner(x="9") + "</Control>"
    return (
        "<Plan>\n"
        + "".join(f"{runner(x=str(n % 7))}\n{wait}\n" for n in range(steps))
        + "</Plan>\n"
    )


@contextmanager
def _within(folder: Path) -> Iterator[None]:
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


def _answer(*words: str) -> Answer:
    """What a command line comes to: exit code, standard output, standard error."""
    out = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True)
    err = io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        code = main(words)
    return code, out.buffer.getvalue().decode(), err.getvalue()


def _one_run() -> None:
    _ran("long.xml", "--failure", "0")


def _several_runs() -> None:
    for seed in ("1", "2", "3"):
        _ran("short.xml", "--seed", seed)


def _queue() -> None:
    _ran("short.xml", "long.xml", "short.xml", "--failure", "0")


def _attempts() -> None:
    _ran(*ARGUMENTS)


def _crashed() -> None:
    """A process that is killed when part of its log has been moved into the file."""
    write, count = Journal._transaction, 0

    def copying(self: Journal, action: Callable[[], object]) -> object:
        nonlocal count
        count += 1
        if count == 30:
            settle(self._connection)
        if count == 60:
            for part in PARTS:
                shutil.copy(NAME + part, f"kept{part}")
        return write(self, action)

    Journal._transaction = copying  # type: ignore[method-assign,assignment]
    try:
        _ran("long.xml", "--failure", "0")
    finally:
        Journal._transaction = write  # type: ignore[method-assign]
    for part in PARTS:
        shutil.move(f"kept{part}", NAME + part)


def _ran(*words: str) -> None:
    code, _, err = _answer("run", *words, "--journal", NAME, "--durability", "none")
    assert code in (0, 1), err


@cache
def _folder() -> Path:
    folder = Path(tempfile.mkdtemp(prefix="gpsfsm-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


@cache
def whole(shape: str) -> Path:
    """The folder of a journal that nobody has damaged."""
    folder = _folder() / shape.replace(" ", "_")
    folder.mkdir()
    (folder / "long.xml").write_text(_plan(60), encoding="utf-8")
    (folder / "short.xml").write_text(_plan(4), encoding="utf-8")
    answers(folder)
    made = (_one_run, _several_runs, _queue, _attempts, _crashed)[SHAPES.index(shape)]
    with _within(folder):
        made()
    return folder


@cache
def expected(shape: str) -> tuple[Answer, ...]:
    """What each command says of the whole journal."""
    with copied(shape):
        return tuple(_answer(*words) for words in COMMANDS)


@contextmanager
def copied(shape: str) -> Iterator[None]:
    """Within a folder with a copy of the journal."""
    source = whole(shape)
    with tempfile.TemporaryDirectory(dir=_folder()) as name:
        for part in PARTS:
            if (source / (NAME + part)).exists():
                shutil.copy(source / (NAME + part), name)
        with _within(Path(name)):
            yield


# -- the damage -------------------------------------------------------------------------------


def _bytes(path: str, change: Callable[[bytearray], None]) -> None:
    content = bytearray(Path(path).read_bytes())
    if content:
        change(content)
        Path(path).write_bytes(content)


def _flip(path: str, *places: int) -> None:
    def change(content: bytearray) -> None:
        content[places[0] % len(content)] ^= 1 << places[1] % 8

    _bytes(path, change)


def _page(path: str, *places: int) -> None:
    """Another content for a page: zeros, or that of another page."""

    def change(content: bytearray) -> None:
        pages = len(content) // PAGE
        first, second = (place % pages * PAGE for place in places[:2])
        one, two = content[first : first + PAGE], content[second : second + PAGE]
        if places[2] % 2:
            content[first : first + PAGE], content[second : second + PAGE] = two, one
        else:
            content[first : first + PAGE] = bytes(PAGE)

    if Path(path).stat().st_size >= PAGE:
        _bytes(path, change)


def _truncate(path: str, *places: int) -> None:
    size = Path(path).stat().st_size
    left = places[0] % (size + 1)
    os.truncate(path, left // PAGE * PAGE if places[1] % 2 else left)


_GONE = (("-wal",), ("-seen",), ("-wal", "-seen"))
_FLIPPED = ("-wal", "-wal", "-seen")


def _beside(_: str, *places: int) -> None:
    """The log, the witness, or both are gone, or empty."""
    for part in _GONE[places[0] % len(_GONE)]:
        place = Path(NAME + part)
        if places[1] % 4 == 0 and place.exists():
            place.write_bytes(b"")
        else:
            place.unlink(missing_ok=True)


def _log(_: str, *places: int) -> None:
    """A flipped bit in the log, or in the witness."""
    path = NAME + _FLIPPED[places[2] % len(_FLIPPED)]
    if Path(path).exists():
        _flip(path, *places)


_TABLES = ("event", "event", "event", "queue", "run", "content", "mark", "ending")


class _Table(NamedTuple):
    """A table of a journal that is open: its columns, its key, and the keys of its rows."""

    connection: sqlite3.Connection
    name: str
    columns: list[str]
    key: list[str]
    rows: list[tuple[Any, ...]]

    def run(self, statement: str, *values: object) -> None:
        self.connection.execute(statement, values)

    @property
    def where(self) -> str:
        return "WHERE " + " AND ".join(f"{name} = ?" for name in self.key)


def _sql(change: Callable[..., None]) -> Callable[..., None]:
    def damage(path: str, *places: int) -> None:
        with closing(opened_up(path)) as connection:
            name = _TABLES[places[0] % len(_TABLES)]
            info = connection.execute(f"PRAGMA table_info({name})").fetchall()
            key = [row[1] for row in info if row[5]]
            keys = f"SELECT {', '.join(key)} FROM {name} ORDER BY {', '.join(key)}"  # noqa: S608
            rows = connection.execute(keys).fetchall()
            if rows:
                table = _Table(connection, name, [row[1] for row in info], key, rows)
                try:
                    change(table, *places[1:])
                except (sqlite3.IntegrityError, sqlite3.OperationalError):
                    return  # not even SQL lets anybody do that

    return damage


@_sql
def _delete(table: _Table, *places: int) -> None:
    """Rows are gone: anywhere, or the last ones."""
    count = places[1] % 5 + 1
    first = len(table.rows) - count if places[2] % 3 == 0 else places[0] % len(table.rows)
    for key in table.rows[max(0, first) :][:count]:
        table.run(f"DELETE FROM {table.name} {table.where}", *key)  # noqa: S608


@_sql
def _change(table: _Table, *places: int) -> None:
    """A value in a row is another one."""
    key, column = (
        table.rows[places[0] % len(table.rows)],
        table.columns[places[1] % len(table.columns)],
    )
    select = f"SELECT {column} FROM {table.name} {table.where}"  # noqa: S608
    (value,) = table.connection.execute(select, key).fetchone()
    new: object
    if isinstance(value, int):
        new = value + (-1, 1, 1_000_000, -(2**40))[places[2] % 4]
    elif isinstance(value, str):
        place = places[2] % (len(value) + 1)
        new = value[:place] + "7" + value[place + places[2] % 2 :]
    else:
        new = bytes([*value[:-1], (value or b"\0")[-1] ^ 1])
    table.run(f"UPDATE {table.name} SET {column} = ? {table.where}", new, *key)  # noqa: S608


@_sql
def _reorder(table: _Table, *places: int) -> None:
    """Two rows have each other's place."""
    one, two = (table.rows[place % len(table.rows)] for place in places[:2])
    aside = (*one[:-1], f"x{one[-1]}" if isinstance(one[-1], str) else 10**6 + one[-1])
    columns = ", ".join(f"{name} = ?" for name in table.key)
    table.run("PRAGMA foreign_keys = OFF")
    for old, new in ((one, aside), (two, one), (aside, two)):
        table.run(f"UPDATE {table.name} SET {columns} {table.where}", *new, *old)  # noqa: S608


@_sql
def _repeat(table: _Table, *places: int) -> None:
    """A row comes once more, behind the last one."""
    key = table.rows[places[0] % len(table.rows)]
    last = table.rows[-1][-1]
    after = f"x{last}" if isinstance(last, str) else last + 1
    columns = ", ".join("?" if name == table.key[-1] else name for name in table.columns)
    table.run(
        f"INSERT INTO {table.name} SELECT {columns} FROM {table.name} {table.where}",  # noqa: S608
        after,
        *key,
    )


def _clock(path: str, *places: int) -> None:
    """All dates are later, or a file has another name."""
    statements = (
        "UPDATE event SET wall_us = wall_us + 3600000000",
        "UPDATE queue SET wall_us = wall_us + 3600000000",
        "UPDATE run SET wall_us = wall_us + 3600000000",
        "UPDATE run SET file = 'other.xml'",
    )
    with closing(opened_up(path)) as connection:
        connection.execute(statements[places[0] % len(statements)])


def _schema(path: str, *places: int) -> None:
    """A bit of the text that says which tables there are."""

    def change(content: bytearray) -> None:
        page = content[:PAGE]
        places_of_text = [at for at in range(100, len(page)) if 32 <= page[at] < 127]
        if places_of_text:
            content[places_of_text[places[0] % len(places_of_text)]] ^= 1 << places[1] % 7

    _bytes(path, change)


KINDS: dict[str, Callable[..., None]] = {
    "a bit flipped": _flip,
    "a bit of the schema flipped": _schema,
    "a page zeroed or exchanged": _page,
    "cut off": _truncate,
    "files beside it gone": _beside,
    "a bit of the log flipped": _log,
    "rows deleted": _delete,
    "a value changed": _change,
    "rows exchanged": _reorder,
    "a row repeated": _repeat,
    "dates or names changed": _clock,
}


def cases() -> st.SearchStrategy[Case]:
    places = st.tuples(*[st.integers(0, 2**24)] * 4)
    damage = st.builds(Damage, st.sampled_from([*KINDS]), places)
    return st.builds(
        Case, st.sampled_from(SHAPES), st.lists(damage, min_size=1, max_size=2).map(tuple)
    )


# -- the judge --------------------------------------------------------------------------------


def judge(case: Case) -> Iterator[str]:
    """Each command says what it says of the whole journal, or that this one is damaged."""
    names = {damage.kind for damage in case.damages}
    if case.shape == "crashed" and _blind(case.damages):
        names = {case.damages[0].kind}
        case = Case(case.shape, case.damages[:1])
    before = expected(case.shape)
    with copied(case.shape):
        for damage in case.damages:
            if Path(NAME).stat().st_size:
                try:
                    KINDS[damage.kind](NAME, *damage.places)
                except sqlite3.Error:  # what came before has left nothing for SQL
                    continue
        noticed = [_noticed(words, whole) for words, whole in zip(COMMANDS, before, strict=True)]
    which = " and ".join(sorted(names)) if len(names) == 1 else "two of these"
    yield f"{which}: {'noticed' if any(noticed) else 'all shown as it was'}"
    yield from {
        f"{words[0]}: {'noticed' if each else 'as it was'}"
        for words, each in zip(COMMANDS, noticed, strict=True)
    }


def _blind(damages: tuple[Damage, ...]) -> bool:
    """Whether the log is damaged and the witness gone or damaged.

    Only the witness knows that the last transaction of a log is missing.
    """
    log = witness = False
    for kind, places in damages:
        if kind == "files beside it gone":
            witness |= "-seen" in _GONE[places[0] % len(_GONE)]
        elif kind == "a bit of the log flipped":
            flipped = _FLIPPED[places[2] % len(_FLIPPED)]
            log, witness = log or flipped == "-wal", witness or flipped == "-seen"
    return log and witness


def _noticed(words: tuple[str, ...], whole: Answer) -> bool:
    """Whether a command tells of damage; AssertionError if it is fooled, or fails otherwise."""
    code, out, err = _answer(*words)
    assert "defect" not in err, (words, out, err)
    assert "Traceback" not in err + out, (words, out, err)
    if (code, out) == whole[:2]:  # it may say besides that it cannot know for certain
        return err != whole[2]
    assert code != 0, (words, out[-500:], err)
    assert NAME in err, (words, out, err)
    if Path(NAME).stat().st_size:  # nobody can know what was in an empty file
        assert whole[2] == err or not any(claim in err for claim in _FALSE), (words, err)
    return True


def text(case: Case) -> str:
    return f"{case.shape}: " + "; ".join(f"{each.kind} {each.places}" for each in case.damages)


PAIR = Pair(
    name="journals",
    about="damaged copies of journals: every command shows what the whole one shows, or refuses",
    cases=cases,
    judge=judge,
    text=text,
    full=5_000,
    batch=50,
    few=8,
    attack=True,
)
