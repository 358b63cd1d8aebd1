"""``/livez`` and ``/readyz``: for those who restart the service or send requests to it."""

from __future__ import annotations

import asyncio
import os
import signal
import threading
import time
from typing import TYPE_CHECKING, Any

from gpsfsm.service import Settings
from gpsfsm.service import core as core_module
from tests.service.support import GOOD, Service
from tests.service.test_token import TOKEN

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    import httpx
    import pytest


def until(true: Callable[[], bool], within_s: float = 60) -> None:
    end_s = time.monotonic() + within_s
    while not true():
        assert time.monotonic() < end_s
        time.sleep(0.02)


def test_both_are_for_everybody_and_say_next_to_nothing(tmp_path: Path) -> None:
    (tmp_path / "token").write_text(TOKEN)
    words = ("--token-file", tmp_path / "token", "--journal", tmp_path / "q.db", "--workers", "1")
    with Service(*words) as service, service.client() as client:
        assert client.get("/v1/rules").status_code == 401
        for path, body in (
            ("/livez", {"status": "alive"}),
            ("/readyz", {"status": "ready", "reasons": []}),
        ):
            answer = client.get(path)
            assert (answer.status_code, answer.json()) == (200, body)
            assert client.head(path).status_code == 200
            assert client.post(path).status_code in (401, 405)


def reasons(client: httpx.Client) -> list[str]:
    answer = client.get("/readyz")
    body: dict[str, Any] = answer.json()
    assert (answer.status_code == 503) is bool(body["reasons"]), body
    assert body["status"] == ("not ready" if body["reasons"] else "ready")
    said: list[str] = body["reasons"]
    return said


def test_a_journal_that_is_gone_is_a_reason(tmp_path: Path) -> None:
    journal = tmp_path / "q.db"
    with Service("--journal", journal, "--workers", "1") as service, service.client() as client:
        assert reasons(client) == []
        journal.rename(tmp_path / "moved.db")
        until(lambda: reasons(client) == ["journal_not_writable"], 10)
        assert client.get("/livez").status_code == 200
        (tmp_path / "moved.db").rename(journal)
        until(lambda: reasons(client) == [], 10)


def test_a_disk_without_room_is_a_reason(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    journal = tmp_path / "q.db"
    journal.touch()
    assert core_module._writable(str(journal))
    real = os.statvfs(tmp_path)
    full = os.statvfs_result((*real[:4], 0, *real[5:]))
    monkeypatch.setattr(os, "statvfs", lambda _: full)
    assert not core_module._writable(str(journal))


def test_a_disk_that_does_not_answer_takes_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    answers, looks = threading.Event(), list[str]()

    def look(journal: str) -> bool:
        looks.append(journal)
        return answers.wait(60)

    monkeypatch.setattr(core_module, "_writable", look)
    monkeypatch.setattr(core_module, "_DISK_S", 0.01)
    monkeypatch.setattr(core_module, "_LOOK_S", 0.0)

    async def tried() -> None:
        core = core_module.Core(Settings(journal="/gone/queue.db"))
        assert [await core._journal_writable() for _ in range(5)] == [False] * 5
        assert looks == ["/gone/queue.db"]
        answers.set()
        assert core._looking is not None
        await core._looking
        assert await core._journal_writable()

    asyncio.run(tried())


def test_a_queue_that_is_gone_is_a_reason_until_it_is_back(tmp_path: Path) -> None:
    words = ("--journal", tmp_path / "q.db", "--workers", "1")
    with Service(*words, new_workers=True) as service, service.client() as client:
        (queue,) = (pid for pid, words in service.children().items() if "running.serving" in words)
        os.kill(queue, signal.SIGKILL)
        until(lambda: reasons(client) == ["queue_down"], 10)
        until(lambda: reasons(client) == [])


def test_workers_that_are_gone_are_a_reason(tmp_path: Path) -> None:
    missed: set[str] = set()

    def all_missed() -> bool:
        missed.update(reasons(client))
        return {"workers_down", "gate_workers_down"} <= missed

    # New workers begin soon, so these have to load all that they need.
    with Service("--workers", "1", new_workers=True) as service, service.client() as client:
        for pid in service.children():
            os.kill(pid, signal.SIGKILL)
        until(all_missed, 10)
        until(lambda: reasons(client) == [])


def test_it_drains_before_it_ends() -> None:
    """It answers all requests, also over new connections, and says that it is not ready."""
    with Service("--workers", "1", "--drain", "3600") as service, service.client() as client:
        service.process.send_signal(signal.SIGTERM)
        until(lambda: reasons(client) == ["draining"])
        with service.client() as new:
            assert reasons(new) == ["draining"]
            assert new.get("/livez").status_code == 200
            assert new.post("/v1/gate", json={"plan": GOOD}).json()["verdict"] == "accepted"
        assert service.process.poll() is None
        assert service.stop() == 0, "a second signal ends it"


def test_it_drains_for_as_long_as_it_was_told_to() -> None:
    with Service("--workers", "1", "--drain", "1.5") as service:
        began_s = time.monotonic()
        assert service.stop() == 0
        assert time.monotonic() - began_s >= 1.5


def test_what_is_about_to_close_is_not_ready(tmp_path: Path) -> None:
    """Without ``--drain`` it says so to the connections that are still there."""
    settings = Settings(workers=1)

    async def statuses() -> list[str]:
        core = core_module.Core(settings)
        try:
            await core.start()
            before = await core.unready()
            core.begin_closing()
            return [*before, *await core.unready()]
        finally:
            await core.close()

    assert asyncio.run(statuses()) == ["draining"]
