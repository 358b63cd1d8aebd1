"""Runs that a client starts in a world of its choice and meddles with; past runs and maps."""

from __future__ import annotations

import json
import math
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jsonschema
import pytest

from gpsfsm.cli import main
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.service.registry import endpoint
from tests.cli.regenerating import CLOSING, ELSEWHERE, MISSION, TASK, answers
from tests.conftest import REPO
from tests.service.support import GOOD, Service, ended, events

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import httpx

WORLDS = [REPO / "corpus" / "worlds" / f"{name}.yaml" for name in ("home", "arena")]
WAYPOINT = "nav2_capabilities/WaypointRunner"
SPEECH = "perception_capabilities/SpeechRunner"
TOUR = f"""<Plan>
<Runner interface="{WAYPOINT}" provider="{WAYPOINT}" x="2.0" y="-0.5"/>
<Runner interface="{SPEECH}" provider="{SPEECH}" text="Here I am."/>
<Runner interface="{WAYPOINT}" provider="{WAYPOINT}" x="0.0" y="0.0"/>
</Plan>"""


def words(folder: Path) -> tuple[object, ...]:
    worlds = [word for file in WORLDS for word in ("--world", file)]
    return ("--journal", folder / "q.db", "--durability", "process", "--workers", "1", *worlds)


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    with Service(*words(tmp_path_factory.mktemp("live"))) as service:
        yield service


@pytest.fixture
def page(live: Service) -> Iterator[httpx.Client]:
    with live.client() as client:
        yield client


def begin(client: httpx.Client, plan: str = TOUR, **start: Any) -> str:
    response = client.post("/v1/plans", json={"plan": plan, "name": "tour.xml", "start": start})
    assert response.status_code == 200, response.text
    number: str = response.json()["plan_id"]
    return number


def until(client: httpx.Client, plan: str, holds: Callable[[dict[str, Any]], bool]) -> Any:
    """How a plan stands as soon as this is true of it."""
    until_s = time.monotonic() + 60
    while not holds(document := client.get(f"/v1/plans/{plan}").json()):
        assert time.monotonic() < until_s, document
        time.sleep(0.02)
    return document


def do(client: httpx.Client, plan: str, what: str, **more: Any) -> dict[str, Any]:
    answer = client.post(f"/v1/plans/{plan}/{what}", json=more)
    assert answer.status_code == 200, answer.text
    document: dict[str, Any] = answer.json()
    return document


def obeys(client: httpx.Client, path: str, actual: Any) -> None:
    """An answer is as the OpenAPI document says."""
    document = client.get("/openapi.json").json()
    shape = document["paths"][path]["get"]["responses"]["200"]["content"]["application/json"]
    jsonschema.validate(actual, {**shape["schema"], "components": document["components"]})


def test_it_tells_what_it_has(page: httpx.Client) -> None:
    document = page.get("/v1/service").json()
    obeys(page, "/v1/service", document)
    assert [each["world"] for each in document["worlds"]] == ["home", "arena", "drawn", "field"]
    assert [each["default"] for each in document["worlds"]] == [True, False, False, False]
    assert (document["queue"], document["generates"], document["regenerates"]) == (
        True,
        False,
        False,
    )
    arena = page.get("/v1/worlds/arena").json()
    obeys(page, "/v1/worlds/{world}", arena)
    assert arena["area"] == [-4.0, -4.0, 4.0, 4.0]
    assert {"name": "crate", "low": True}.items() <= arena["obstacles"][4].items()
    for name in ("drawn", "nowhere", "x" * 200, "..%2f"):
        assert page.get(f"/v1/worlds/{name}").status_code == 404


