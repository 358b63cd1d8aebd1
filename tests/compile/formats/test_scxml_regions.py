"""SCXML of any automaton: it is read back as the same, and other engines run it as we say."""

from __future__ import annotations

import json
import os
import random
import re
import shutil
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import Phase, given, settings

import gpsfsm
from gpsfsm.compile import compile_plan
from gpsfsm.compile.formats import CannotSayError
from gpsfsm.compile.formats.scxml_writing import write_regions as write
from gpsfsm.compile.plan_text import read_plan, read_plan_or_machine
from gpsfsm.compile.units import MachinePlan
from gpsfsm.equivalence import convert_plan
from gpsfsm.equivalence.comparison import compare
from tests.analysis.machines.random_machines import automaton_of, machine, machines
from tests.cases import many
from tests.compile.formats.scxml_runs import Run, random_run, shown
from tests.strategies import plans
from tests.support import plan_of

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import Any

    import networkx as nx

    from gpsfsm.model.automaton import Automaton
    from tests.oracle import P

ROOT = Path(__file__).parents[3]
PLANS = sorted((ROOT / "corpus/plans").glob("*.xml"))
SHARED = sorted((ROOT / "../shared/corpus/plans").rglob("*.xml"))
SCION = ROOT / "node_modules/@scion-scxml/scxml"
RUNS = 10


def readable() -> Iterator[tuple[Path, Automaton]]:
    for path in (*PLANS, *SHARED):
        plan = read_plan(path.read_bytes(), file=str(path)).plan
        if plan is not None:
            yield path, compile_plan(plan).automaton


def back(text: str) -> Automaton:
    parsed = read_plan_or_machine(text, file="back.scxml")
    assert parsed.plan is not None, parsed.problems
    return compile_plan(parsed.plan).automaton


def connections(automaton: Automaton) -> set[tuple[int, str, int]]:
    starts = dict.fromkeys(automaton.starts, 0)
    return {
        (starts.get(source, source), event.value, target)
        for source, event, target in automaton.edges
    }


# -- there and back ----------------------------------------------------------------------------


def test_every_plan_of_the_corpus_comes_back_as_the_same() -> None:
    count = 0
    for path, automaton in readable():
        text = write(automaton)
        assert str(gpsfsm.diff(path, text)) == "the plans do the same", path
        count += 1
    assert count >= len(PLANS)


def test_every_plan_of_the_corpus_is_converted() -> None:
    for _, automaton in readable():
        assert "<scxml" in convert_plan(automaton.plan, "scxml")


@given(machines())
@settings(max_examples=many(100))
def test_machines_come_back(graph: nx.MultiDiGraph[Any]) -> None:
    automaton = automaton_of(graph)
    try:
        text = write(automaton)
    except CannotSayError:
        return
    again = back(text)
    assert compare(automaton.plan, again.plan) is None
    assert write(again).count("<transition") == text.count("<transition")


def test_a_machine_that_stops_others_comes_back() -> None:
    door = ROOT / "docs/examples/door.json"
    automaton = back(door.read_text(encoding="utf-8"))
    assert compare(automaton.plan, back(write(automaton)).plan) is None


def test_texts_in_parameters_come_back() -> None:
    graph = machine("start SUCCEEDED a", "a SUCCEEDED end", "a STARTED b")
    hard = "<&\"'>\n\t é"
    graph.nodes["a"].update(parameters={"text": hard, "x": 1.5, "yes": True}, provider="p/A")
    automaton = automaton_of(graph)
    element = back(write(automaton)).plan.elements[2]
    assert dict(element.parameters) == {"text": hard, "x": 1.5, "yes": True}
    assert (element.interface, element.provider) == ("a", "p/A")


def test_a_lost_transition_is_seen() -> None:
    path = ROOT / "corpus/plans/night_guard.xml"
    text = write(dict(readable())[path])
    lost = '<transition event="RobotPoseRunner_5.succeeded" target="PromptPoseRunner_6_active"/>'
    assert lost in text
    assert str(gpsfsm.diff(path, text.replace(lost, ""))) != "the plans do the same"


