"""Behaviour trees in the plan queue: they are set, followed, cancelled and outlive the process."""

from __future__ import annotations

import os
import signal
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.cli import main
from tests.cli.regenerating import CLOSING, ELSEWHERE, TASK, answers
from tests.conftest import REPO
from tests.service.real import RealService, held, until
from tests.service.support import Service, ended, events

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    import httpx

NAV2 = REPO / "docs" / "examples" / "nav2"
DEPOT = (NAV2 / "depot.xml").read_text(encoding="utf-8")
GRASP = (REPO / "corpus" / "trees" / "grasp.xml").read_text(encoding="utf-8")
"""Its leaves are none of the robot's."""
SIMPLE = """<root BTCPP_format="4"><BehaviorTree ID="Main"><Fallback>
  <IsBatteryLow/> <Sequence> <Wait wait_duration="1"/> <Spin spin_dist="1"/> </Sequence>
</Fallback></BehaviorTree></root>"""
PATROL = (REPO / "corpus" / "rules" / "GP816" / "pass-reactive.xml").read_text(encoding="utf-8")
"""It never completes: it goes on until it fails, or until somebody cancels it."""
WRONG = '<root BTCPP_format="4"><BehaviorTree ID="Main"><Inverter/></BehaviorTree></root>'
DRIVE = """<root BTCPP_format="4">
  <BehaviorTree ID="Main">
    <NavigateToPose goal="8;1;0"/>
  </BehaviorTree>
</root>"""


def words(folder: Path, *more: object) -> tuple[object, ...]:
    usual = ("--journal", folder / "q.db", "--durability", "process", "--workers", "1")
    return (*usual, "--world", NAV2 / "depot.yaml", "--robot", NAV2 / "robot.yaml", *more)


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    with Service(*words(tmp_path_factory.mktemp("trees"))) as running:
        yield running


@pytest.fixture
def client(service: Service) -> Iterator[httpx.Client]:
    with service.client() as connected:
        yield connected


def begin(client: httpx.Client, tree: str, **start: Any) -> str:
    answer = client.post("/v1/plans", json={"plan": tree, "name": "tree.xml", "start": start})
    assert answer.status_code == 200, answer.text
    number: str = answer.json()["plan_id"]
    return number


def state(client: httpx.Client, plan: str) -> dict[str, Any]:
    answer = client.get(f"/v1/plans/{plan}")
    assert answer.status_code == 200, answer.text
    about: dict[str, Any] = answer.json()
    return about


def run_of(client: httpx.Client, plan: str) -> dict[str, Any]:
    answer: dict[str, Any] = client.get(f"/v1/runs/{state(client, plan)['run']}").json()
    return answer


@pytest.mark.parametrize("tree", [SIMPLE, GRASP, DEPOT], ids=["a plan", "of no robot", "a machine"])
def test_a_tree_runs_and_its_events_name_its_nodes(client: httpx.Client, tree: str) -> None:
    plan = begin(client, tree, world="depot", seed=1)
    assert ended(client, plan)["status"] in ("COMPLETED", "GAVE_UP")
    run = run_of(client, plan)
    view = run["view"]["plans"][0]
    nodes, elements = view["automaton"]["nodes"], view["elements"]
    started = [each for each in run["records"] if each["kind"] == "STARTED"]
    assert started
    for each in run["records"]:
        if "node" in each and each["kind"] != "JOINED":
            element = elements[nodes[each["node"]]["element"]]
            assert element["path"] == each["element"]
            assert element["path"].startswith("/root/BehaviorTree")
    seqs = [data["seq"] for kind, _, data in events(client, plan) if kind == "record"]
    assert seqs == [each["seq"] for each in run["records"]]


