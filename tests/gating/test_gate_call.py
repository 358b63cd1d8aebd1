"""What a gate in Python takes: texts, paths, graphs; a task, a robot, and trees if it may."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import networkx as nx
import pytest

import gpsfsm
from gpsfsm import Gate, GateOptions, UsageError, gate
from gpsfsm.checking import CheckOptions
from gpsfsm.gating import Reason

GO = '<Plan><Runner interface="{0}" provider="{0}" x="{1}" y="1"/></Plan>'
WAYPOINT = "nav2_capabilities/WaypointRunner"
GOOD = GO.format(WAYPOINT, 1)
TREE = '<root BTCPP_format="4"><BehaviorTree ID="a"><Go/></BehaviorTree></root>'
TASK = "task: Stop.\nactions:\n  stop: {interface: Stop}\nsteps:\n  - do: stop\n"
ROBOT = f"name: lab\nrunners: [{WAYPOINT}]\nmap: {{x: [-5, 5], y: [-5, 5]}}\ntolerate: 1\n"


def machine(**nodes: dict[str, Any]) -> nx.MultiDiGraph[Any]:
    graph: nx.MultiDiGraph[Any] = nx.MultiDiGraph()
    graph.add_node("__start__", kind="start")
    graph.add_node("go", kind="runner", interface=WAYPOINT, parameters={"x": 1, "y": 1})
    graph.add_node("end", kind="complete")
    graph.add_edge("__start__", "go", event="SUCCEEDED")
    for event in ("SUCCEEDED", "FAILED"):
        graph.add_edge("go", "end", event=event)
    for name, data in nodes.items():
        graph.nodes[name].update(data)
    return graph


@pytest.mark.parametrize(
    "options",
    [
        GateOptions(),
        GateOptions(check=CheckOptions()),
        GateOptions(check=CheckOptions(trees=True), allow_empty=True),
    ],
)
def test_trees_are_refused_unless_they_are_allowed(options: GateOptions) -> None:
    with Gate(options) as refusing, Gate(options, allow_trees=True) as allowing:
        assert refusing(TREE).reason is Reason.FINDINGS
        assert allowing(TREE)
    assert not gpsfsm.gate_text(TREE, "t.xml", options)


def test_a_text_is_never_a_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "plan.xml").write_text(GOOD, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    assert gate("plan.xml", budget_ms=None).reason is Reason.FINDINGS
    assert gate(Path("plan.xml"), budget_ms=None)
    with Gate() as decide:
        assert decide("plan.xml").reason is Reason.FINDINGS
        verdict = decide(Path("plan.xml"))
        assert verdict
        assert verdict.report is not None
        assert verdict.report.path == "plan.xml"
        assert decide(Path("missing.xml")).reason is Reason.UNREADABLE


def test_a_graph_is_decided_as_a_machine() -> None:
    with Gate() as decide:
        verdict = decide(machine())
        assert (verdict.accepted, verdict.to_dict()["kind"]) == (True, "machine")
        far = machine(go={"parameters": {"x": "far", "y": 1}})
        assert [each.rule for each in decide(far).findings] == ["GP205"]
        undirected = decide(nx.Graph())
        assert (undirected.reason, undirected.message) == (
            Reason.UNREADABLE,
            "the graph is not directed; use a networkx.MultiDiGraph",
        )
        assert decide(machine(go={"parameters": {"x": {1}}})).reason is Reason.UNREADABLE
    assert gate(machine(), budget_ms=None).digests == gate(machine()).digests


def test_a_task_and_a_robot_are_added_to_the_options(tmp_path: Path) -> None:
    (tmp_path / "task.yaml").write_text(TASK, encoding="utf-8")
    (tmp_path / "robot.yaml").write_text(ROBOT, encoding="utf-8")
    with Gate(task=tmp_path / "task.yaml") as decide:
        assert [each.rule[:3] for each in decide(GOOD).findings] == ["GP6"]
    strict = Gate(GateOptions(), robot=tmp_path / "robot.yaml")
    assert strict.options.check.analysis.tolerate == 1
    with strict as decide:
        assert "GP206" in [each.rule for each in decide(GO.format(WAYPOINT, 9)).findings]
        assert "GP302" in [each.rule for each in decide(GOOD).findings]
    described = gpsfsm.choose_capabilities((), robot=tmp_path / "robot.yaml")
    there = GateOptions(check=CheckOptions(capabilities=described))
    with pytest.raises(UsageError, match="Gate takes a robot once"):
        Gate(there, robot=tmp_path / "robot.yaml")


def test_what_is_no_plan_is_misuse() -> None:
    for wrong in (3, None, ["<Plan/>"]):
        with pytest.raises(
            UsageError, match=r"takes the text of a plan or a pathlib.Path or a networkx"
        ):
            gate(wrong, budget_ms=None)  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="True or False as allow_trees"):
        Gate(allow_trees="yes")  # type: ignore[arg-type]