def elements_of(automaton: Automaton) -> list[object]:
    return [
        [(node.kind, node.need) for node in automaton.nodes],
        sorted(automaton.edges),
        sorted(automaton.stops),
        [(each.interface, each.provider, dict(each.parameters)) for each in automaton.plan.runners],
    ]


@pytest.mark.parametrize("name", ["night_guard.xml", "door.json"])
def test_whatever_is_changed_in_a_written_text_is_refused_or_seen(name: str) -> None:
    path = ROOT / ("docs/examples" if name.endswith("json") else "corpus/plans") / name
    text = write(back(path.read_text(encoding="utf-8")))
    before = elements_of(back(text))
    lines = text.splitlines(keepends=True)
    chance = random.Random(3)  # noqa: S311
    for _ in range(many(120)):
        at = chance.randrange(1, len(lines))
        change = chance.choice(CHANGES)
        changed = "".join((*lines[:at], change(lines[at]), *lines[at + 1 :]))
        if changed == text:
            continue
        parsed = read_plan_or_machine(changed, file="back.scxml")
        if parsed.plan is None:
            assert parsed.problems
        else:
            assert isinstance(parsed.plan, MachinePlan)
            other = elements_of(compile_plan(parsed.plan).automaton) != before
            assert other or parsed.plan.approximations, changed


CHANGES = (
    lambda line: line.replace("<transition ", '<transition cond="x" '),
    lambda line: line.replace("<transition ", '<transition type="internal" '),
    lambda line: line.replace("succeeded", "failed", 1),
    lambda line: line.replace('event="', 'event="* ', 1),
    lambda line: re.sub(r' event="[^"]*"', "", line),
    lambda line: line.replace("_idle", "_active", 1),
    lambda line: line.replace(">", ' x:y="1" xmlns:x="urn:x">', 1),
    lambda line: line.replace("/>", "><log/></transition>", 1) if "<transition" in line else line,
    lambda line: "" if "<transition" in line and "/>" in line else line,
    lambda line: f'{line}<transition target="completed"/>' if "<state" in line else line,
    lambda line: f'<x:state xmlns:x="urn:x"/>{line}',
)


@given(plans(max_runners=8))
def test_plans_come_back(whole: P) -> None:
    automaton = compile_plan(plan_of(whole)).automaton
    try:
        text = write(automaton)
    except CannotSayError:
        return
    assert len(back(text).nodes) == len(automaton.nodes)
    assert len(connections(back(text))) == len(connections(automaton))
    assert write(back(text)).count("<transition") == text.count("<transition")


# -- other engines -----------------------------------------------------------------------------


def by_python_statemachine(text: str, events: list[str]) -> list[set[str]]:
    processors = pytest.importorskip(
        "statemachine.io.scxml.processor", reason="python-statemachine is not installed"
    )
    processor: Any = processors.SCXMLProcessor()
    processor.parse_scxml("machine", text)
    chart = processor.start()
    rows = [{str(state.id) for state in chart.configuration}]
    for event in events:
        chart.send(event)
        rows.append({str(state.id) for state in chart.configuration})
    return [shown(row) for row in rows]


def agree(automaton: Automaton, seed: int) -> None:
    """Random runs are the same in python-statemachine; what SCXML cannot say has been refused."""
    try:
        text = write(automaton)
    except CannotSayError:
        return
    chance = random.Random(seed)  # noqa: S311
    for _ in range(3):
        run = random_run(automaton, chance)
        assert by_python_statemachine(text, run.events) == run.active


@given(plans(max_runners=8))
@settings(max_examples=many(60))
def test_python_statemachine_runs_plans_as_we_say(whole: P) -> None:
    agree(compile_plan(plan_of(whole)).automaton, 0)


