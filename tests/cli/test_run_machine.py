"""``gpsfsm run`` with a machine: it runs, it ends, and its journal can be read again."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import networkx as nx
import pytest

from tests.analysis.machines.random_machines import machine
from tests.cli.support import run

DOOR = Path(__file__).parents[2] / "docs" / "examples" / "door.json"
WAIT = "generic_capabilities/WaitRunner"


def written(file: Path, *connections: str, **needs: int) -> Path:
    """A file with a machine whose runners wait for a moment."""
    graph = machine(*connections, **needs)
    nodes: list[dict[str, Any]] = []
    for name, data in graph.nodes(data=True):
        row = {"id": name, **data}
        if data["kind"] == "runner":
            row |= {"interface": WAIT, "parameters": {"seconds": 0.05}}
        nodes.append(row)
    edges = [{"source": a, "target": b, **data} for a, b, data in graph.edges(data=True)]
    file.write_text(json.dumps({"nodes": nodes, "edges": edges}), encoding="utf-8")
    return file


def test_a_machine_with_a_loop_and_a_stop_runs_and_its_journal_replays(tmp_path: Path) -> None:
    done = run("run", DOOR, "--force", "--seed", "11", "--journal", "j.db", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    text = done.stdout.decode()
    assert "WaypointRunner (x=4.0, y=0.5) stopped" in text
    assert "WaypointRunner (x=4.0, y=0.5) started: visit 2" in text
    assert text.splitlines()[-1].startswith("COMPLETED after")
    again = run("replay", "j.db", cwd=tmp_path)
    assert again.returncode == 0
    assert b"replayed and simulated again" in again.stdout
    events = run("events", "j.db", "--format", "jsonl", cwd=tmp_path)
    rows = [json.loads(line) for line in events.stdout.splitlines()[1:]]
    visits = [row.get("message", "") for row in rows if row["kind"] == "STARTED"]
    assert visits.count("visit 2") == 2


def test_a_machine_with_errors_is_not_run_unless_it_is_forced() -> None:
    refused = run("run", DOOR)
    assert refused.returncode == 1
    assert b"GP306" in refused.stderr
    assert not refused.stdout


def test_a_simulated_run_ends_by_its_bound(tmp_path: Path) -> None:
    file = written(tmp_path / "m.json", "start SUCCEEDED a", "a SUCCEEDED b", "b SUCCEEDED a")
    done = run("run", file, "--force", "--failure", "0", "--max-visits", "7")
    assert done.returncode == 1
    assert b"7 visits have begun, and --max-visits allows no more" in done.stdout
    assert b"CANCELLED after" in done.stdout
    without = run("run", file, "--force", "--failure", "0")
    assert without.returncode == 1
    assert b"1,000 visits have begun" in without.stdout


def test_a_machine_in_graphml_runs_as_well(tmp_path: Path) -> None:
    graph = machine("start SUCCEEDED a", "a FAILED a", "a SUCCEEDED end")
    file = tmp_path / "m.graphml"
    nx.write_graphml(graph, file)
    done = run("run", file, "--force", "--failure", "0.5", "--seed", "2")
    assert done.returncode == 0
    assert b"COMPLETED" in done.stdout


def test_real_runners_of_a_machine_act_and_are_stopped(tmp_path: Path) -> None:
    file = written(
        tmp_path / "m.json",
        *("start SUCCEEDED a", "a SUCCEEDED j", "j SUCCEEDED end", "a SUCCEEDED a"),
        *("start SUCCEEDED c", "c SUCCEEDED j"),
        j=2,
    )
    done = run("run", file, "--real", "--force")
    assert done.returncode == 0, (done.stdout, done.stderr)
    assert b"started: visit 2" in done.stdout
    assert done.stdout.splitlines()[-1].startswith(b"COMPLETED after")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--engine", "fabric-v2"), b"a machine cannot be run as an engine would run it"),
        (("--world", "w.yaml", "--model", "ollama:m"), b"a language model continues plans"),
    ],
)
def test_what_runs_do_with_plans_only_is_refused(
    options: tuple[str, ...], message: bytes, tmp_path: Path
) -> None:
    (tmp_path / "w.yaml").write_text("world: 1\n", encoding="utf-8")
    refused = run("run", DOOR, "--force", *options, cwd=tmp_path)
    assert refused.returncode == 2
    assert message in refused.stderr


def test_a_malformed_machine_is_not_run_even_if_it_is_forced(tmp_path: Path) -> None:
    file = tmp_path / "m.json"
    file.write_text('{"nodes": [{"id": "a", "kind": "runner"}], "edges": []}', encoding="utf-8")
    refused = run("run", file, "--force")
    assert refused.returncode == 2
    assert b"GP117" in refused.stderr
