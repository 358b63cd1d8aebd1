"""Full disks: no command ends well unless all it was to write is there, and none leaves half.

A command is played twice on the same files: with room, and with a limit on the length of files or
with streams that take nothing. Then there is room again.
"""

from __future__ import annotations

import atexit
import io
import json
import shutil
import tempfile
from contextlib import chdir, redirect_stderr, redirect_stdout
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from hypothesis import strategies as st

from gpsfsm.cli import main
from gpsfsm.execution.journal_errors import EmptyJournalError, JournalError
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.journal_rows import line
from tests.campaigns.base import Pair
from tests.cli.limited_run import FULL, limited
from tests.cli.support import runner, write
from tests.execution.journaling import cut, forge

if TYPE_CHECKING:
    import subprocess
    from collections.abc import Iterator

ROOM = 1 << 40
WAIT = "generic_capabilities/WaitRunner"
LOG = "generic_capabilities/LogRunner"
ACTS = (
    f'<Runner interface="{WAIT}" provider="{WAIT}" seconds="0.001"/>',
    f'<Runner interface="{LOG}" provider="{LOG}" text="{"all is well " * 40}"/>',
)
DRAWN = (*ACTS, runner(), runner(x="7", y="3"))
TASK = """task: go
interface: WaypointRunner
places:
  there: {x: 1, y: 2}
steps:
  - do: there
"""


class Command(NamedTuple):
    """One command line. ``journal`` is what it writes beside ``files``, which are written whole."""

    line: str
    files: tuple[str, ...] = ()
    journal: str = ""


COMMANDS = {
    "run": Command("run a.xml --failure 0.2 --format json --journal j.db", journal="j.db"),
    "two plans": Command("run a.xml b.xml --failure 0 --journal j.db", journal="j.db"),
    "real": Command("run b.xml --real --format json --journal j.db", journal="j.db"),
    "real, in a word": Command("run b.xml --real --journal j.db", journal="j.db"),
    "no journal": Command("run a.xml --failure 0"),
    "more": Command("run b.xml --failure 0 --journal past.db", journal="past.db"),
    "resume": Command("resume left.db --format json", journal="left.db"),
    "resume real": Command("resume acted.db --real --format json", journal="acted.db"),
    "replay": Command("replay past.db"),
    "events": Command("events past.db --format jsonl --output-file o.jsonl", ("o.jsonl",)),
    "timeline": Command("events past.db --format svg --output-file o.svg", ("o.svg",)),
    "generate": Command(
        "generate go --model replay:answers.jsonl --journal j.db -o o.xml", ("o.xml",), "j.db"
    ),
    "check": Command("check a.xml c.xml --format sarif --output-file o.json", ("o.json",)),
    "check and fix": Command("check c.xml --fix --unsafe-fixes", ("c.xml",)),
    "fix": Command("fix a.xml c.xml --unsafe-fixes", ("a.xml", "c.xml")),
    "gate": Command(
        "gate a.xml --report sarif=o.json --report junit=o.xml --summary kept.md",
        ("o.json", "o.xml", "kept.md"),
    ),
    "grade": Command("grade a.xml --task task.yaml --table csv -o o.csv", ("o.csv",)),
    "fuzz": Command("fuzz a.xml --runs 5 --format json -o o.json --corpus cases", ("o.json",)),
    "view": Command("view a.xml -o o.html", ("o.html",)),
    "show": Command("show a.xml --format svg --output-file o.svg", ("o.svg",)),
}


class Case(NamedTuple):
    """A command, plans of steps of these kinds, and what is full."""

    command: str
    drawn: tuple[int, ...]
    acting: tuple[int, ...]
    last: int
    most: int
    full: str


def cases() -> st.SearchStrategy[Case]:
    limits = st.sampled_from([ROOM]) | st.integers(0, 60) | st.integers(61, 400)
    return st.builds(
        Case,
        st.sampled_from(sorted(COMMANDS)),
        st.lists(st.integers(0, len(DRAWN) - 1), min_size=1, max_size=6).map(tuple),
        st.lists(st.integers(0, len(ACTS) - 1), min_size=1, max_size=6).map(tuple),
        st.integers(0, 1000),
        limits.map(lambda actual: actual if actual == ROOM else actual * 1024),
        st.sampled_from(["", "", "", "out", "err", "out err"]),
    )


def judge(case: Case) -> Iterator[str]:
    command, words = COMMANDS[case.command], COMMANDS[case.command].line.split()
    with tempfile.TemporaryDirectory() as made:
        here, there = Path(made, "here"), Path(made, "there")
        _prepare(case, here)
        before = _files(here, command)
        shutil.copytree(here, there)
        whole = limited(ROOM, *words, cwd=there)
        assert whole.returncode in (0, 1), whole.stderr
        done = limited(case.most, *words, cwd=here, full=case.full)
        assert done.returncode in (whole.returncode, 2), (done.returncode, done.stderr)
        after, wanted = _files(here, command), _files(there, command)
        for name, content in after.items():
            assert content in (before[name], wanted[name]), f"half of {name}"
        assert not [each.name for each in here.rglob("*") if each.suffix in (".tmp", ".part")]
        for kept in sorted(here.glob("cases/*")):
            json.loads(kept.read_text(encoding="utf-8"))
        if command.journal:
            _judge_journal(case, here, done)
        if done.returncode == 2:
            assert done.stderr or "err" in case.full
            yield f"{case.command}: told"
        else:
            assert after == wanted
            assert "out" not in case.full or not whole.stdout
            assert "err" not in case.full or not whole.stderr
            if "real" not in case.command and "out" not in case.full:
                assert done.stdout == whole.stdout
            yield f"{case.command}: done"
        yield from _with_room(case, here, whole.returncode)


