"""A disk that fills up during a run: what is not journaled is not run, and never silently."""

from __future__ import annotations

import shutil
import subprocess
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest

from gpsfsm.cli import main
from gpsfsm.errors import InputError
from gpsfsm.execution.journal_errors import JournalFullError, ReplayDivergence
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.queue_rows import QueueKind, QueueRow
from gpsfsm.execution.records import Status
from gpsfsm.running import session
from gpsfsm.running.interruption import Interruption
from gpsfsm.running.terminal import Show, Terminal, worst
from tests.cli.limited_run import limited
from tests.cli.support import runner, write
from tests.execution.queueing import SLEEP, Bench

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from gpsfsm.compile import Compiled
    from gpsfsm.execution.queue import PlanState
    from gpsfsm.execution.records import RunValue
    from gpsfsm.execution.virtual import VirtualDriver

WAIT = "generic_capabilities/WaitRunner"
WAITS = f'<Runner interface="{WAIT}" provider="{WAIT}" seconds="0.001"/>\n'
PLAN = f"<Plan>\n{WAITS * 6}</Plan>\n"
OTHER = f"<Plan>\n{WAITS * 2}</Plan>\n"
KINDS = {
    "drawn": ("a.xml", "--failure", "0"),
    "several": ("a.xml", "b.xml", "--failure", "0"),
    "real": ("a.xml", "--real"),
}


def judge(folder: Path, kind: str, done: subprocess.CompletedProcess[bytes], ended: int) -> str:
    """Nothing but two outcomes: everything is run and kept, or the journal is named with code 2.

    Once there is room, what was kept goes on to the same end. Says how far it came at first.
    """
    real = ["--real"] if kind == "real" else []
    out, err = done.stdout.decode(), done.stderr.decode()
    journal = str(folder / "run.db")
    if done.returncode == 0:
        assert out.count("COMPLETED") == ended
        how = "whole"
    else:
        assert done.returncode == 2, (done.returncode, err)
        assert "run.db: the journal cannot be written" in err
        assert "is the disk full?" in err
        if "resume the run" in err:
            how = "resumed"
            assert main(["resume", journal, *real]) == 0
        else:
            how = "again"
            assert "Nothing of the plan has been run" in err
            assert "started" not in out
            arguments = KINDS[kind]
            paths = [str(folder / word) if word.endswith(".xml") else word for word in arguments]
            assert main(["run", *paths, "--journal", journal]) == 0
    with JournalReader(journal) as reader:
        runs = reader.runs()
        assert [run.status for run in runs] == [Status.COMPLETED] * ended
        for run in runs:
            reader.verify(run.number)
        reader.verify_queue()
        succeeded = [row for run in runs for row in reader.events(run.number) if "SUCCEEDED" in row]
        assert len(succeeded) == (8 if ended == 2 else 6)
    return how


@pytest.mark.parametrize("kind", [*KINDS])
def test_a_limit_of_any_size(kind: str, tmp_path: Path) -> None:
    hows = set()
    for kilobytes in (0, 24, 36, 44, 60, 84, 100, 108, 124, 156, 400):
        folder = tmp_path / str(kilobytes)
        folder.mkdir()
        write(folder, a=PLAN, b=OTHER)
        done = limited(kilobytes * 1024, "run", *KINDS[kind], "--journal", "run.db", cwd=folder)
        hows.add(judge(folder, kind, done, 2 if kind == "several" else 1))
    assert hows == {"whole", "resumed", "again"}


@contextmanager
def small_disk(folder: Path, kilobytes: int) -> Iterator[None]:
    mount = shutil.which("mount")
    if mount is None:
        pytest.skip("there is no program mount")
    folder.mkdir()
    made = subprocess.run(
        [mount, "-t", "tmpfs", "-o", f"size={kilobytes}k", "none", str(folder)],
        capture_output=True,
        text=True,
        check=False,
    )
    if made.returncode:
        pytest.skip(f"no disk can be mounted here: {made.stderr.strip()[:80]}")
    try:
        yield
    finally:
        subprocess.run(["umount", str(folder)], check=True)


@pytest.mark.parametrize("kind", ["drawn", "real"])
def test_a_small_disk(kind: str, tmp_path: Path) -> None:
    hows = set()
    for kilobytes in (60, 120, 150, 180, 210, 600):
        folder = tmp_path / str(kilobytes)
        with small_disk(folder, kilobytes):
            write(folder, a=PLAN)
            done = limited(1 << 30, "run", *KINDS[kind], "--journal", "run.db", cwd=folder)
            room = tmp_path / f"room{kilobytes}"
            shutil.copytree(folder, room)
        hows.add(judge(room, kind, done, 1))
    assert {"whole", "again"} <= hows


def test_a_queue_does_not_refuse_a_plan_because_of_its_journal() -> None:
    for error, refused in ((JournalFullError("full"), False), (ReplayDivergence(1, "", ""), True)):
        bench = Bench()
        _failing(bench, error)
        bench.queue.submit(SLEEP)
        if refused:
            bench.queue.run_all()
            assert bench.statuses() == ["REFUSED"]
            continue
        with pytest.raises(JournalFullError):
            bench.queue.run_all()
        assert "REFUSED" not in bench.statuses()
        assert ("ENDED", 1) not in bench.log.events()


def _failing(bench: Bench, error: Exception) -> None:
    def fail(_state: PlanState, _compiled: Compiled) -> VirtualDriver:
        raise error

    bench.queue._make = fail


# -- plans that never began -------------------------------------------------------------------


def test_no_codes_are_not_success() -> None:
    assert worst(()) == 2
    assert worst((0,)) == 0
    assert worst((0, 130, 2, 1)) == 130


@pytest.mark.parametrize(
    ("status", "cancelled", "code", "said"),
    [
        ("REFUSED", False, 2, "gpsfsm: plan 2 is not run: no room\n"),
        ("CANCELLED", False, 1, "gpsfsm: plan 2 is not run: it was cancelled before it began\n"),
        ("CANCELLED", True, 130, ""),
    ],
)
def test_a_plan_that_never_began_has_a_code(
    status: str, cancelled: bool, code: int, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    interruption = Interruption()
    interruption.requested = cancelled
    terminal = Terminal(Show("plain"), interruption)
    terminal.codes[1] = 0
    for plan in (1, 2):
        data: dict[str, RunValue] = {"status": status}
        terminal.wrote(QueueRow(QueueKind.ENDED, plan, data=data, message="no room"))
    assert terminal.codes == {1: 0, 2: code}
    assert capsys.readouterr().err == said


@pytest.mark.parametrize("real", [False, True])
def test_a_plan_that_cannot_be_begun_is_told(
    real: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: object, **__: object) -> Callable[[], None]:
        raise InputError("its world is gone")

    monkeypatch.setattr(session, "real_driver" if real else "simulated_driver", fail)
    write(tmp_path, a=PLAN if real else f"<Plan>{runner()}</Plan>")
    assert main(["run", str(tmp_path / "a.xml"), *(["--real"] if real else [])]) == 2
    out, err = capsys.readouterr()
    assert (out, err.splitlines()[-1]) == ("", "gpsfsm: plan 1 is not run: its world is gone")
