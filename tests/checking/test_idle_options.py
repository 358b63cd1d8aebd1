"""Every option of a check, on every kind of input: it has its effect, or is refused by name."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import networkx as nx
import pytest

import gpsfsm
from gpsfsm.checking.option_table import BY_KEYWORD, IDLE_ON, OPTIONS, Group, Kind, group
from gpsfsm.compile.machine_files import graph_from_json
from tests.capabilities.support import INTERFACE, PROVIDER
from tests.capabilities.support import write as write_files
from tests.conftest import REPO

MACHINES = REPO / "corpus" / "machines"
GO = '<Runner interface="a/Go" provider="a/Go" x="1" y="2"/>'
PLAN = f"<Plan>{GO}{GO}</Plan>"
LEAF = '<Action ID="a/Go" x="1" y="2"/>'
TWICE = f"<Sequence>{LEAF}{LEAF}</Sequence>"
NODES = [
    {"id": "s", "kind": "start"},
    *({"id": each, "kind": "runner", "interface": "a/Go"} for each in ("g", "h")),
    {"id": "end", "kind": "complete"},
    {"id": "up", "kind": "give_up"},
]
EDGES = [
    *(("s", "SUCCEEDED", "g"), ("g", "SUCCEEDED", "h"), ("g", "FAILED", "g")),
    *(("h", "SUCCEEDED", "end"), ("h", "FAILED", "up")),
]
MACHINE = json.dumps(
    {"nodes": NODES, "edges": [{"source": s, "event": e, "target": t} for s, e, t in EDGES]}
)


def tree(inside: str) -> str:
    return f'<root BTCPP_format="4"><BehaviorTree ID="A">{inside}</BehaviorTree></root>'


def graph() -> nx.MultiDiGraph[Any]:
    return graph_from_json(MACHINE)


def corpus(name: str) -> str:
    text = (MACHINES / name).read_text(encoding="utf-8")
    text = text.replace('"charged": "succeeded"', '"charged": "succeeded", "aborted": "preempted"')
    return text.replace('"report.failed" target="report"', '"report.failed" target="failed"')


INPUTS: dict[str, tuple[str, str, str]] = {
    "plan": ("plan", "plan.xml", PLAN),
    "answer": ("plan", "answer.txt", f"Here it is:\n```xml\n{PLAN}\n```\n"),
    "tree that is a plan": ("behaviour tree", "tree.xml", tree(TWICE)),
    "tree that is a machine": (
        "behaviour tree that is no plan",
        "loop.xml",
        tree(f"<KeepRunningUntilFailure>{TWICE}</KeepRunningUntilFailure>"),
    ),
    "JSON": ("machine in JSON", "machine.json", MACHINE),
    "GraphML": ("machine in GraphML", "machine.graphml", "\n".join(nx.generate_graphml(graph()))),
    "graph": ("graph", "", ""),
    "SCXML": ("machine in XML", "door.scxml", corpus("door.scxml")),
    "YASMIN": ("machine in XML", "delivery.xml", corpus("delivery.yasmin.xml")),
    "SMACH": ("machine in Python", "patrol.py", corpus("patrol_smach.py")),
    "FlexBE": ("machine in Python", "inspection.py", corpus("inspection_flexbe.py")),
    "LangGraph": (
        "machine in JSON",
        "agent.json",
        corpus("agent.langgraph.json").replace("planner", "plan"),
    ),
}
"""By name: the kind as ``IDLE_ON`` has it, the name of a file, its text."""

RUNNERS = {
    "SCXML": "drive",
    "YASMIN": "Fetch",
    "SMACH": "move_base",
    "FlexBE": "DriveState",
    "LangGraph": "plan",
}
ONE = {option.name: 1 for option in group(Group.LIMIT)}


def values_of(option: str, name: str, folder: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """The other options, and the option with a value that should show in the report."""
    if option in ONE:
        return {}, {"limits": gpsfsm.Limits(**{option: 1})}
    keyword = next((each.keyword for each in OPTIONS if each.name == option), option)
    value: Any = {
        "engine": "fabric-v2",
        "solver": "z3",
        "faults": ["hang"],
        "no-start": ["no-start"],
        "assume": [f"never fails: {RUNNERS.get(name, 'Go')}"],
        "select": ["GP1"],
        "ignore": ["GP302", "GP304", "GP305", "GP313", "GP314", "GP306", "GP301", "GP303"],
        "capabilities": [folder / "caps"],
        "robot": folder / "robot.yaml",
        "builtin_capabilities": False,
        "max_scenarios": 0,
    }.get(option, True if keyword and BY_KEYWORD.get(keyword, OPTIONS[0]).kind is Kind.FLAG else 1)
    others = {
        "require_proof": {"rlimit": 1},
        "capabilities": {"builtin_capabilities": False},
        "builtin_capabilities": {"capabilities": [folder / "others"]},
    }
    return others.get(option, {}), {"faults" if option == "no-start" else keyword: value}


def report(name: str, folder: Path, **options: Any) -> dict[str, Any]:
    kind, file, text = INPUTS[name]
    if kind == "graph":
        checked = gpsfsm.check(graph(), **options)
    else:
        (folder / file).write_text(text, encoding="utf-8")
        checked = gpsfsm.check(folder / file, **{"from_response": name == "answer"} | options)
    return checked.plans[0].to_dict()


def verdict(name: str, folder: Path, **options: Any) -> gpsfsm.Verdict:  # type: ignore[name-defined]
    kind, file, _ = INPUTS[name]
    usual = {"budget_ms": None, "allow_trees": True, "from_response": name == "answer"}
    return gpsfsm.gate(graph() if kind == "graph" else folder / file, **usual | options)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("idle")
    sound = {
        "a/interfaces/Go.yaml": INTERFACE,
        "a/providers/Go.yaml": PROVIDER + "definition: {}\n",
    }
    for name, run in (("caps", "Go"), ("others", "Stay")):
        files = {
            file.replace("Go", run): text.replace("Grasp", run).replace("arm", "a")
            for file, text in sound.items()
        }
        write_files(made / name, files)  # type: ignore[arg-type]
    (made / "robot.yaml").write_text("name: lab\n", encoding="utf-8")
    return made


NO_REPORT = {"from_response"}  # a machine is then no answer, an answer no plan: below
CHECKED = [each.name for each in OPTIONS if each.keyword and each.name not in NO_REPORT]
CHECKED += ["no-start", *ONE]


@pytest.mark.parametrize("option", CHECKED)
@pytest.mark.parametrize("name", INPUTS)
def test_an_option_has_its_effect_or_is_refused_by_name(
    name: str, option: str, folder: Path
) -> None:
    kind = INPUTS[name][0]
    others, chosen = values_of(option, name, folder)
    table = "faults" if option == "no-start" else option
    refused = table in IDLE_ON.get(kind, {}) and option != "faults"
    before, after = report(name, folder, **others), report(name, folder, **others, **chosen)
    assert before != after
    if refused:
        flag = "--faults no-start" if option == "no-start" else f"--{option.replace('_', '-')}"
        (finding,) = [each for each in after["findings"] if each["rule"] == "GP908"]
        assert after["verdict"] == "undecided"
        assert finding["message"].startswith(f"{flag} has no effect on a {kind}: ")
        if kind != "graph" or option not in ("max_bytes", "max_elements"):  # a gate gets a text
            assert finding["message"] in verdict(name, folder, **others, **chosen).message
    else:
        assert not any("has no effect on" in each["message"] for each in after["findings"])


@pytest.mark.parametrize("name", INPUTS)
def test_what_a_task_has_no_effect_on_is_refused(name: str, folder: Path) -> None:
    kind = INPUTS[name][0]
    file = folder / "task.yaml"
    file.write_text(
        "task: Stop.\nactions:\n  stop: {interface: a/Stop}\nsteps:\n  - do: stop\n", "utf-8"
    )
    report(name, folder)
    decided = verdict(name, folder, task=file)
    if "task" in IDLE_ON.get(kind, {}):
        assert decided.message.startswith(f"--task has no effect on a {kind}: ")
        assert decided.reason.exit_code == 2
    else:
        assert "GP6" in {each.rule[:3] for each in decided.findings}


@pytest.mark.parametrize("name", INPUTS)
def test_a_raw_answer_is_no_machine(name: str, folder: Path) -> None:
    if name == "graph":
        assert "--from-response has no effect" in str(report(name, folder, from_response=True))
    elif INPUTS[name][0].startswith("machine"):
        assert report(name, folder, from_response=True)["findings"][0]["rule"] == "GP104"
    elif name == "answer":
        assert report(name, folder, from_response=False) != report(name, folder)


def test_settings_of_a_file_are_for_the_inputs_on_which_they_have_an_effect(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from gpsfsm.cli import main

    monkeypatch.chdir(tmp_path)
    Path("gpsfsm.toml").write_text('solver = "z3"\nmax-depth = 100\n', encoding="utf-8")
    Path("m.json").write_text(MACHINE, encoding="utf-8")
    Path("p.xml").write_text(PLAN, encoding="utf-8")
    assert main(["check", "m.json", "p.xml"]) == 0
    said = capsys.readouterr().out
    assert "m.json: note: --solver has no effect on a machine in JSON: " in said
    assert main(["check", "m.json", "--solver", "z3"]) == 2
    Path("gpsfsm.toml").write_text("deadline = 5\n", encoding="utf-8")
    assert main(["check", "m.json"]) == 2  # a demand is one wherever it stands
