"""Workers and the line to them, without HTTP."""

from __future__ import annotations

import asyncio
import io
import json
import subprocess
import sys
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gpsfsm.capabilities.library import builtin_capabilities
from gpsfsm.errors import UsageError
from gpsfsm.service import frames
from gpsfsm.service.bodies import Budget
from gpsfsm.service.kitchen import Kitchen
from gpsfsm.service.pool import Pool
from gpsfsm.service.problems import Problem
from gpsfsm.service.registry import all_endpoints, endpoint
from gpsfsm.service.settings import Settings, plan_limits
from gpsfsm.service.worker import do
from tests.service.support import lay_traps, slow_plan

if TYPE_CHECKING:
    from pathlib import Path

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=6,
)
MESSAGES = st.lists(
    st.tuples(st.dictionaries(st.text(max_size=5), JSON, max_size=3), st.binary()), max_size=4
)


@settings(max_examples=50)
@given(MESSAGES)
def test_messages_arrive_as_they_were_sent(sent: list[tuple[dict[str, Any], bytes]]) -> None:
    whole = b"".join(frames.pack(head, body) for head, body in sent)
    stream = io.BytesIO(whole)
    assert [frames.read(stream) for _ in sent] == sent
    with pytest.raises(EOFError):
        frames.read(stream)

    async def hear() -> list[tuple[dict[str, Any], bytes]]:
        reader = asyncio.StreamReader()
        reader.feed_data(whole)
        reader.feed_eof()
        found = [await frames.receive(reader) for _ in sent]
        with pytest.raises(EOFError):
            await frames.receive(reader)
        return found

    assert asyncio.run(hear()) == sent


@given(st.binary(max_size=40))
def test_what_is_no_message_is_told_at_once(content: bytes) -> None:
    stream = io.BytesIO(content)
    for _ in content:
        try:
            frames.read(stream)
        except (EOFError, ValueError):
            return
    assert not content  # there is always an end


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
def test_whatever_happens_is_answered(error: Exception, status: int) -> None:
    def work(_request: object, _plan: bytes, _kitchen: object) -> Any:
        raise error

    broken = replace(endpoint("gate"), work=work)
    kitchen = Kitchen(builtin_capabilities(), plan_limits())
    found, body = do(broken, raw=False, body=b'{"plan": ""}', kitchen=kitchen)
    assert found == status
    assert json.loads(body)["status"] == status


def test_memory_has_an_end() -> None:
    code = (
        "from gpsfsm.workers.memory import limit_memory\n"
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


def test_a_worker_ends_with_the_service() -> None:
    """Also in the middle of its work: standard input ends when the service has gone."""
    head = {
        "memory_mb": 512,
        "capabilities": [],
        "builtin": True,
        "limits": {},
    }
    process = subprocess.Popen(
        [sys.executable, "-m", "gpsfsm.service.worker"],
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
            found = await asyncio.gather(
                *(pool.do("gate", body) for _ in range(10)), return_exceptions=True
            )
            again = (await pool.do("gate", body)).status
        finally:
            await pool.close()
        refused = [each for each in found if isinstance(each, Problem)]
        assert all(each.headers["retry-after"] == "1" for each in refused)
        return [each.status for each in found if not isinstance(each, BaseException)], again

    served, again = asyncio.run(work())
    assert served == [200] * 4  # one is worked on, three wait
    assert again == 200


def test_every_endpoint_is_answered_by_somebody() -> None:
    for each in all_endpoints():
        assert (each.work is None) != (each.handle is None)
        assert each.answer is not None or each.media
        assert each.path.startswith("/")


def test_bodies_have_a_budget() -> None:
    budget = Budget(10)
    budget.take(8)
    with pytest.raises(Problem) as refused:
        budget.take(3)
    assert (refused.value.status, refused.value.headers["retry-after"]) == (429, "1")
    budget.give_back(8)
    budget.take(10)
    assert budget.used == 10