def test_the_leaves_of_a_tree_move_the_robot_of_the_world(client: httpx.Client) -> None:
    plan = begin(client, DEPOT, world="depot", seed=1)
    assert ended(client, plan)["completed"]
    records = run_of(client, plan)["records"]
    poses = [each["data"] for each in records if each.get("data", {}).get("world") == "pose"]
    assert (poses[-1]["x"], poses[-1]["y"]) == (6.0, 4.0)
    failed = [each["message"] for each in records if each["kind"] == "FAILED"]
    assert "no way leads to (6, 4): the zone 'gate' is closed" in failed


def test_a_tree_that_is_wrong_is_not_queued(client: httpx.Client) -> None:
    answer = client.post("/v1/plans", json={"plan": WRONG})
    assert answer.status_code == 422
    assert any(each.startswith("GP8") for each in answer.json()["rejected_list"])
    unfilled = DRIVE.replace("8;1;0", "{somewhere}")
    answer = client.post("/v1/plans", json={"plan": unfilled})
    assert answer.status_code == 422
    assert "3: NavigateToPose: the value of {somewhere} is unknown" in answer.json()["detail"]


def test_a_gate_request_alone_takes_trees_only_if_it_says_so(client: httpx.Client) -> None:
    answers = [
        client.post("/v1/gate", json={"plan": tree, **more}).json()
        for tree, more in ((SIMPLE, {}), (SIMPLE, {"trees": True}), (GRASP, {"trees": True}))
    ]
    assert [answer["verdict"] for answer in answers] == ["rejected", "accepted", "undecided"]
    advice = "behaviour trees are decided only if the request sets trees"
    assert [advice in answer["message"] for answer in answers] == [True, False, False]
    assert answers[2]["message"].endswith("'GripperFull' stands for no runner on the robot 'nav2'")


def test_a_tree_that_goes_on_for_ever_is_cancelled(client: httpx.Client) -> None:
    plan = begin(client, PATROL, world="drawn", speed=0.01)
    until(lambda: state(client, plan)["status"] == "RUNNING")
    waiting = begin(client, DRIVE, world="depot")
    assert client.post(f"/v1/plans/{plan}/cancel").json()["success"]
    assert ended(client, plan)["status"] == "CANCELLED"
    last = {}
    for each in run_of(client, plan)["records"]:
        if "node" in each:
            last[each["node"]] = each["kind"]
    assert "STARTED" not in last.values()
    assert ended(client, waiting)["completed"]


def test_a_watcher_steps_through_a_tree_and_lets_a_leaf_fail(client: httpx.Client) -> None:
    plan = begin(client, DRIVE, world="depot", paused=True)
    until(lambda: state(client, plan)["status"] == "RUNNING")
    path = "/root/BehaviorTree[1]/NavigateToPose[1]"

    def is_started() -> bool:
        assert client.post(f"/v1/plans/{plan}/step", json={"events": 1}).json()["success"]
        return any(each["kind"] == "STARTED" for each in run_of(client, plan)["records"])

    until(is_started)
    failed = client.post(f"/v1/plans/{plan}/fail", json={"element": path, "message": "a cat"})
    assert failed.json()["success"], failed.text
    client.post(f"/v1/plans/{plan}/resume")
    assert ended(client, plan)["status"] == "GAVE_UP"
    assert any(each.get("message") == "a cat" for each in run_of(client, plan)["records"])


