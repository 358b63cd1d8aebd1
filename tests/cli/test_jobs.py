"""``--jobs``: the same bytes in any number of processes, and no worker's death goes unseen."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.api import check_options
from gpsfsm.checking import parallel
from gpsfsm.checking.inputs import find_inputs
from gpsfsm.cli import main
from gpsfsm.errors import UsageError
from gpsfsm.model.report import PlanReport, Report, Verdict
from gpsfsm.workers.builtin.processes import Processes
from gpsfsm.workers.pool_worker import Worker, available_cores
from tests.cli.support import ACCEPTED, BROKEN, REJECTED, run, runner, shell, write
from tests.workers.works import killed_with_it_in_hand

if TYPE_CHECKING:
    from gpsfsm.workers.engines import Chunk

PLANS = {
    "a": ACCEPTED,
    "b": REJECTED,
    "c": BROKEN,
    "d": "",
    "e": f"<Plan>{runner() * 60}</Plan>",
    "f": ACCEPTED,
    "g": "prose",
}


@pytest.mark.parametrize(("output_format", "jobs"), [("text", "3"), ("json", "0"), ("sarif", "2")])
def test_output_does_not_depend_on_jobs(output_format: str, jobs: str, tmp_path: Path) -> None:
    write(tmp_path / "plans", **PLANS)
    command = ["check", "plans", "missing.xml", "-", "plans/a.xml", "--format", output_format]
    alone, several = (
        run(*command, "--jobs", each, stdin=REJECTED.encode(), cwd=tmp_path) for each in ("1", jobs)
    )
    assert alone.returncode == several.returncode == 2
    assert alone.stdout == several.stdout
    assert alone.stderr == several.stderr == b""


def test_workers_read_what_only_the_parent_can(tmp_path: Path) -> None:
    write(tmp_path, a=ACCEPTED, b=REJECTED)
    done = shell("$NEW_GPSFSM check a.xml /dev/fd/9 --jobs 2 -q 9< b.xml", tmp_path)
    if not Path("/dev/fd").exists():
        pytest.skip("needs /dev/fd")
    assert done.returncode == 1
    assert b"/dev/fd/9:2:3: error GP307" in done.stdout


def check(paths: list[str], jobs: int) -> list[PlanReport]:
    inputs = list(find_inputs(paths))
    return list(parallel.check_inputs(inputs, check_options(), jobs=jobs))


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs signals")
@pytest.mark.parametrize("moment", ["before it gets the plan", "with the plan in hand"])
@pytest.mark.parametrize("victims", [["d"], ["a", "b", "f"], list("abcdef")])
def test_a_worker_that_is_killed(
    moment: str, victims: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exactly the plans that it had are reported as not decided; the others are checked."""
    paths = [f"{name}.xml" for name in "abcdef"]
    doomed = {f"{name}.xml" for name in victims}
    write(tmp_path, **dict.fromkeys("abcdef", ACCEPTED))
    real = Worker.give

    def give(worker: Worker[Any, Any], chunk: Chunk[Any]) -> None:
        ((path, *_),) = chunk.items
        if path not in doomed:
            real(worker, chunk)
        elif moment == "with the plan in hand":
            killed_with_it_in_hand(worker, chunk)
        else:
            os.kill(worker.child.pid, signal.SIGKILL)
            assert worker.child.exit_code() == -signal.SIGKILL
            real(worker, chunk)

    monkeypatch.setattr(Worker, "give", give)
    reports = check(paths, 2)
    assert [report.path for report in reports] == paths
    for report in reports:
        killed = report.path in doomed
        assert report.verdict is (Verdict.UNDECIDED if killed else Verdict.ACCEPTED)
        assert [finding.rule for finding in report.findings] == ["GP903" if killed else "GP302"]
        if killed:
            assert "was ended by signal 9" in report.findings[0].message
            assert "memory" in report.findings[0].hint
    assert Report(tuple(reports)).exit_code() == 2


def test_misuse_in_a_worker_is_raised(tmp_path: Path) -> None:
    write(tmp_path, a=ACCEPTED, b=ACCEPTED)
    inputs = list(find_inputs(["."]))
    options = check_options(AnalysisOptions(solver="structural", faults=("hang",)))
    for jobs in (1, 2):
        with pytest.raises(UsageError, match="structural"):
            list(parallel.check_inputs(inputs, options, jobs=jobs))


def test_an_unfinished_check_leaves_no_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hired: list[Worker[Any, Any]] = []
    real = Worker.give

    def give(worker: Worker[Any, Any], chunk: Chunk[Any]) -> None:
        hired.append(worker)
        real(worker, chunk)

    monkeypatch.setattr(Worker, "give", give)
    write(tmp_path, **dict.fromkeys("abcdef", ACCEPTED))
    inputs = list(find_inputs(["."]))
    reports = parallel.check_inputs(inputs, check_options(), jobs=2)
    assert next(iter(reports)).path == "a.xml"
    assert any(worker.child.alive for worker in hired)
    reports.close()  # type: ignore[attr-defined]
    assert not any(worker.child.alive for worker in hired)
    assert all(worker.child.exit_code() is not None for worker in hired)


def test_never_more_workers_than_plans(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    hired: list[int] = []
    real = Processes.__init__

    def hire(engine: Processes, size: int, **options: float | None) -> None:
        hired.append(size)
        real(engine, size, **options)

    monkeypatch.setattr(Processes, "__init__", hire)
    write(tmp_path, a=ACCEPTED, b=ACCEPTED)
    assert main(["check", ".", "--jobs", "200"]) == 0
    assert main(["check", "a.xml", "--jobs", "200"]) == 0
    assert hired == [2, 1]  # each check of a process has its time limit


def test_grades_do_not_depend_on_jobs(tmp_path: Path) -> None:
    write(tmp_path / "answers", **PLANS)
    task = "interface: WaypointRunner\nplaces: {A: {x: 1, y: 2}}\nsteps: [{do: A}]\n"
    (tmp_path / "task.yaml").write_text(task, encoding="utf-8")
    command = ["grade", "--task", "task.yaml", "answers", "missing.xml", "--table", "csv"]
    alone, several = (run(*command, "--jobs", jobs, cwd=tmp_path) for jobs in ("1", "2"))
    assert (alone.returncode, alone.stderr) == (2, b"")
    assert alone.stdout.count(b"\r\n") + alone.stdout.count(b"\n") >= len(PLANS) + 2
    assert (several.returncode, several.stdout, several.stderr) == (2, alone.stdout, b"")


def test_jobs_that_there_are_not(capsys: pytest.CaptureFixture[str]) -> None:
    for jobs in ("rax", "ray:1", "2.5"):
        assert main(["check", "a.xml", "--jobs", jobs]) == 2
        assert "write 1 for this process; a number of" in capsys.readouterr().err


def test_available_cores() -> None:
    assert 1 <= available_cores() <= (os.cpu_count() or 1)