def _prepare(case: Case, folder: Path) -> None:
    acts = "\n".join(ACTS[number] for number in case.acting)
    drawn = "\n".join(DRAWN[number] for number in case.drawn)
    aside = f'<Control type="recovery">{drawn}</Control>' if case.last % 2 else drawn
    write(folder, a=f"<Plan>{aside}</Plan>", b=f"<Plan>{acts}</Plan>")
    write(folder, c=f'<Plan><Control type="sequential"></Control>\n{drawn}</Plan>')
    (folder / "task.yaml").write_text(TASK, encoding="utf-8")
    (folder / "kept.md").write_text("kept\n", encoding="utf-8")
    answer = {"answer": f"<Plan>{ACTS[0]}</Plan>"}
    (folder / "answers.jsonl").write_text(json.dumps(answer) + "\n", encoding="utf-8")
    past = _past()
    shutil.copy(past / "past.db", folder / "past.db")
    for name, source in (("left", "past"), ("acted", "acted")):
        with JournalReader(str(past / f"{source}.db")) as reader:
            ends = [row.seq - 1 for row in reader.events(1) if row.input]
        _cut(past / f"{source}.db", folder / f"{name}.db", ends[case.last % len(ends)])


def _cut(source: Path, target: Path, last: int) -> None:
    """A journal whose run has come to an event, as a killed process leaves it."""
    cut(source, target, last)
    forge(target, "DELETE FROM queue WHERE kind = 'ENDED'")


@cache
def _past() -> Path:
    """Journals of runs that have ended."""
    folder = Path(tempfile.mkdtemp(prefix="gpsfsm-disks-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    write(folder, a=f"<Plan>{''.join(DRAWN)}</Plan>", b=f"<Plan>{''.join(ACTS * 2)}</Plan>")
    for words in ("a.xml --failure 0 --journal past.db", "b.xml --real --journal acted.db"):
        assert _quietly(folder, "run", *words.split()) == 0
    return folder


def _quietly(folder: Path, *words: str) -> int:
    with (
        chdir(folder),
        redirect_stdout(io.TextIOWrapper(io.BytesIO())),
        redirect_stderr(io.StringIO()),
    ):
        return main(words)


def _files(folder: Path, command: Command) -> dict[str, bytes | None]:
    """What is in the files that the command writes; None for one that is not there."""
    paths = {name: folder / name for name in command.files}
    return {name: path.read_bytes() if path.exists() else None for name, path in paths.items()}


def _judge_journal(case: Case, folder: Path, done: subprocess.CompletedProcess[bytes]) -> None:
    """What was told is in the journal, and all of that is as it was written."""
    lines = [each for each in done.stdout.decode().splitlines() if each.startswith('{"seq"')]
    path = folder / COMMANDS[case.command].journal
    try:
        with JournalReader(str(path)) as reader:
            runs = reader.runs()
            for run in runs:
                reader.verify(run.number)
            reader.verify_queue()
            kept = [line(row) for run in runs for row in reader.events(run.number)]
    except EmptyJournalError:
        runs, kept = (), []
    except JournalError:
        assert not path.exists(), "a journal that cannot be read"
        runs, kept = (), []
    assert set(lines) <= set(kept), "told, and not journaled"
    refused = b"the plan has errors, so it is not run" in done.stderr
    if done.returncode != 2 and case.command != "generate":
        assert runs or (refused and done.returncode == 1)
        assert all(run.status.ended for run in runs), "success, and a run has not ended"


def _with_room(case: Case, folder: Path, code: int) -> Iterator[str]:
    """Whatever a run has left behind, it goes on once there is room, or begins anew."""
    command = COMMANDS[case.command]
    if not command.journal or case.command == "generate":
        return
    words = ["--real"] if "real" in case.command else []
    try:
        with JournalReader(str(folder / command.journal)) as reader:
            begun = reader.has_runs() and not all(run.status.ended for run in reader.runs())
    except JournalError:
        begun = False
    if begun:
        assert _quietly(folder, "resume", command.journal, *words) == code
        yield "resumed"
    else:
        again = (
            command.line
            if command.line.startswith("run")
            else f"run b.xml --journal {command.journal}"
        )
        assert _quietly(folder, *again.split()) in (0, 1)
        yield "run again"


def _text(case: Case) -> str:
    return (
        f"{COMMANDS[case.command].line} ({case.most} bytes; full: {case.full or 'nothing'}) {case}"
    )


def _missing() -> str:
    return "" if Path(FULL).exists() else f"there is no {FULL}"


PAIR = Pair(
    name="disks",
    about="commands whose disk or streams are full",
    cases=cases,
    judge=judge,
    text=_text,
    full=2_000,
    batch=20,
    few=5,
    attack=True,
    missing=_missing,
)