def test_trees_go_on_when_the_service_or_its_queue_is_killed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with Service(*words(tmp_path, "--speed", "4")) as service, service.client() as client:
        first, second = begin(client, DEPOT, seed=1), begin(client, DRIVE)
        until(lambda: state(client, first)["clock_us"] > 1_000_000)
        (queue,) = [pid for pid, what in service.children().items() if "running.serving" in what]
        os.kill(queue, signal.SIGKILL)
        until(lambda: state(client, first)["clock_us"] > 2_000_000)
        service.kill()
    assert main(["events", str(tmp_path / "q.db")]) == 0
    assert "NavigateToPose (goal=3.5;5;0) started" in capsys.readouterr().out
    with Service(*words(tmp_path, "--speed", "4")) as service, service.client() as client:
        assert state(client, first)["status"] == "RUNNING"
        assert client.post(f"/v1/plans/{first}/speed", json={"speed": 0}).json()["success"]
        assert ended(client, first)["completed"]
        until(lambda: state(client, second)["status"] == "RUNNING")
        assert client.post(f"/v1/plans/{second}/speed", json={"speed": 0}).json()["success"]
        assert ended(client, second)["completed"]
        seen = [number for kind, number, _ in events(client, first) if kind == "record"]
        assert seen == [str(number) for number in range(1, len(seen) + 1)]
        assert service.stop() == 0
    for run in ("1", "2"):
        assert main(["replay", str(tmp_path / "q.db"), "--run", run]) == 0


@pytest.mark.parametrize("kind", ["Sequence", "ReactiveSequence"])
def test_a_model_goes_on_with_a_plan_where_a_tree_has_failed(kind: str, tmp_path: Path) -> None:
    answers(tmp_path, ELSEWHERE)
    journal = ("--journal", tmp_path / "q.db", "--world", CLOSING, "--task", TASK)
    model = ("--model", f"replay:{tmp_path / 'answers.jsonl'}", "--workers", "1")
    look = '<Condition ID="generic_capabilities/WaitRunner" seconds="0.1"/>'
    drive = '<Action ID="nav2_capabilities/WaypointRunner" x="100" y="100"/>'
    tree = _tree(f"<{kind}>{look}{drive}</{kind}>")
    with Service(*journal, *model) as service, service.client() as client:
        plan = begin(client, tree)
        assert ended(client, plan)["status"] == "GAVE_UP"
        until(lambda: client.get("/v1/plans").json()["total"] == 2)
        went_on = ended(client, "2")
        assert (went_on["status"], went_on["continues"]) == ("COMPLETED", plan)


def _leaf(name: str, **ports: str) -> str:
    written = "".join(f' {key}="{value}"' for key, value in ports.items())
    return f'<Action ID="{name}"{written}/>'


def _tree(*leaves: str) -> str:
    inside = "\n".join(leaves)
    return f"""<root BTCPP_format="4"><BehaviorTree ID="Main"><Sequence>
{inside}
</Sequence></BehaviorTree></root>"""


MOVER = "mover_capabilities/MoveRunner"
PROGRAM = "generic_capabilities/ProcessRunner"


def test_leaves_act_for_real_under_the_names_of_runners_alone(tmp_path: Path) -> None:
    refused = {
        _tree(_leaf("Grasp")): "under the full name of a runner alone",
        _tree(_leaf(PROGRAM, command="rm -r /tmp/nothing")): "GP213 at line 2",
        _tree(_leaf(MOVER, seconds="{long}")): "at line 2",
        _tree(f'<Repeat num_cycles="{{n}}">{_leaf(MOVER)}</Repeat>'): "line 2: no runner decides",
    }
    with RealService(tmp_path / "real") as real, real.client() as client:
        assert held(client) == ""
        for tree, why in refused.items():
            answer = client.post("/v1/plans", json={"plan": tree})
            assert answer.status_code == 422, answer.text
            said = answer.json()
            assert why in "\n".join((said["detail"], *said.get("rejected_list", ())))
        assert real.moves() == []
        watch = _leaf(MOVER, seconds="0.1").replace("Action", "Condition")
        watched = f"<ReactiveSequence>{watch}{_leaf(MOVER, seconds='300')}</ReactiveSequence>"
        plan = begin(client, _tree(_leaf(MOVER, seconds="0.1"), watched))
        until(lambda: len(real.did("arrive")) >= 3)
        assert client.post(f"/v1/plans/{plan}/cancel").json()["success"]
        assert ended(client, plan)["status"] == "CANCELLED"
        assert len(real.did("go")) == len(real.did("arrive")) + len(real.did("stop"))
