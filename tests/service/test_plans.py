"""The plan queue over HTTP: set, cancel, status, completion, events."""

from __future__ import annotations

import asyncio
import json
import time
from typing import TYPE_CHECKING

import httpx
import pytest

from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.journal_rows import line
from gpsfsm.service import Settings, app
from gpsfsm.service.plan_queue import ENDED, status_of
from tests.service.support import BAD, GOOD, Service, ended, events, lay_traps

if TYPE_CHECKING:
    from pathlib import Path

LONG = "".join(f'<Runner interface="a/R{n}" provider="a/R"/>' for n in range(40))
LONG = f"<Plan>{LONG}</Plan>"


def set_plan(client: httpx.Client, plan: str = GOOD, **more: str) -> str:
    response = client.post("/v1/plans", json={"plan": plan, **more})
    assert response.status_code == 200, response.text
    answer = response.json()
    assert answer["plan_id"]
    number: str = answer["plan_id"]
    return number


def test_a_plan_is_set_and_completes(client: httpx.Client) -> None:
    plan = set_plan(client, name="first.xml")
    end = ended(client, plan)
    assert (end["status"], end["code"], end["completed"]) == ("COMPLETED", 13, True)
    assert end["name"] == "first.xml"
    status = client.get(f"/v1/plans/{plan}").json()
    assert {name: end[name] for name in status} == status


def test_a_plan_that_the_gate_refuses_is_not_queued(client: httpx.Client) -> None:
    before = client.get("/v1/plans").json()["total"]
    response = client.post("/v1/plans", json={"plan": BAD})
    assert response.status_code == 422
    answer = response.json()
    assert (answer["plan_id"], answer["plan_status"], answer["code"]) == ("", "PARSE_FAILED", 3)
    assert "GP107" in answer["rejected_list"][0]
    assert client.get("/v1/plans").json()["total"] == before


@pytest.mark.parametrize("plan", ["0", "999999", "x", "-1", "1e3", "²", "9" * 30])
def test_there_is_no_such_plan(client: httpx.Client, plan: str) -> None:
    for method, path in (
        ("GET", ""),
        ("GET", "/events"),
        ("POST", "/cancel"),
        ("POST", "/completion"),
    ):
        response = client.request(method, f"/v1/plans/{plan}{path}")
        assert response.status_code == 404
        assert (response.json()["plan_status"], response.json()["code"]) == ("UNKNOWN", 0)


def test_the_same_request_is_queued_once(client: httpx.Client) -> None:
    first = set_plan(client, request_id="mission-1:a")
    again = set_plan(client, request_id="mission-1:a")
    other = set_plan(client, request_id="mission-1:b")
    assert first == again != other
    assert client.post("/v1/plans", json={"plan": GOOD, "request_id": "a b"}).status_code == 422
    another = client.post("/v1/plans", json={"plan": LONG, "request_id": "mission-1:a"})
    assert another.status_code == 409


def test_plans_are_listed_in_order(client: httpx.Client) -> None:
    plans = [set_plan(client) for _ in range(3)]
    after = int(plans[0]) - 1
    document = client.get("/v1/plans", params={"after": after}).json()
    assert [each["plan_id"] for each in document["plans"]][:3] == plans
    assert client.get("/v1/plans", params={"after": "x"}).status_code == 422


def test_events_are_those_of_the_journal(client: httpx.Client, service: Service) -> None:
    plan = set_plan(client)
    records = events(client, plan)
    run = ended(client, plan)["run"]
    with JournalReader(service.journal) as reader:
        wanted = [json.loads(line(row, wall_clock=True)) for row in reader.events(run)]
    assert [data for kind, _, data in records if kind == "record"] == wanted
    numbers = [int(number) for kind, number, _ in records if kind == "record"]
    assert numbers == list(range(1, len(wanted) + 1))
    assert records[-1][0] == "end"
    assert records[-1][2]["status"] == "COMPLETED"


def test_events_go_on_where_a_client_has_left(client: httpx.Client) -> None:
    plan = set_plan(client)
    whole = [each for each in events(client, plan) if each[0] == "record"]
    for after in (1, 3, len(whole) - 1, len(whole), len(whole) + 5):
        rest = [each for each in events(client, plan, after) if each[0] == "record"]
        assert rest == whole[after:]
    wrong = client.get(f"/v1/plans/{plan}/events", headers={"last-event-id": "x"})
    assert wrong.status_code == 422