def test_a_run_is_paused_stepped_and_goes_on(page: httpx.Client) -> None:
    plan = begin(page, world="home", speed=4.0, paused=True, seed=5)
    reached = until(page, plan, lambda state: state["run"] is not None)
    assert (reached["status"], reached["paused"], reached["speed"]) == ("RUNNING", True, 4.0)
    answer = do(page, plan, "step", events=1)
    assert (answer["success"], answer["paused"]) == (True, True)
    assert do(page, plan, "resume")["paused"] is False
    until(page, plan, lambda state: state["clock_us"] > 500_000)
    assert do(page, plan, "pause")["paused"] is True
    stood = until(page, plan, lambda state: state["paused"])["clock_us"]
    time.sleep(0.2)
    still = page.get(f"/v1/plans/{plan}").json()
    assert (still["clock_us"] - stood < 1_000_000, still["status"]) == (True, "RUNNING")
    assert do(page, plan, "speed", speed=None)["speed"] is None
    do(page, plan, "resume")
    assert ended(page, plan)["completed"]
    assert do(page, plan, "pause")["why"] == "the plan is not running"
    notes = [data["data"] for kind, _, data in events(page, plan) if data.get("kind") == "NOTE"]
    assert [each["control"] for each in notes] == ["step", "resume", "pause", "speed", "resume"]


def test_the_journal_has_what_a_map_shows(page: httpx.Client) -> None:
    plan = begin(page, world="home", speed=0)
    run = ended(page, plan)["run"]
    document = page.get(f"/v1/runs/{run}").json()
    obeys(page, "/v1/runs/{run}", document)
    reported = [each["data"] | {"at": each["at_us"] / 1e6} for each in document["records"]
            if each["kind"] == "LOG"]  # fmt: skip
    assert [each["world"] for each in reported] == [
        *("drive", "pose", "arrive", "say", "drive", "pose", "arrive"),
    ]
    drive, pose, arrive, say, back, *_ = reported
    length = sum(math.dist(a, b) for a, b in zip(drive["way"], drive["way"][1:], strict=False))
    assert drive["at"] + length / drive["speed"] <= pose["at"] + 1e-3
    assert (pose["x"], pose["y"]) == tuple(drive["way"][-1]) == (arrive["x"], arrive["y"])
    assert (say["text"], say["x"], back["way"][0]) == ("Here I am.", 2.0, [2.0, -0.5])
    assert document["world_at"] == page.get("/v1/worlds/home").json()
    assert (document["plan"], document["pose"], document["begun_s"]) == (TOUR, None, 0.0)


def test_who_does_not_choose_gets_the_world_as_the_plan_before_has_left_it(
    page: httpx.Client,
) -> None:
    first, fresh = begin(page), begin(page, world="home", speed=0)
    second = begin(page)
    runs = [page.get(f"/v1/runs/{ended(page, plan)['run']}").json()
            for plan in (first, fresh, second)]  # fmt: skip
    assert (runs[1]["begun_s"], runs[1]["pose"]) == (0.0, None)
    assert runs[2]["begun_s"] >= runs[0]["length_us"] / 1e6
    assert [round(each, 2) for each in runs[2]["pose"]] == [0.0, 0.0, 0.0]
    assert runs[2]["seed"] - runs[0]["seed"] == int(second) - int(first)


def test_an_action_that_somebody_lets_fail(page: httpx.Client, live: Service) -> None:
    plan = begin(page, world="home", speed=2.0)
    until(page, plan, lambda state: state["clock_us"] > 300_000)
    assert do(page, plan, "fail", node=99)["why"] == "the plan has no such runner"
    assert do(page, plan, "fail", element="/Plan/Runner[2]")["why"] == "this runner is not running"
    wrong = page.post(f"/v1/plans/{plan}/fail", json={"node": 1, "element": "/Plan/Runner[1]"})
    assert wrong.status_code == 422
    empty = page.post(f"/v1/plans/{plan}/fail")
    assert (empty.status_code, empty.json()["detail"]) == (
        422,
        "Value error, name either a node or an element",
    )
    assert do(page, plan, "fail", element="/Plan/Runner[1]", message="a cat")["success"]
    end = ended(page, plan)
    assert end["status"] == "GAVE_UP"
    records = [data for kind, _, data in events(page, plan) if kind == "record"]
    failed = next(each for each in records if each["kind"] == "FAILED")
    assert (failed["element"], failed["message"]) == ("/Plan/Runner[1]", "a cat")
    assert main(["replay", live.journal, "--run", str(end["run"])]) == 0


