"""No accepted plan is lost and none runs twice, however the service ends."""

from __future__ import annotations

import itertools
import json
import os
import random
import signal
import threading
import time
from collections import Counter
from typing import TYPE_CHECKING

import httpx

from gpsfsm.execution.journal_read import JournalReader
from tests.service.support import Service, ended, events

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

STEPS = "".join(f'<Runner interface="a/R{n}" provider="a/R"/>' for n in range(6))
PLAN = f"<Plan>{STEPS}</Plan>"


class Load:
    """Clients that set plans until they are told to stop; each knows what was accepted."""

    def __init__(self, service: Service, numbers: itertools.count[int]) -> None:
        self.accepted: dict[str, str] = {}  # plans by the keys of their requests
        self.unknown: set[str] = set()  # nobody has answered
        self._service, self._numbers = service, numbers
        self._stop = threading.Event()
        self._threads = [threading.Thread(target=self._ask) for _ in range(4)]
        for thread in self._threads:
            thread.start()

    def _ask(self) -> None:
        with self._service.client() as client:
            while not self._stop.is_set():
                key = f"k{next(self._numbers)}"
                body = {"plan": PLAN, "request_id": key}
                try:
                    answer = client.post("/v1/plans", json=body)
                except httpx.HTTPError:
                    self.unknown.add(key)
                    if self._service.process.poll() is not None:
                        return
                    time.sleep(0.1)
                    continue
                if answer.status_code == 200:
                    self.accepted[key] = answer.json()["plan_id"]
                    time.sleep(0.02)
                else:
                    assert answer.status_code in (429, 503)
                    self.unknown.add(key)
                    time.sleep(0.05)

    def wait(self, more: int = 1) -> None:
        """Until so many more plans have been accepted: on a busy machine, no time says that."""
        enough, until_s = len(self.accepted) + more, time.monotonic() + 120
        while len(self.accepted) < enough:
            assert time.monotonic() < until_s, "no plan was accepted for two minutes"
            time.sleep(0.02)

    def end(self) -> None:
        self._stop.set()
        for thread in self._threads:
            thread.join(60)


def runs_of(journal: Path) -> dict[int, list[str]]:
    """The statuses of the runs of each plan, as the journal has them; and it is whole."""
    with JournalReader(str(journal)) as reader:
        reader.verify_queue()
        statuses = {each.number: each.status.value for each in reader.runs()}
        for number in statuses:
            reader.verify(number)
        results: dict[int, list[str]] = {}
        for _, _, kind, plan, _, data, _ in reader.queue():
            if kind == "RUN":
                results.setdefault(plan, []).append(statuses[json.loads(data)["run"]])
        return results


def check(journal: Path, accepted: dict[str, str], plans: int) -> None:
    runs = runs_of(journal)
    assert sorted(runs) == list(range(1, plans + 1))
    assert all(len(statuses) == 1 for statuses in runs.values())
    assert {statuses[0] for statuses in runs.values()} == {"COMPLETED"}
    assert len(set(accepted.values())) == len(accepted)
    assert all(1 <= int(plan) <= plans for plan in accepted.values())


def test_the_service_ends_under_load(tmp_path: Path) -> None:
    """By SIGKILL, then by SIGTERM."""
    ends: tuple[Callable[[Service], object], ...] = (Service.kill, Service.stop)
    journal = tmp_path / "q.db"
    words = ("--journal", journal, "--failure", "0", "--workers", "1", "--speed", "500")
    accepted: dict[str, str] = {}
    unknown: set[str] = set()
    numbers, chance = itertools.count(), random.Random(8)  # noqa: S311
    for end in ends:
        service = Service(*words).start()
        load = Load(service, numbers)
        load.wait()
        time.sleep(chance.uniform(0.0, 0.4))
        end(service)
        load.end()
        accepted |= load.accepted
        unknown |= load.unknown
    assert accepted
    fast = (*words[:-2],)
    with Service(*fast) as service, service.client() as client:
        for key in sorted(unknown)[:8]:  # who got no answer asks again
            again = client.post("/v1/plans", json={"plan": PLAN, "request_id": key})
            accepted[key] = again.json()["plan_id"]
        plans = client.get("/v1/plans").json()["total"]
        assert ended(client, str(plans))["completed"]  # the last: the journal tells of all
        for key, plan in itertools.islice(accepted.items(), 5):
            again = client.post("/v1/plans", json={"plan": PLAN, "request_id": key})
            assert again.json()["plan_id"] == plan
        assert service.stop() == 0
    check(journal, accepted, plans)


