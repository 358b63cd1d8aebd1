"""A language model writes plans: when one gives up, and when a client asks for one."""

from __future__ import annotations

import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.cli.regenerating import CLOSING, ELSEWHERE, MISSION, TASK, answers, rows, statuses
from tests.generation.fake_server import FakeServer
from tests.service.support import Service, ended

if TYPE_CHECKING:
    import httpx

MORE = {"plan": Path(MISSION).read_text(encoding="utf-8"), "name": "mission.xml"}


def words(folder: Path) -> tuple[str, ...]:
    result = ("--journal", str(folder / "q.db"), "--world", CLOSING, "--task", TASK)
    return (*result, "--model", f"replay:{folder / 'answers.jsonl'}", "--workers", "1")


def wait_for(client: httpx.Client, plans: int) -> None:
    """Until there are so many plans."""
    until_s = time.monotonic() + 60
    while client.get("/v1/plans").json()["total"] < plans:
        assert time.monotonic() < until_s
        time.sleep(0.1)


def test_a_plan_that_gives_up_is_continued_also_after_a_restart(tmp_path: Path) -> None:
    answers(tmp_path)
    with Service(*words(tmp_path)) as service, service.client() as client:
        client.post("/v1/plans", json=MORE)
        first = ended(client, "1")
        assert (first["status"], first["code"]) == ("GAVE_UP", None)
        service.kill()
    with Service(*words(tmp_path)) as service, service.client() as client:
        wait_for(client, 3)
        end = ended(client, "3")
        assert end["completed"]
        assert end["continues"] == "2"
        assert service.stop() == 0
    assert statuses(tmp_path / "q.db") == ["GAVE_UP", "GAVE_UP", "COMPLETED"]
    assert [each["accepted"] for each in rows(tmp_path / "q.db", "GENERATED")] == [True, True]
    mine = words(tmp_path)
    for other in ((*mine, "--seed", "7"), mine[:2]):  # settings that do not fit the journal
        service = Service(*other)
        with pytest.raises(AssertionError, match="were run with other settings"):
            service.start()
        service.finish()
        assert service.process.returncode == 2


def test_plans_that_are_asked_for(tmp_path: Path) -> None:
    answers(tmp_path, "I do not know.", ELSEWHERE)
    with Service(*words(tmp_path)) as service, service.client() as client:
        request = {"task": "go there", "auto_queue": True, "request_id": "mine"}
        document = client.post("/v1/generate", json=request).json()
        assert (document["accepted"], document["plan"]) == (True, ELSEWHERE)
        assert document["attempts"] == 2
        assert (document["plan_id"], document["status"]) == ("1", "QUEUED")
        assert ended(client, "1")["completed"]
        alone = client.post("/v1/generate", json={"task": "go there"}).json()
        assert (alone["plan_id"], alone["status"], alone["code"]) == (
            "",
            "GENERATION_COMPLETE",
            16,
        )
        answers(tmp_path, "No.", "No!", "Never.")
        none = client.post("/v1/generate", json=request).json()
        assert (none["accepted"], none["plan"], none["plan_id"]) == (False, "", "")
        assert none["reasoning"]
        (tmp_path / "answers.jsonl").unlink()
        broken = client.post("/v1/generate", json=request)
        assert broken.status_code == 502
        assert "could not be asked" in broken.json()["detail"]
        empty = client.post("/v1/generate", json={"task": ""})
        assert empty.status_code == 422


def test_while_a_model_thinks_the_queue_answers_and_a_stop_loses_nothing(tmp_path: Path) -> None:
    request, thought = threading.Event(), threading.Event()

    def answer(_: object) -> str:
        request.set()
        assert thought.wait(60)
        return ELSEWHERE

    with FakeServer(answer) as server:
        model = ("--model", "openai-compatible:tiny", "--base-url", f"{server.url}/v1")
        base = words(tmp_path)
        mine = (*base[:6], *model, "--no-constrain", *base[8:], "--grace", "20")
        with Service(*mine) as service, service.client() as client:
            client.post("/v1/plans", json=MORE)
            assert request.wait(60)
            assert client.get("/v1/plans/1").json()["status"] == "GAVE_UP"
            assert client.post("/v1/plans", json=MORE).json()["plan_id"] == "2"
            assert client.get("/v1/plans/2").json()["status"] == "QUEUED"
            assert service.stop() == 0
        assert not thought.is_set()
        assert rows(tmp_path / "q.db", "GENERATED") == []
        thought.set()
        with Service(*mine) as service, service.client() as client:
            wait_for(client, 3)
            assert ended(client, "3")["continues"] == "1"
            assert ended(client, "3")["completed"]
            assert ended(client, "2")["run"] == 3  # the one that continues came before it
            assert service.stop() == 0