def test_a_run_that_stands_still_is_cancelled(page: httpx.Client) -> None:
    plan = begin(page, "<Plan>" + GOOD[6:], world="drawn", paused=True)
    until(page, plan, lambda state: state["paused"] and state["run"] is not None)
    assert do(page, plan, "cancel", reason="enough")["success"]
    end = ended(page, plan)
    assert (end["status"], end["world"], end["paused"]) == ("CANCELLED", "drawn", False)


def test_a_world_that_there_is_not(page: httpx.Client) -> None:
    before = page.get("/v1/plans").json()["total"]
    response = page.post("/v1/plans", json={"plan": GOOD, "start": {"world": "nowhere"}})
    assert response.status_code == 422
    assert "no world 'nowhere'" in response.json()["detail"]
    for start in ({"speed": -1}, {"speed": 1e9}, {"colour": 1}, {"seed": -1}, {"paused": "yes"}):
        assert page.post("/v1/plans", json={"plan": GOOD, "start": start}).status_code == 422
    assert page.get("/v1/plans").json()["total"] == before


def test_past_runs_are_listed_the_last_one_first(page: httpx.Client) -> None:
    for _ in range(3):
        ended(page, begin(page, GOOD, world="field"))
    first = page.get("/v1/runs", params={"most": 2}).json()
    obeys(page, "/v1/runs", first)
    rest = page.get("/v1/runs", params={"before": first["next"], "most": 200}).json()
    numbers = [each["run"] for each in (*first["runs"], *rest["runs"])]
    assert numbers == list(range(numbers[0], 0, -1))
    assert rest["next"] is None
    latest = first["runs"][0]
    assert (latest["status"], latest["mode"], latest["world"]) == ("COMPLETED", "world", "field")
    whole = page.get(f"/v1/runs/{latest['run']}").json()
    some = page.get(f"/v1/runs/{latest['run']}", params={"records": 2}).json()
    path = f"/v1/runs/{latest['run']}/events"
    more = page.get(path, params={"after": some["next"], "most": 3}).json()
    obeys(page, "/v1/runs/{run}/events", more)
    left = page.get(path, params={"after": more["next"]}).json()
    assert [*some["records"], *more["records"], *left["records"]] == whole["records"]
    assert (len(some["records"]), len(more["records"]), left["next"]) == (2, 3, None)
    for wrong in ("0", "99999", "x", "-1"):
        assert page.get(f"/v1/runs/{wrong}").status_code == 404
        assert page.get(f"/v1/runs/{wrong}/events").status_code == 404
    assert page.get("/v1/runs", params={"most": "many"}).status_code == 422
    assert page.get(path, params={"after": "-1"}).status_code == 422


def test_the_nodes_of_a_run_are_those_of_its_view(page: httpx.Client) -> None:
    pytest.importorskip("gpsfsm.service.endpoints.checks", reason="nothing makes views")
    assert endpoint("view")
    run = ended(page, begin(page, world="home", speed=0))["run"]
    document = page.get(f"/v1/runs/{run}").json()
    view = document["view"]["plans"][0]
    named = [each for each in document["records"] if "node" in each]
    assert named
    assert view["automaton"] is not None
    for each in named:
        element = view["elements"][view["automaton"]["nodes"][each["node"]]["element"]]
        assert element["path"] == each["element"]


