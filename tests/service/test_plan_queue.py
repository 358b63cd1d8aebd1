"""Requests to a plan queue whose process ends before it has answered, or cannot begin again."""

from __future__ import annotations

import asyncio
import os
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from gpsfsm.service import plan_queue
from gpsfsm.service.endpoints import plans
from gpsfsm.service.plan_queue import PlanQueueClient
from gpsfsm.service.settings import Settings
from gpsfsm.service.shapes import Problem
from gpsfsm.workers.frames import GoneError
from tests.service.support import GOOD, Service


class Ending(PlanQueueClient):
    """Whatever it is asked, its process ends meanwhile."""

    def __init__(self) -> None:
        super().__init__(Settings())
        self.operations: list[str] = []

    async def _ask(self, head: dict[str, Any], body: bytes) -> dict[str, Any]:
        self.operations.append(head["op"])
        raise GoneError("has ended")


@pytest.mark.parametrize(("once", "times"), [(False, 2), (True, 1)])
def test_what_must_not_be_done_twice_is_not_asked_again(once: bool, times: int) -> None:
    queue = Ending()
    with pytest.raises(Problem) as message:
        asyncio.run(queue.ask("control", once=once))
    assert message.value.status == 503
    assert len(queue.operations) == times


def test_a_step_and_a_failure_must_not_be_done_twice() -> None:
    controls = [each for each in plans.ENDPOINTS if each.answer is plans.ControlAnswer]
    paths = {each.path.rpartition("/")[2] for each in controls}
    again = paths - {"pause", "resume", "speed"}  # once more makes no difference
    assert again == set(plans._ONCE)


LEFT = """
import sys, time
from pathlib import Path
from gpsfsm.workers.frames import pack, read

def say(**head):
    sys.stdout.buffer.write(pack(head))
    sys.stdout.buffer.flush()

head, _ = read(sys.stdin.buffer)
folder = Path(head["journal"]).parent
say(left=1)
while not (folder / "go").exists():
    time.sleep(0.01)
say(ready=True)
while True:
    head, _ = read(sys.stdin.buffer)
    with (folder / "heard").open("a") as heard:
        heard.write(head["op"] + ": " + head.get("reason", "") + "\\n")
    if head["op"] == "stop":
        break
"""


def test_a_stop_while_the_queue_begins_is_neither_lost_nor_waited_for(tmp_path: Path) -> None:
    command = (sys.executable, "-c", LEFT)

    async def stopped() -> tuple[str, list[str]]:
        lost: asyncio.Queue[str] = asyncio.Queue()
        settings = Settings(journal=str(tmp_path / "q.db"), executor=command)
        queue = PlanQueueClient(settings, lambda: lost.put_nowait("lost"))
        beginning = asyncio.create_task(queue.start())
        try:
            async with asyncio.timeout(60):
                first = await lost.get()  # what was left is stopped before the queue is ready
                assert not beginning.done()
                problem = (await queue.halt("because of me", 1.0))["problem"]
                (tmp_path / "go").touch()
                await beginning
                while not (tmp_path / "heard").exists():
                    await asyncio.sleep(0.01)
        finally:
            await queue.close()
        return first, [problem, (tmp_path / "heard").read_text()]

    first, said = asyncio.run(stopped())
    assert first == "lost"
    assert said[0] == "the plan queue is being restarted, and is held once it is back"
    assert said[1].startswith("stop_all: because of me\n")


DEAF = """
import os, sys, time
from pathlib import Path
from gpsfsm.workers.frames import pack, read

def say(**head):
    sys.stdout.buffer.write(pack(head))
    sys.stdout.buffer.flush()

head, _ = read(sys.stdin.buffer)
folder = Path(head["journal"]).parent
first = not (folder / "deaf").exists()
if first:
    os.close(0)
    (folder / "deaf").touch()
say(ready=True)
if first:
    time.sleep(600)
while (head := read(sys.stdin.buffer)[0])["op"] != "stop":
    say(id=head["id"], op=head["op"])
"""
"""A plan queue whose first process hears nothing, but has not ended where anybody listens to it."""


