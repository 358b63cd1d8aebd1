"""Real worker processes: what ends one costs one result."""

from __future__ import annotations

import pickle
import subprocess
import sys
import time
from pathlib import Path

import pytest

from gpsfsm.errors import UsageError
from gpsfsm.gating import GateOptions, gate_process
from gpsfsm.service import worker as service_worker
from gpsfsm.workers import engine_of, map_items, pool_worker
from gpsfsm.workers.builtin.processes import Processes
from gpsfsm.workers.codec import encode
from gpsfsm.workers.pool_worker import _misuse
from tests.cli.support import environment
from tests.lsp.test_robust import alive
from tests.workers.works import Double, Hostile


def described(item: int | str, how: str) -> str:
    return f"{item}: the process {how}"


def test_what_ends_a_process_is_alone_without_a_result() -> None:
    items: list[int | str] = [1, "die", 2, 3, "exit", *range(4, 20)]
    actual = list(map_items(engine_of(2), Double(), items, lost=described))
    killed = "die: the process was ended by signal 9; the memory may have run out"
    ended = "exit: the process was ended with code 7; the memory may have run out"
    assert actual == [2, killed, 4, 6, ended, *range(8, 40, 2)]


def test_larger_chunks_are_divided() -> None:
    engine = Processes(2)
    engine.chunk_size = 8
    actual = list(map_items(engine, Double(), [*range(11), "die", *range(11)], lost=lambda *_: -1))
    assert actual == [*range(0, 22, 2), -1, *range(0, 22, 2)]


def test_what_takes_too_long_is_ended() -> None:
    engine = Processes(2, timeout_s=1.0)
    actual = list(map_items(engine, Double(), [1, "sleep", 2, 3], lost=described))
    assert actual == [2, "sleep: the process was ended: it took more than 1 s", 4, 6]


def test_misuse_is_raised_and_ends_all() -> None:
    engine = Processes(2)
    with pytest.raises(UsageError, match="makes no sense"):
        list(map_items(engine, Double(), [1, "sleep", "misuse", 4], lost=described))
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
        list(map_items(engine_of(2), Unknown(), range(5), lost=described))


def test_a_program_without_a_guard_is_not_run_again(tmp_path: Path) -> None:
    """With multiprocessing, workers would import the program, and begin workers in turn."""
    program = tmp_path / "program.py"
    program.write_text(
        "from gpsfsm.workers import engine_of, map_items\n"
        "from tests.workers.works import Double\n"
        "print(*map_items(engine_of(2), Double(), range(4), lost=lambda *_: -1))\n"
    )
    (tmp_path / "json.py").write_text("raise SystemExit('a file of the folder was imported')")
    env = environment(PYTHONPATH=str(Path(__file__).parents[2]))
    command = [sys.executable, "-P", str(program)]
    done = subprocess.run(
        command, cwd=tmp_path, env=env, capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "0 2 4 6\n", "")


def test_nothing_but_results_comes_back() -> None:
    actual = list(map_items(engine_of(2), Hostile(), range(8), lost=described))
    nonsense = "the process was ended: its answer was not a result"
    assert actual == [0, *(f"{each}: {nonsense}" for each in range(1, 6)), 6, 7]


def test_work_may_be_defined_in_the_working_folder() -> None:
    """As in the example of docs/scale.md."""
    code = "import lengths; print(lengths.lengths(['a', 'bb', 'ccc'], jobs=2))"
    root = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=root / "docs" / "examples",
        env=environment(PYTHONPATH=str(root)),
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "[1, 2, 3]\n", "")


@pytest.mark.parametrize("name", ["AssumptionError", "ConfigError", "UsageError", "SystemExit", 1])
def test_what_a_worker_says_of_misuse_is_text(name: object) -> None:
    """Also if it was taken over: then it may have sent anything."""
    error = _misuse({"misuse": name, "text": ["a"], "hint": {}, "where": 1, "self": None})
    assert isinstance(error, UsageError)
    assert str(error) == "['a']"


def test_a_bound_that_the_system_refuses_is_for_each_to_judge(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A gate and a pool work without it, a service does not begin."""

    def refused(_megabytes: int) -> None:
        raise ValueError("not on this system")

    for module in (pool_worker, gate_process, service_worker):
        monkeypatch.setattr(module, "limit_memory", refused)
    head = {"memory_mb": 1_024}
    assert pool_worker._prepare(head, pickle.dumps(Double()))({}, pickle.dumps((2,)))[1] == b"[4]"
    assert gate_process._prepare(head, encode(GateOptions()))({"name": ""}, b"<Plan/>")
    with pytest.raises(ValueError, match="not on this system"):
        service_worker._prepare(head, b"")


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="finds processes in /proc")
def test_workers_end_when_their_parent_is_killed(tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    program.write_text(
        "from gpsfsm.workers.pool_worker import Worker\n"
        "from gpsfsm.workers import Chunk\n"
        "from tests.workers.works import Double\n"
        "workers = [Worker(Double()) for _ in range(2)]\n"
        "assert [each.take(each.child.next_answer(60)) for each in workers] == [None, None]\n"
        "workers[0].give(Chunk((0,), ('sleep',)))\n"
        "print(*(each.child.pid for each in workers), flush=True)\n"
        "import time; time.sleep(600)\n"
    )
    env = environment(PYTHONPATH=str(Path(__file__).parents[2]))
    with subprocess.Popen(
        [sys.executable, "-P", str(program)], env=env, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        workers = [int(each) for each in process.stdout.readline().split()]
        assert len(alive(workers)) == 2
        process.kill()
    until = time.monotonic() + 30
    while alive(workers) and time.monotonic() < until:
        time.sleep(0.02)
    assert alive(workers) == []
