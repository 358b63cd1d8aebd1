"""Workers and the line to them, without HTTP."""

from __future__ import annotations

import asyncio
import json
import subprocess
import sys
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.capabilities.library import builtin_capabilities
from gpsfsm.errors import UsageError
from gpsfsm.service.clients import Share
from gpsfsm.service.pool import Pool
from gpsfsm.service.registry import all_endpoints, endpoint
from gpsfsm.service.settings import Settings, plan_limits
from gpsfsm.service.shapes import Problem
from gpsfsm.service.worker import WorkerContext, do
from gpsfsm.workers import frames
from gpsfsm.workers.child_process import child_command
from tests.service.support import lay_traps, slow_plan

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (UsageError("it makes no sense"), 422),
        (MemoryError(), 503),
        (RuntimeError("oh"), 500),
        (RecursionError(), 500),
        (Problem(429, "later", retry_s=3), 429),
    ],
)
def test_whatever_happens_is_answered(
    capsys: pytest.CaptureFixture[str], error: Exception, status: int
) -> None:
    def work(_request: object, _plan: bytes, _context: object) -> Any:
        raise error

    broken = replace(endpoint("gate"), work=work)
    context = WorkerContext(builtin_capabilities(), plan_limits())
    judgement, body = do(broken, raw=False, body=b'{"plan": ""}', context=context)
    assert judgement == status
    assert json.loads(body)["status"] == status
    written = capsys.readouterr().err
    assert ("test_worker.py" in written) is (status == 500), "a defect is logged with its place"
    assert "oh" not in written


def test_memory_has_an_end() -> None:
    code = (
        "from gpsfsm.workers import limit_memory\n"
        "limit_memory(300)\n"
        "try:\n"
        "    bytearray(1 << 29)\n"
        "except MemoryError:\n"
        "    print('none left')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True
    )
    assert done.stdout == "none left\n"


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux bounds the memory of a process")
@pytest.mark.parametrize("megabytes", [20, 60])
def test_a_plan_that_takes_too_much_memory(megabytes: int) -> None:
    """It is told as such, by the check or by whoever sees the worker end, and nobody else is."""

    async def work() -> tuple[int, str, int]:
        limits = plan_limits(max_bytes=1 << 28)
        pool = Pool(Settings(workers=1, memory_mb=256, request_s=300, limits=limits))
        await pool.start()
        plan = f'<Plan><!--{"x" * megabytes * 1_000_000}--><Runner interface="a/B"/></Plan>'
        body = json.dumps({"plan": plan}).encode()
        try:
            status, messages = 0, ""
            try:
                answered = await pool.do("gate", body)
                status, messages = answered.status, answered.body.decode()
            except Problem as problem:
                status, messages = problem.status, problem.body().decode()
            again = await pool.do("gate", b'{"plan": "<Plan/>"}')
        finally:
            await pool.close()
        return status, messages, again.status

    status, message, again = asyncio.run(work())
    document = json.loads(message)
    if status == 200:
        assert (document["verdict"], document["reason"]) == ("undecided", "inconclusive")
        assert "memory ran out" in document["message"]
    else:
        assert status == 503
        assert "memory" in document["detail"]
    assert again == 200


def test_a_worker_ends_with_the_service() -> None:
    """Also in the middle of its work: standard input ends when the service has gone."""
    head = {
        "memory_mb": 512,
        "capabilities": [],
        "builtin": True,
        "limits": {},
    }
    process = subprocess.Popen(
        child_command("gpsfsm.service.worker:main"),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    with process.stdout:
        process.stdin.write(frames.pack(head))
        process.stdin.flush()
        assert frames.read(process.stdout) == ({"ready": True}, b"")
        body = json.dumps({"plan": slow_plan(), "options": {"consistent": True}}).encode()
        process.stdin.write(frames.pack({"op": "gate", "raw": False}, body))
        process.stdin.close()
        assert process.wait(30) == 0


def test_requests_wait_in_line_and_no_more_than_allowed(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Also in a folder with files that have the names of modules."""
    lay_traps(tmp_path)
    monkeypatch.chdir(tmp_path)

    async def work() -> tuple[list[int], int]:
        pool = Pool(Settings(workers=1, waiting=3))
        await pool.start()
        body = b'{"plan": "<Plan/>"}'
        try:
            answers = await asyncio.gather(
                *(pool.do("gate", body) for _ in range(10)), return_exceptions=True
            )
            again = (await pool.do("gate", body)).status
        finally:
            await pool.close()
        refused = [each for each in answers if isinstance(each, Problem)]
        assert all(each.headers["retry-after"] == "1" for each in refused)
        return [each.status for each in answers if not isinstance(each, BaseException)], again

    served, again = asyncio.run(work())
    assert served == [200] * 4  # one is worked on, three wait
    assert again == 200


def test_every_endpoint_is_answered_by_somebody() -> None:
    for each in all_endpoints():
        assert (each.work is None) != (each.handle is None)
        assert each.answer is not None or each.media
        assert each.path.startswith("/")


def test_bodies_have_a_budget() -> None:
    budget = Share(10)
    assert budget.take("a", 8)
    assert not budget.take("a", 3)
    assert not budget.take("b", 3)
    budget.give_back("a", 8)
    assert budget.take("a", 10)
    assert budget.used == 10
