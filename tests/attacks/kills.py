"""Killed runs whose files are lost: nobody is told less than what had been acknowledged.

A real process of ``gpsfsm run --journal`` is killed with SIGKILL once it has told of some events.
Then files of its journal are lost, as when one is copied alone, and ``events`` and ``resume`` see
what is left: all that was acknowledged, or a message that something is missing.
"""

from __future__ import annotations

import atexit
import os
import shutil
import tempfile
import time
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from hypothesis import strategies as st

from tests.campaigns.base import Pair
from tests.cli.support import run, runner, start

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

NAME = "j.db"
WORDS = ("run", "a.xml", "--failure", "0", "--seed", "5", "--format", "json")
DURABILITY = ("power", "process", "none")


class Case(NamedTuple):
    """When the process is killed, after so many lines and some time; and what is lost then."""

    durability: str
    lines: int
    delay_us: int
    lost: str
    place: int


@cache
def _folder() -> Path:
    folder = Path(tempfile.mkdtemp(prefix="gpsfsm-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    units = "".join(f"{runner(x=str(number % 7))}\n" for number in range(60))
    (folder / "a.xml").write_text(f"<Plan>\n{units}</Plan>\n", encoding="utf-8")
    return folder


@cache
def whole() -> bytes:
    """What a run tells that nobody kills: its heading and its events."""
    done = run(*WORDS, cwd=_folder())
    assert done.returncode == 0, done.stderr
    return done.stdout


def _gone(*endings: str) -> Callable[[Path, int], None]:
    def lose(path: Path, _: int) -> None:
        for ending in endings:
            path.with_name(path.name + ending).unlink(missing_ok=True)

    return lose


def _cut_off(path: Path, place: int) -> None:
    log = path.with_name(f"{path.name}-wal")
    if log.exists():
        os.truncate(log, place % (log.stat().st_size + 1))


def _empty(path: Path, _: int) -> None:
    _gone("-seen")(path, 0)
    log = path.with_name(f"{path.name}-wal")
    if log.exists():
        os.truncate(log, 0)


LOSSES: dict[str, Callable[[Path, int], None]] = {
    "nothing lost": lambda *_: None,
    "the lock and the index lost": _gone("-lock", "-shm"),
    "the witness lost": _gone("-seen", "-shm"),
    "the log lost": _gone("-wal", "-shm"),
    "all but the file lost": _gone("-wal", "-shm", "-seen", "-lock"),
    "the log cut off": _cut_off,
    "the log empty, the witness lost": _empty,
}
_WHOLE = ("nothing lost", "the lock and the index lost", "the witness lost")


def cases() -> st.SearchStrategy[Case]:
    return st.builds(
        Case,
        st.sampled_from(DURABILITY),
        st.integers(0, 200),
        st.integers(0, 30_000),
        st.sampled_from([*LOSSES]),
        st.integers(0, 2**24),
    )


def judge(case: Case) -> Iterator[str]:
    """What was acknowledged is there, or it is said that something is missing."""
    expected = whole()
    with tempfile.TemporaryDirectory(dir=_folder()) as name:
        folder = Path(name)
        shutil.copy(_folder() / "a.xml", folder)
        lines, ended = _killed(case, folder)
        if ended:
            yield "ended before it was killed"
            return
        LOSSES[case.lost](folder / NAME, case.place)
        before = (folder / NAME).read_bytes() if (folder / NAME).exists() else b""
        shown = run("events", NAME, "--format", "jsonl", cwd=folder)
        count = shown.stdout.count(b"\n")
        assert expected.startswith(shown.stdout), "it shows what did not happen"
        missing = count < lines
        message = shown.stderr.decode()
        assert "defect" not in message
        if missing:
            assert shown.returncode == 2, f"{lines} lines were acknowledged, {count} are shown"
            assert "missing" in message or "incomplete" in message or not before, message
        resumed = run("resume", NAME, "--durability", "none", cwd=folder)
        said = resumed.stderr.decode()
        assert "defect" not in said
        if shown.returncode == 0:
            assert resumed.returncode == 0, said
            after = run("events", NAME, "--format", "jsonl", cwd=folder)
            assert after.stdout == expected, "it does not end as if nothing had been"
        else:
            assert resumed.returncode == 2, resumed.stdout
            assert not lines or "run it again" not in said, said
            assert not before or (folder / NAME).read_bytes() == before, "it was written to"
        if case.lost in _WHOLE and lines:
            assert shown.returncode == 0, message
        yield f"{case.lost}: {'gone on with' if shown.returncode == 0 else 'refused'}"
        yield f"{case.durability}: {'some missing' if missing else 'all there'}"


def _killed(case: Case, folder: Path) -> tuple[int, bool]:
    """How many lines a process had told when it was killed, and whether it had ended before."""
    words = ("--journal", NAME, "--durability", case.durability, "--speed", "5000")
    with start(*WORDS, *words, cwd=folder) as process:
        assert process.stdout is not None
        lines = 0
        while lines < case.lines and process.stdout.readline():
            lines += 1
        time.sleep(case.delay_us / 1_000_000)
        process.kill()
        rest, _ = process.communicate(timeout=60)
    return lines + rest.count(b"\n"), process.returncode == 0


def text(case: Case) -> str:
    return (
        f"{case.durability}: killed {case.delay_us} µs after {case.lines} lines; {case.lost} "
        f"({case.place})"
    )


PAIR = Pair(
    name="kills",
    about="runs that are killed and lose files: all that was acknowledged is there, or missed",
    cases=cases,
    judge=judge,
    text=text,
    full=2_000,
    batch=25,
    few=6,
    attack=True,
)
