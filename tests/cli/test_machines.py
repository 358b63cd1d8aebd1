"""Machines in check, show, diff, fuzz and gate: malformed and hostile files, and what is said."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from gpsfsm.cli import main
from tests.cli.support import write

if TYPE_CHECKING:
    from pathlib import Path

GO = "nav2_capabilities/WaypointRunner"
LOOP = f"""{{"nodes": [
  {{"id": "s", "kind": "start"}},
  {{"id": "go", "kind": "runner", "interface": "{GO}", "parameters": {{"x": 1.0, "y": 2.0}}}},
  {{"id": "e", "kind": "complete"}}],
 "edges": [
  {{"source": "s", "target": "go", "event": "SUCCEEDED"}},
  {{"source": "go", "target": "go", "event": "FAILED"}},
  {{"source": "go", "target": "e", "event": "SUCCEEDED"}}]}}
"""
STUCK = LOOP.replace('"target": "go", "event": "FAILED"', '"target": "e", "event": "SUCCEEDED"')
ODD = LOOP.replace('"kind": "complete"', '"kind": "finish"')
PLAN = f'<Plan><Runner interface="{GO}" provider="{GO}" x="1" y="2"/></Plan>'
GRAPH = '<graph edgedefault="directed">'
HEAD = '<graphml xmlns="http://graphml.graphdrawing.org/xmlns">'
DEEP = '{"nodes": [], "edges": ' + "[" * 50_000 + "]" * 50_000 + "}"

HOSTILE = {
    "no JSON": '{"nodes": [}, "edges": []}',
    "twice": '{"nodes": [], "nodes": [], "edges": []}',
    "twice in a node": '{"nodes": [{"id": "a", "kind": "start", "kind": "join"}], "edges": []}',
    "deep": DEEP,
    "huge number": LOOP.replace("1.0", "1" + "0" * 5_000),
    "long name": LOOP.replace('"go"', '"' + "g" * 300 + '"'),
    "empty name": LOOP.replace('"go"', '""'),
    "nodes of wrong types": '{"nodes": [1, null, "a", []], "edges": []}',
    "names of wrong types": '{"nodes": [{"id": {"a": 1}, "kind": "start"}], "edges": []}',
    "attributes of wrong types": LOOP.replace('"kind": "start"', '"kind": ["start"]'),
    "interfaces of wrong types": LOOP.replace(f'"{GO}"', "[1]"),
    "parameters of wrong types": LOOP.replace("1.0", "[[1]]"),
    "events of wrong types": LOOP.replace('"FAILED"', "{}"),
    "connections of wrong types": '{"nodes": [], "edges": {"a": 1}}',
    "no start": '{"nodes": [], "edges": []}',
    "no such node": LOOP.replace('"source": "go"', '"source": "gone"'),
    "another version": LOOP.replace('{"nodes"', '{"version": 99, "nodes"'),
    "immediate cycle": LOOP.replace('"FAILED"', '"STARTED"').replace(
        '"target": "go", "event": "STARTED"', '"target": "go", "event": "STARTED", "action": "stop"'
    ),
    "huge need": LOOP.replace('"kind": "complete"', '"kind": "join", "need": 1.5e300'),
    "DOCTYPE": f'<!DOCTYPE graphml [<!ENTITY a "b">]>{HEAD}{GRAPH}</graph></graphml>',
    "external entity": f'<?xml version="1.0"?><!DOCTYPE g SYSTEM "file:///x">{HEAD}</graphml>',
    "no graph": f"{HEAD}</graphml>",
    "not closed": f'{HEAD}<graph edgedefault="directed"><node id="a">',
    "undirected": f'{HEAD}<graph edgedefault="undirected"><node id="a"/></graph></graphml>',
    "keys of wrong types": (
        f'{HEAD}<key id="k" for="node" attr.name="need" attr.type="int"/>'
        f'{GRAPH}<node id="a"><data key="k">much</data></node></graph></graphml>'
    ),
    "no such key": (f'{HEAD}{GRAPH}<node id="a"><data key="k">1</data></node></graph></graphml>'),
    "parameters that are no JSON": (
        f'{HEAD}<key id="k" for="node" attr.name="parameters" attr.type="string"/>'
        '<graph edgedefault="directed"><node id="a"><data key="k">{"x": NaN, "x": 1}</data></node>'
        "</graph></graphml>"
    ),
    "nested graphs": HEAD + '<graph edgedefault="directed"><node id="a">' * 2_000,
    "hyperedges": f'{HEAD}<graph edgedefault="directed"><hyperedge/></graph></graphml>',
    "ports": (f'{HEAD}{GRAPH}<node id="a"><port name="p"/></node></graph></graphml>'),
}
TASK = """actions:
  go: {interface: WaypointRunner}
