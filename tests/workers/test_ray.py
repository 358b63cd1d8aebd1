"""A real Ray cluster of two machines, of which one is killed while plans are checked."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.errors import UsageError
from gpsfsm.workers import engine_of
from tests.cli.support import ACCEPTED, BROKEN, REJECTED, run, runner, write

if TYPE_CHECKING:
    from collections.abc import Iterator

pytestmark = pytest.mark.ray

REPO = Path(__file__).parents[2]
TIMEOUT_S = 300
PLANS = {
    f"p{number:03}": [ACCEPTED, REJECTED, BROKEN, f"<Plan>{runner() * (3 + number % 9)}</Plan>"][
        number % 4
    ]
    for number in range(81)
}
TASK = "interface: WaypointRunner\nplaces: {A: {x: 1, y: 2}}\nsteps: [{do: A}]\n"


def environment(**changes: str) -> dict[str, str]:
    kept = {name: value for name, value in os.environ.items() if not name.startswith("RAY_")}
    quiet = {"RAY_USAGE_STATS_ENABLED": "0", "PYTHONWARNINGS": "ignore"}
    quiet |= {"RAY_prestart_worker_first_driver": "0"}  # no processes that nobody has asked for
    return {**kept, "PYTHONPATH": str(REPO), **quiet, **changes}


@contextmanager
def started(
    *command: str, cwd: Path, env: dict[str, str], watched: bool
) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen(
        [sys.executable, *command],
        cwd=cwd,
        env=env,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE if watched else subprocess.DEVNULL,
        text=True,
    )
    try:
        yield process
    finally:
        process.communicate(timeout=TIMEOUT_S)


def output(folder: Path, *words: str, env: dict[str, str], tries: int = 3) -> tuple[int, str]:
    done = subprocess.run(
        [sys.executable, "-m", "gpsfsm", *words, "--isolated"],
        cwd=folder,
        env=env,
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        check=False,
    )
    if tries > 1 and "cannot be used" in done.stderr:  # Ray's client gives up early, if all is busy
        return output(folder, *words, env=env, tries=tries - 1)
    assert "cannot be used" not in done.stderr, done.stderr
    return done.returncode, done.stdout


def here(folder: Path, *words: str) -> tuple[int, str]:
    """The same without Ray."""
    done = run(*words, "--isolated", cwd=folder)
    return done.returncode, done.stdout.decode()


def checked_while_a_machine_dies(
    folder: Path, cluster: subprocess.Popen[str], env: dict[str, str]
) -> tuple[str, list[Any]]:
    """What on_ray.py prints if the second machine is killed when it says so."""
    assert cluster.stdin is not None
    assert cluster.stdout is not None
    with started("-m", "tests.workers.on_ray", cwd=folder, env=env, watched=True) as driver:
        assert driver.stdin is not None
        assert driver.stderr is not None
        while (line := driver.stderr.readline()) != "kill\n":
            assert line, "the driver has ended"
        cluster.stdin.write("lose it\n")
        cluster.stdin.flush()
        while (line := cluster.stdout.readline()) != "lost\n":
            assert line, "the cluster has ended"
        report, errors = driver.communicate("go on\n", timeout=TIMEOUT_S)
    return report, json.loads(errors.splitlines()[-1])


@pytest.mark.skipif(importlib.util.find_spec("ray") is None, reason="needs the extra 'ray'")
def test_the_same_bytes_on_ray_even_if_a_machine_dies(tmp_path: Path) -> None:
    write(tmp_path / "plans", **PLANS)
    (tmp_path / "task.yaml").write_text(TASK, encoding="utf-8")
    plain = environment()
    check = ("check", "plans", "missing.xml", "--format", "json")
    grade = ("grade", "--task", "task.yaml", "plans", "--table", "csv")
    checked, graded = here(tmp_path, *check), here(tmp_path, *grade)
    assert (checked[0], graded[0]) == (2, 0)
    assert here(tmp_path, *grade, "--jobs", "2") == graded
    with started(
        "-m", "tests.workers.two_nodes", cwd=tmp_path, env=plain, watched=False
    ) as cluster:
        assert cluster.stdout is not None
        address, remote = json.loads(cluster.stdout.readline())
        env = environment(RAY_ADDRESS=address)
        assert output(tmp_path, *check, "--jobs", remote, env=plain) == checked
        report, (lost, doubled, grades, campaigns) = checked_while_a_machine_dies(
            tmp_path, cluster, env
        )
    assert lost > 0, "no chunk was on the machine that died: the test shows nothing"
    assert report == checked[1]
    killed = "was ended; the memory may have run out"
    assert [line.split(",")[1] for line in graded[1].splitlines()[1:]] == grades
    assert campaigns[0]
    assert campaigns[0] == campaigns[1]
    assert doubled == [*range(0, 24, 2), killed, *range(0, 24, 2)]


@pytest.mark.parametrize("jobs", ["ray", "ray://10.0.0.1:10001"])
def test_without_ray_it_says_what_to_install(jobs: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(UsageError, match=r"pip install 'gpsfsm\[ray\]'"):
        engine_of(jobs, 10)