def test_the_process_of_the_queue_is_killed_under_load(tmp_path: Path) -> None:
    journal = tmp_path / "q.db"
    words = ("--journal", journal, "--failure", "0", "--workers", "1", "--speed", "400")
    with Service(*words) as service, service.client() as client:
        load = Load(service, itertools.count())
        for _ in range(2):
            up = 0
            while not up:
                time.sleep(0.3)
                up = client.get("/health").json()["queue"] == "up"
            load.wait()
            for child, command in service.children().items():
                if "running.serving" in command:
                    os.kill(child, signal.SIGKILL)
            while client.get("/health").json()["queue"] == "up":
                time.sleep(0.03)
        load.end()
        assert load.accepted
        plans = client.get("/v1/plans").json()["total"]
        assert ended(client, str(plans))["completed"]
        metrics = client.get("/metrics").text.splitlines()
        assert "gpsfsm_queue_restarts_total 2" in metrics
        seen = [number for kind, number, _ in events(client, "1") if kind == "record"]
        assert seen == [str(number) for number in range(1, len(seen) + 1)]
        assert service.stop() == 0
    check(journal, load.accepted, plans)


def test_a_plan_that_ends_its_process_is_given_up(tmp_path: Path) -> None:
    """Whatever it does to the process that runs it, the next plan runs."""
    journal = tmp_path / "q.db"
    words = ("--journal", journal, "--failure", "0", "--workers", "1", "--speed", "0.05")
    with Service(*words) as service, service.client() as client:
        for _ in range(2):
            assert client.post("/v1/plans", json={"plan": PLAN}).status_code == 200
        for attempt in range(3):
            until_s = time.monotonic() + 60
            while client.get("/v1/plans/1").json()["status"] != "RUNNING":
                assert time.monotonic() < until_s
                time.sleep(0.05)
            time.sleep(0.2)
            children = [
                each for each, what in service.children().items() if "running.serving" in what
            ]
            assert len(children) == 1, attempt
            os.kill(children[0], signal.SIGKILL)
            time.sleep(0.3)
        end = ended(client, "1")
        assert end["status"] == "CANCELLED"
        assert "the process that ran it has ended 3 times" in end["reason"]
        until_s = time.monotonic() + 60
        while client.get("/v1/plans/2").json()["status"] != "RUNNING":
            assert time.monotonic() < until_s
            time.sleep(0.05)


def test_a_stop_answers_what_is_under_way_and_ends_what_would_not_end(tmp_path: Path) -> None:
    words = ("--journal", tmp_path / "q.db", "--workers", "1", "--speed", "0.01", "--grace", "1")
    with Service(*words) as service, service.client() as client:
        client.post("/v1/plans", json={"plan": PLAN})
        with client.stream("GET", "/v1/plans/1/events") as stream:
            lines = stream.iter_lines()
            assert next(lines).startswith("retry: ")
            service.process.send_signal(signal.SIGTERM)
            assert not any("event: end" in each for each in lines)  # it ends, the plan does not
        assert service.process.wait(30) == 0
        children = Counter(service.children().values())
        assert not children
    with Service(*words) as service, service.client() as client:
        assert client.get("/v1/plans/1").json()["status"] == "RUNNING"