def test_a_plan_that_runs_is_cancelled_and_another_one_waits(tmp_path: Path) -> None:
    words = ("--journal", tmp_path / "q.db", "--failure", "0", "--workers", "1", "--speed", "2")
    words += ("--queue", "2")
    with Service(*words) as service, service.client() as client:
        running, waiting = set_plan(client, LONG), set_plan(client, LONG)
        until_s = time.monotonic() + 30
        while client.get(f"/v1/plans/{running}").json()["status"] != "RUNNING":
            assert time.monotonic() < until_s
            time.sleep(0.05)
        assert client.get(f"/v1/plans/{waiting}").json()["status"] == "QUEUED"
        soon = client.post(f"/v1/plans/{waiting}/completion", json={"wait_s": 0.2}).json()
        assert (soon["ended"], soon["completed"]) == (False, False)
        for plan in (waiting, running):
            end = client.post(f"/v1/plans/{plan}/cancel", json={"reason": "enough"}).json()
            assert end["success"] is True
            end = ended(client, plan)
            assert (end["status"], end["code"]) == ("CANCELLED", 14)
            assert (end["reason"], end["completed"]) == ("enough", False)
            assert client.post(f"/v1/plans/{plan}/cancel").json()["success"] is False
        assert [kind for kind, _, _ in events(client, waiting)] == ["end"]
        assert events(client, running)[-2][2]["data"] == {"status": "CANCELLED"}
        a_queue_that_is_full_takes_no_more(client)


def a_queue_that_is_full_takes_no_more(client: httpx.Client) -> None:
    running = set_plan(client, LONG)
    until_s = time.monotonic() + 30
    while client.get(f"/v1/plans/{running}").json()["status"] != "RUNNING":
        assert time.monotonic() < until_s
        time.sleep(0.05)
    before = client.get("/v1/plans").json()["total"]
    plans = [set_plan(client) for _ in range(2)]
    full = client.post("/v1/plans", json={"plan": GOOD})
    assert full.status_code == 429
    assert "queue is full" in full.json()["detail"]
    assert int(full.headers["retry-after"]) >= 1
    client.post(f"/v1/plans/{plans[0]}/cancel")
    assert client.get("/v1/plans").json()["total"] == before + 2
    set_plan(client)


def test_a_run_that_takes_too_long_is_cancelled(tmp_path: Path) -> None:
    words = ("--journal", tmp_path / "q.db", "--failure", "0", "--workers", "1")
    words += ("--speed", "20", "--run-limit", "0.5")
    lay_traps(tmp_path)  # its processes take no module from the current folder
    with Service(*words, folder=tmp_path) as service, service.client() as client:
        end = ended(client, set_plan(client, LONG))
        assert end["status"] == "CANCELLED"
        assert end["reason"] == "it took more than 0.5 s"


def test_without_a_journal_there_is_no_queue() -> None:
    """Told by the application itself: no process is needed to know it."""
    transport = httpx.ASGITransport(app(Settings()))

    async def ask() -> list[httpx.Response]:
        async with httpx.AsyncClient(transport=transport, base_url="http://localhost") as client:
            return [
                await client.post("/v1/plans", json={"plan": GOOD}),
                await client.get("/v1/plans/1"),
                await client.get("/v1/plans/1/events"),
                await client.get("/health"),
                await client.post("/v1/generate", json={"task": "go"}),
            ]

    *answers, health, none = asyncio.run(ask())
    for each in answers:
        assert each.status_code == 501
        assert "--journal" in each.json()["detail"]
    assert health.json()["queue"] == "off"
    assert none.status_code == 501


def test_every_status_has_a_word() -> None:
    from gpsfsm.execution.records import Status

    assert {each.value for each in Status if each.ended} == ENDED
    codes = {"QUEUED": 1, "RUNNING": 12, "STOPPING": 12, "COMPLETED": 13, "CANCELLED": 14}
    for status in Status:
        actual = status_of(status.value)
        assert actual[0].isupper()
        if status is not Status.REFUSED:
            assert actual[1] == codes.get(status.value)
    assert status_of("REFUSED", ["GP107 at line 1: x"]) == ("PARSE_FAILED", 3)
    assert status_of("REFUSED", ["GP301 at line 1: x"]) == ("VALIDATION_FAILED", 5)