def test_what_is_asked_before_the_end_is_noticed_waits_for_the_next_process(tmp_path: Path) -> None:
    """A process that is killed closes one pipe after the other."""
    settings = Settings(journal=str(tmp_path / "q.db"), executor=(sys.executable, "-c", DEAF))

    async def answered() -> tuple[dict[str, Any], int]:
        queue = PlanQueueClient(settings)
        await queue.start()
        try:
            return await queue.ask("state"), queue.restarts
        finally:
            await queue.close()

    answer, restarts = asyncio.run(answered())
    assert answer["op"] == "state"
    assert restarts == 1


FAILS = """
import os, sys
from gpsfsm.workers.frames import pack, read

def say(**head):
    sys.stdout.buffer.write(pack(head))
    sys.stdout.buffer.flush()

def fail():
    say(failed="there is no room")
    sys.exit(2)

head, _ = read(sys.stdin.buffer)
full = lambda: os.path.exists(head["journal"])
if full() and {at_once}:
    fail()
say(ready=True)
if full():
    fail()
while True:
    head_of, _ = read(sys.stdin.buffer)
    if head_of["op"] == "stop":
        sys.exit(0)
    if full():
        fail()
    say(id=head_of["id"], done=True)
"""
"""A plan queue that cannot go on while a file is there."""


@pytest.mark.parametrize("at_once", [True, False])
def test_nobody_waits_for_a_queue_that_cannot_go_on(
    at_once: bool,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(plan_queue, "_STEADY_S", 2.0)
    full = tmp_path / "full"
    script = FAILS.replace("{at_once}", str(at_once))
    settings = Settings(journal=str(full), executor=(sys.executable, "-c", script))

    async def work() -> None:
        queue = PlanQueueClient(settings)
        await queue.start()
        assert (await queue.ask("list"))["done"]
        full.touch()
        took_s = []
        for _ in range(4):
            began_s = time.monotonic()
            with pytest.raises(Problem) as message:
                await queue.ask("list")
            assert message.value.status == 503
            took_s.append(time.monotonic() - began_s)
        assert min(took_s) < 0.1  # while it is being started
        assert queue.failure == "there is no room"
        assert not queue.up
        full.unlink()
        until_s = time.monotonic() + 60
        while not queue.up:
            assert time.monotonic() < until_s
            await asyncio.sleep(0.05)
        assert (await queue.ask("list"))["done"]
        assert queue.failure  # it may fail again soon
        while queue.failure:
            assert time.monotonic() < until_s
            await asyncio.sleep(0.05)
        await queue.close()

    asyncio.run(work())
    said = capsys.readouterr().err
    assert said == "gpsfsm: the plan queue cannot go on: there is no room\n"


LIMITED = """
import resource, runpy
resource.setrlimit(resource.RLIMIT_FSIZE, (120 * 1024,) * 2)
runpy.run_module("gpsfsm", run_name="__main__", alter_sys=True)
"""


@pytest.mark.skipif(os.name != "posix", reason="needs limits on files")
def test_a_full_disk_is_told_at_once_and_in_the_end(tmp_path: Path) -> None:
    words = ("--journal", tmp_path / "q.db", "--failure", "0", "--workers", "1")
    service = Service(*words)
    service.command = ["-P", "-c", LIMITED, "serve", "--port", "0", "--isolated"]
    statuses: list[int] = []
    with service, service.client() as client:
        plan = GOOD.replace("</Plan>", GOOD[6:-7] * 59 + "</Plan>")
        while statuses.count(503) < 4:
            assert len(statuses) < 40
            began_s = time.monotonic()
            statuses.append(client.post("/v1/plans", json={"plan": plan}).status_code)
            assert time.monotonic() - began_s < 15
        assert set(statuses) == {200, 503}
        assert service.stop() == 2
    said = "".join(service.said)
    assert said.count("the plan queue cannot go on: ") in (1, 2)  # by what could not be written
    assert "is the disk full?" in said.rpartition("the plan queue could not go on: ")[2]
    assert "Traceback" not in said