steps:
  - do: go
"""
ODD_VALUES = {
    "NaN": LOOP.replace("1.0", "NaN"),
    "Infinity": LOOP.replace("1.0", "-Infinity"),
    "huge exponent": LOOP.replace("1.0", "1e999999"),
    "control characters": LOOP.replace('"go"', '"g\\u001b[31m\\u202eo\\u0000"'),
    "lone surrogate": LOOP.replace('"go"', '"g\\ud800"'),
}
COMMANDS = {
    "check": ["check"],
    "show": ["show"],
    "diff": ["diff", "loop.json"],
    "fuzz": ["fuzz", "--runs", "3"],
    "mutate": ["fuzz", "--mutate", "--runs", "3"],
    "gate": ["gate"],
}


@pytest.fixture(autouse=True)
def files(tmp_path: Path) -> None:
    write(tmp_path)
    for name, text in {
        "loop.json": LOOP,
        "stuck.json": STUCK,
        "odd.json": ODD,
        "a.xml": PLAN,
    }.items():
        (tmp_path / name).write_text(text, encoding="utf-8")


def said(*arguments: str, capsys: pytest.CaptureFixture[str], code: int) -> str:
    assert main([*arguments]) == code
    out, err = capsys.readouterr()
    return out + err


@pytest.mark.parametrize("text", HOSTILE.values(), ids=HOSTILE)
def test_hostile_machines_are_refused_in_words(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "m.json").write_text(text, encoding="utf-8")
    for name, command in COMMANDS.items():
        if name == "gate":
            continue  # it starts a process: test_the_gate_refuses_hostile_machines
        code = main([*command, "m.json"])
        out, err = capsys.readouterr()
        assert code in (1, 2), name
        assert "Traceback" not in out + err
        assert "defect" not in out + err
        assert "\x1b" not in out + err
        assert "\u202e" not in out + err
        assert "m.json" in out + err


def test_the_gate_refuses_hostile_machines(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = []
    for number, text in enumerate(HOSTILE.values()):
        names.append(f"m{number}.json")
        (tmp_path / names[-1]).write_text(text, encoding="utf-8")
    assert main(["gate", *names, "--format", "json"]) == 1
    receipt = json.loads(capsys.readouterr().out)
    assert {each["verdict"] for each in receipt["plans"]} == {"rejected"}
    assert {each["kind"] for each in receipt["plans"]} == {"machine"}
    assert all("defect" not in each["message"] for each in receipt["plans"])


@pytest.mark.parametrize("name", COMMANDS)
def test_malformed_machines_are_findings_with_the_name_of_the_node(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    code = main([*COMMANDS[name], "odd.json"])
    out, err = capsys.readouterr()
    assert code in (1, 2)
    assert "the node 'e' has no kind, or an unknown one: 'finish'" in out + err
    assert "odd.json:4:3" in out + err


@pytest.mark.parametrize("text", ODD_VALUES.values(), ids=ODD_VALUES)
def test_odd_names_and_values_do_no_harm(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "m.json").write_text(text, encoding="utf-8")
    for name, command in COMMANDS.items():
        code = main([*command, "m.json"])
        out, err = capsys.readouterr()
        assert code in (0, 1), name
        assert "Traceback" not in out + err
        assert "defect" not in out + err
        assert "\x1b" not in out + err
        assert "\u202e" not in out + err


def test_machines_beyond_the_limits(capsys: pytest.CaptureFixture[str]) -> None:
    for name, command in COMMANDS.items():
        out = said(*command, "loop.json", "--max-elements", "2", capsys=capsys, code=2)
        assert "more than 2 nodes" in out, name
        out = said(*command, "loop.json", "--max-bytes", "100", capsys=capsys, code=2)
        assert "100 bytes" in out, name


def test_bytes_that_are_no_text(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for content in (b'{"nodes": [\xff\xfe], "edges": []}', b'{"nodes"\0: [], "edges": []}'):
        (tmp_path / "m.json").write_bytes(content)
        for command in COMMANDS.values():
            assert main([*command, "m.json"]) in (1, 2)
            assert "Traceback" not in capsys.readouterr().err


def test_diff(capsys: pytest.CaptureFixture[str]) -> None:
    assert said("diff", "loop.json", "loop.json", capsys=capsys, code=0) == (
        "loop.json and loop.json do the same in every scenario\n"
    )
    assert said("diff", "a.xml", "loop.json", capsys=capsys, code=1) == (
        "a.xml and loop.json differ; the first scenario that shows it:\n"
        "  1. WaypointRunner (x=1, y=2) fails (a.xml:1, loop.json:go)\n"
        "  then a.xml starts nothing and gives up\n"
        "       loop.json starts WaypointRunner (x=1.0, y=2.0) (go)\n"
    ).replace("starts nothing and gives up", "gives up")
    assert "--consistent" in said(
        "diff", "loop.json", "loop.json", "--consistent", capsys=capsys, code=2
    )


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["diff", "y.xml", "y.xml"], "compared is what was read, which allows more than the file"),
        (["convert", "y.xml", "--to", "scxml"], "over-approximated here, and certain in what is"),
        (["convert", "y.xml", "--to", "json"], "over-approximated here, and certain in what is"),
    ],
)
def test_what_was_over_approximated_is_told_where_it_is_lost(
    words: list[str], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    state = '<State name="A" class="A" module="m"><Transition from="ok" to="done"/></State>'
    (tmp_path / "y.xml").write_text(f'<StateMachine outcomes="done">{state}</StateMachine>')
    assert main(words) == 0
    assert f"gpsfsm: y.xml: {told}" in (said := capsys.readouterr().err)
    assert "A at line 1 (the file does not declare its outcomes)" in said


def test_gate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    accepted = "loop.json: accepted (structure only: no task was given)\n"
    assert said("gate", "loop.json", capsys=capsys, code=0) == accepted
    assert "rejected: findings" in said("gate", "stuck.json", capsys=capsys, code=1)
    for options, reason in (
        (["--engine", "fabric-v2"], "--engine has no effect on a machine in JSON"),
        (["--deadline", "60"], "--deadline has no effect on a machine in JSON"),
        (["--energy-limit", "60"], "--energy-limit has no effect on a machine in JSON"),
        (["--faults", "no-start"], "--faults no-start has no effect on a machine in JSON"),
    ):
        out = said("gate", "loop.json", *options, capsys=capsys, code=2)
        assert f"undecided: inconclusive: {reason}" in out
    (tmp_path / "task.yaml").write_text(TASK)
    out = said("gate", "loop.json", "--task", "task.yaml", capsys=capsys, code=2)
    assert "undecided: inconclusive: --task has no effect on a machine in JSON" in out


def test_receipts_say_that_it_is_a_machine(capsys: pytest.CaptureFixture[str]) -> None:
    receipt = said(
        "gate", "loop.json", "a.xml", "stuck.json", "--format", "json", capsys=capsys, code=1
    )
    plans = json.loads(receipt)["plans"]
    assert [each["kind"] for each in plans] == ["machine", "plan", "machine"]
    assert plans[0]["message"] == "the machine may run; structure only: no task was given"
    assert plans[0]["facts"]["machine"]["completes_if_fair"] == "always"
    assert len(plans[0]["digests"]["plan"]) == 64


def test_a_machine_as_it_was_accepted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    receipt = said("gate", "loop.json", "--format", "json", capsys=capsys, code=0)
    (tmp_path / "r.json").write_text(receipt)
    assert "as accepted" in said("gate", "loop.json", "--verify", "r.json", capsys=capsys, code=0)
    (tmp_path / "loop.json").write_text(LOOP + " ")
    assert "not as accepted" in said(
        "gate", "loop.json", "--verify", "r.json", capsys=capsys, code=1
    )


def test_fuzz(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = said("fuzz", "loop.json", "--runs", "60", capsys=capsys, code=0)
    assert out.startswith("loop.json: 60 runs, seed 0\n")
    one, two = (
        said("fuzz", "stuck.json", "--runs", "60", "--jobs", jobs, capsys=capsys, code=1)
        for jobs in ("1", "2")
    )
    assert one == two
    cases = str(tmp_path / "cases")
    said("fuzz", "stuck.json", "--runs", "60", "--corpus", cases, capsys=capsys, code=1)
    (case, *_) = (tmp_path / "cases").iterdir()
    assert "1 run, seed 0" in said("fuzz", "--replay", str(case), capsys=capsys, code=1)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--faults", "no-start"], "runners of a machine always start"),
        (["--consistent"], "outcomes are chosen at each visit"),
        (["--mutate", "--max-visits", "3"], "--max-visits and --mutate cannot be used together"),
        (["--max-visits", "0"], "max-visits"),
    ],
)
def test_what_machines_are_not_fuzzed_with(
    options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert message in said("fuzz", "loop.json", *options, capsys=capsys, code=2)


def test_mutants(capsys: pytest.CaptureFixture[str]) -> None:
    out = said("fuzz", "--mutate", "loop.json", capsys=capsys, code=0)
    assert "mutants: the rules notice" in out