def test_a_run_goes_on_as_it_was_when_the_service_is_killed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with Service(*words(tmp_path)) as service, service.client() as client:
        first = begin(client)  # in the world of the service
        ended(client, first)
        plan, waiting = begin(client, world="home", speed=3.0), begin(client)
        until(client, plan, lambda state: state["clock_us"] > 400_000)
        do(client, plan, "pause")
        stood = until(client, plan, lambda state: state["paused"])["clock_us"]
        time.sleep(0.3)
        service.kill()
    assert main(["resume", str(tmp_path / "q.db")]) == 2  # plans wait that have another world
    assert "let 'gpsfsm serve' continue them" in capsys.readouterr().err
    with Service(*words(tmp_path)) as service, service.client() as client:
        reached = until(client, plan, lambda state: state["status"] == "RUNNING")
        assert (reached["paused"], reached["speed"], reached["world"]) == (True, 3.0, "home")
        assert abs(reached["clock_us"] - stood) < 1_000_000
        do(client, plan, "speed", speed=0)
        do(client, plan, "resume")
        assert ended(client, plan)["completed"]
        runs = [ended(client, each)["run"] for each in (first, waiting)]
        one, two = (client.get(f"/v1/runs/{run}").json() for run in runs)
        assert two["begun_s"] == one["length_us"] / 1e6  # the other world is none of its business
        assert service.stop() == 0
    with JournalReader(str(tmp_path / "q.db")) as reader:
        assert [run.status.value for run in reader.runs()] == ["COMPLETED"] * 3
    for run in ("1", "2", "3"):
        assert main(["replay", str(tmp_path / "q.db"), "--run", run]) == 0


def test_a_client_sees_the_plan_of_a_model_arrive(tmp_path: Path) -> None:
    answers(tmp_path, "I do not know.", ELSEWHERE)
    mine = ("--journal", tmp_path / "q.db", "--world", CLOSING, "--task", TASK, "--workers", "1")
    mine += ("--model", f"replay:{tmp_path / 'answers.jsonl'}")
    with Service(*mine) as service, service.client() as client:
        assert client.get("/v1/service").json()["regenerates"] is True
        begin(client, Path(MISSION).read_text(encoding="utf-8"), world="closing", speed=0)
        seen: list[dict[str, Any]] = []
        with client.stream("GET", "/v1/queue/events") as stream:
            for line in stream.iter_lines():
                if line.startswith("data: "):
                    seen.append(json.loads(line[6:]))
                if seen and (seen[-1]["kind"], seen[-1]["plan"]) == ("ENDED", 2):
                    break
        kinds = [each["kind"] for each in seen]
        assert kinds.index("ASKED") < kinds.index("ATTEMPT") < kinds.index("GENERATED")
        assert [each["seq"] for each in seen] == list(range(1, len(seen) + 1))
        written = next(each for each in seen if each["plan"] == 2)
        assert (written["kind"], written["data"]["continues"]) == ("SUBMITTED", 1)
        tries = [each["data"] for each in seen if each["kind"] == "ATTEMPT"]
        assert [each["accepted"] for each in tries] == [False, True]
        assert "answer" not in tries[0]
        old, new = (client.get(f"/v1/runs/{run}").json() for run in (1, 2))
        assert (old["continued_by"], old["continued_by_run"]) == ("2", 2)
        assert (new["continues"], new["continues_run"], new["world"]) == ("1", 1, "closing")
        assert old["regeneration"]["accepted"] is True
        assert len(old["regeneration"]["attempts"]) == 2
        assert (new["begun_s"], new["regeneration"]) == (old["length_us"] / 1e6, None)
        later = client.get("/v1/queue/events", params={"after": "x"})
        assert later.status_code == 422


def test_a_plan_is_continued_in_its_own_world_also_after_a_restart(tmp_path: Path) -> None:
    answers(tmp_path)
    mine = (*words(tmp_path), "--world", CLOSING, "--task", TASK)
    mine += ("--model", f"replay:{tmp_path / 'answers.jsonl'}")
    with Service(*mine) as service, service.client() as client:
        plan = begin(client, Path(MISSION).read_text(encoding="utf-8"), world="closing", speed=0)
        assert ended(client, plan)["status"] == "GAVE_UP"
        service.kill()
    with Service(*mine) as service, service.client() as client:
        until_s = time.monotonic() + 60
        while client.get("/v1/plans").json()["total"] < 3:
            assert time.monotonic() < until_s
            time.sleep(0.1)
        end = ended(client, "3")
        assert (end["status"], end["continues"]) == ("COMPLETED", "2")
        assert [client.get(f"/v1/plans/{n}").json()["world"] for n in (1, 2, 3)] == ["closing"] * 3
        assert service.stop() == 0
    assert main(["replay", str(tmp_path / "q.db")]) == 0
