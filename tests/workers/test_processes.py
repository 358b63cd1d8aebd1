"""Real worker processes: what ends one costs one result."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from gpsfsm.errors import UsageError
from gpsfsm.workers import engine_of, run
from gpsfsm.workers.known.processes import Processes
from tests.cli.support import environment
from tests.workers.works import Double


def told(item: int | str, how: str) -> str:
    return f"{item}: the process {how}"


def test_what_ends_a_process_is_alone_without_a_result() -> None:
    items: list[int | str] = [1, "die", 2, 3, "exit", *range(4, 20)]
    found = list(run(engine_of(2), Double(), items, lost=told))
    killed = "die: the process was ended by signal 9; the memory may have run out"
    ended = "exit: the process was ended with code 7; the memory may have run out"
    assert found == [2, killed, 4, 6, ended, *range(8, 40, 2)]


def test_larger_chunks_are_divided() -> None:
    engine = Processes(2)
    engine.chunk_size = 8
    found = list(run(engine, Double(), [*range(11), "die", *range(11)], lost=lambda *_: -1))
    assert found == [*range(0, 22, 2), -1, *range(0, 22, 2)]


def test_what_takes_too_long_is_ended() -> None:
    engine = Processes(2, timeout_s=1.0)
    found = list(run(engine, Double(), [1, "sleep", 2, 3], lost=told))
    assert found == [2, "sleep: the process was ended: it took more than 1 s", 4, 6]


def test_misuse_is_raised_and_ends_all() -> None:
    engine = Processes(2)
    with pytest.raises(UsageError, match="makes no sense"):
        list(run(engine, Double(), [1, "sleep", "misuse", 4], lost=told))
    assert not engine._busy
    assert not engine._idle


class Unknown:
    """Nobody else can import it, once it says that it is of another module."""

    def __call__(self, item: int) -> int:
        return item


def test_work_that_workers_cannot_import(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Unknown, "__module__", "__main__")
    monkeypatch.setattr(sys.modules["__main__"], "Unknown", Unknown, raising=False)
    with pytest.raises(UsageError, match=r"workers cannot import what they are to do: .*Unknown"):
        list(run(engine_of(2), Unknown(), range(5), lost=told))


def test_a_program_without_a_guard_is_not_run_again(tmp_path: Path) -> None:
    """With multiprocessing, workers would import the program, and begin workers in turn."""
    program = tmp_path / "program.py"
    program.write_text(
        "from gpsfsm.workers import engine_of, run\n"
        "from tests.workers.works import Double\n"
        "print(*run(engine_of(2), Double(), range(4), lost=lambda *_: -1))\n"
    )
    (tmp_path / "json.py").write_text("raise SystemExit('a file of the folder was imported')")
    env = environment(PYTHONPATH=str(Path(__file__).parents[2]))
    command = [sys.executable, "-P", str(program)]
    done = subprocess.run(
        command, cwd=tmp_path, env=env, capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "0 2 4 6\n", "")