@given(machines())
@settings(max_examples=many(200))
def test_python_statemachine_runs_machines_as_we_say(graph: nx.MultiDiGraph[Any]) -> None:
    agree(automaton_of(graph), 0)


def by_scion(cases: list[tuple[str, list[str]]]) -> list[list[set[str]]]:
    if not SCION.is_dir() or shutil.which("node") is None:
        pytest.skip("no SCION: npm install --no-save --ignore-scripts @scion-scxml/scxml@4.3.27")
    lines = [json.dumps({"text": text, "events": events}) for text, events in cases]
    done = subprocess.run(
        ["node", str(Path(__file__).with_name("scion.js"))],
        input="\n".join(lines),
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
        env={**os.environ, "NODE_PATH": str(ROOT / "node_modules")},
    )
    answers = done.stdout.splitlines()
    assert len(answers) == len(cases)
    return [[shown(set(row)) for row in json.loads(answer)] for answer in answers]


def test_scion_runs_the_corpus_as_we_say() -> None:
    chance = random.Random(22)  # noqa: S311
    runs = [
        (text, random_run(automaton, chance))
        for _, automaton in readable()
        for text in [write(automaton)]
        for _ in range(RUNS)
    ]
    answers = by_scion([(text, run.events) for text, run in runs])
    assert answers == [run.active for _, run in runs]


def test_scion_runs_machines_as_we_say() -> None:
    runs: list[tuple[str, Run]] = []
    chance = random.Random(22)  # noqa: S311

    @given(machines())
    @settings(max_examples=many(300), phases=[Phase.generate], database=None)
    def collect(graph: nx.MultiDiGraph[Any]) -> None:
        automaton = automaton_of(graph)
        try:
            runs.append((write(automaton), random_run(automaton, chance)))
        except CannotSayError:
            return

    collect()
    answers = by_scion([(text, run.events) for text, run in runs])
    for (text, run), answer in zip(runs, answers, strict=True):
        assert answer == run.active, (text, run.events)


# -- what cannot be said -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("lines", "needs", "path"),
    [
        (
            ["start SUCCEEDED a", "a STARTED b", "b FAILED stop a", "b FAILED c", "c STARTED a"],
            {},
            "/machine/a",
        ),
        (
            ["start SUCCEEDED a", "a FAILED a", "a FAILED j", "a SUCCEEDED j", "j SUCCEEDED end"],
            {"j": 1},
            "/machine/j",
        ),
        (
            ["start SUCCEEDED a", "a FAILED b", "b FAILED a", "a FAILED j", "b STARTED j"],
            {"j": 2},
            "/machine/j",
        ),
        (["start SUCCEEDED a", "a FAILED end", "a FAILED lost"], {}, "/machine/end"),
    ],
)
def test_what_scxml_does_in_another_order_is_refused(
    lines: list[str], needs: dict[str, int], path: str
) -> None:
    with pytest.raises(CannotSayError) as caught:
        write(automaton_of(machine(*lines, **needs)))
    assert caught.value.path == path


# -- files that were edited --------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ('event="a_1.failed" target="b_2_active"', 'event="c_9.failed" target="b_2_active"', 19),
        ('gpsfsm:kind="runner" gpsfsm:interface="b"', 'gpsfsm:kind="runer"', 17),
        ('<parallel id="run">', '<parallel id="run"/><parallel>', 2),
        ('<parallel id="run">', '<parallel id="run"><state id="j" gpsfsm:kind="join"/>', 3),
    ],
)
def test_an_edited_file_has_problems_at_its_lines(old: str, new: str, line: int) -> None:
    text = write(automaton_of(machine("start SUCCEEDED a", "a FAILED b", "b FAILED a")))
    assert old in text
    parsed = read_plan_or_machine(text.replace(old, new), file="edited.scxml")
    assert parsed.plan is None
    assert parsed.problems[0].location.line == line
    assert parsed.problems[0].rule == "GP117"
