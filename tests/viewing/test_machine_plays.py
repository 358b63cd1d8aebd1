"""Machines in the view document: they are drawn, and their findings are played."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hypothesis import given, settings

from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.compile import compile_plan
from gpsfsm.compile.instants import CODES, GOING, Instants
from gpsfsm.compile.machines import machine_of
from gpsfsm.compile.plan_text import read_plan_or_machine
from gpsfsm.model.event import End, Event, Outcome
from gpsfsm.viewing.document import compared
from gpsfsm.viewing.plans import Viewed, seen_of
from gpsfsm.viewing.plays import play_visits
from tests.analysis.machines.random_machines import machine, machines
from tests.cases import many
from tests.viewing.support import only

if TYPE_CHECKING:
    from collections.abc import Iterable

    import networkx as nx

DOOR = Path(__file__).parents[2] / "docs" / "examples" / "door.json"


def text_of(graph: nx.MultiDiGraph[Any]) -> str:
    """A machine as a file."""
    nodes = [{"id": str(name), **data} for name, data in graph.nodes(data=True)]
    edges = [{"source": a, "target": b, **data} for a, b, data in graph.edges(data=True)]
    return json.dumps({"nodes": nodes, "edges": edges}, indent=1)


def events(play: dict[str, Any]) -> list[tuple[int, str]]:
    """The outcomes of a play, by node, in their order."""
    outcomes = (Event.SUCCEEDED, Event.FAILED)
    return [(row["node"], row["kind"]) for row in play["records"] if row["kind"] in outcomes]


def test_the_example_with_its_lassos() -> None:
    plan = only(DOOR.read_text())
    assert [row["name"] for row in plan["elements"]] == [
        "", "begin", "drive", "watch", "ask", "end",
    ]  # fmt: skip
    assert plan["elements"][0]["label"] == "machine"
    ends = [play["ends"] for play in plan["plays"]]
    assert sorted(ends) == ["ENDLESS", "ENDLESS", "STUCK", "STUCK"]
    loop = next(play for play in plan["plays"] if (3, "SUCCEEDED") in events(play))
    assert events(loop) == [(2, "SUCCEEDED"), (3, "SUCCEEDED")]
    kinds = [(row["kind"], row["node"]) for row in loop["records"]]
    assert kinds.index(("STOPPED", 1)) < kinds.index(("STARTED", 3))
    assert kinds.count(("STARTED", 1)) == 2  # it is driven again
    assert "ENDED" not in [row["kind"] for row in loop["records"]]
    assert loop["story_at"] == sorted(loop["story_at"])


@settings(max_examples=many(60), deadline=None)
@given(machines())
def test_every_scenario_of_a_machine_is_played(graph: nx.MultiDiGraph[Any]) -> None:
    plan, _ = machine_of(graph)
    if plan is None:
        return
    text = text_of(graph)
    shown = only(text)
    beyond = messages_beyond_the_end(text)
    for finding in shown["findings"]:
        assert not finding["ends"] or (finding["play"] < 0) == (finding["message"] in beyond)
        if finding["play"] >= 0:
            play = shown["plays"][finding["play"]]
            assert play["ends"] == finding["ends"]
            _described_as_played(play, shown["automaton"]["nodes"])


def messages_beyond_the_end(text: str) -> set[str]:
    """The messages of findings whose scenario goes on after the run has ended: no play does."""
    plan = read_plan_or_machine(text).plan
    assert plan is not None
    compiled = compile_plan(plan)
    instants = Instants(compiled.automaton)
    number = {plan.path(runner): place for place, runner in enumerate(plan.runners)}
    beyond = set()
    for finding in check_text(text, "m.json", CheckOptions()).findings:
        at = instants.first().configuration
        for path, outcome in finding.scenario.outcomes if finding.scenario else ():
            if at.ended != GOING:
                beyond.add(finding.message)
            if outcome is not Outcome.HANG:
                event = CODES[Event(outcome.value)]
                at = instants.after(at, number[path], event).configuration
    return beyond


def _described_as_played(play: dict[str, Any], nodes: Iterable[dict[str, Any]]) -> None:
    """Each sentence about an outcome stands at the record of that outcome."""
    kinds = {" succeeds": "SUCCEEDED", " fails": "FAILED"}
    for sentence, at in zip(play["story"], play["story_at"], strict=True):
        for ending, kind in kinds.items():
            if sentence.endswith(ending):
                record = play["records"][at]
                assert record["kind"] == kind
                label = list(nodes)[record["node"]]["label"]
                assert sentence.startswith(label[0])


def test_a_malformed_machine_is_shown_with_its_text_and_findings() -> None:
    shown = only('{"nodes": [{"id": "a", "kind": "runner"}], "edges": []}')
    assert shown["automaton"] is None
    assert shown["source"].startswith("{")
    assert {finding["rule"] for finding in shown["findings"]} == {"GP117"}


def test_a_machine_too_large_to_be_decided_is_drawn() -> None:
    lines = [f"start SUCCEEDED r{number}" for number in range(17)]
    shown = only(text_of(machine(*lines, "r0 SUCCEEDED end", "r1 FAILED r1")))
    assert shown["verdict"] == "undecided"
    assert len(shown["automaton"]["nodes"]) == 20


def test_a_difference_between_machines_is_played_on_either_side() -> None:
    options = CheckOptions()
    other = machine("start SUCCEEDED a", "a FAILED a", "a SUCCEEDED end", "a FAILED stop b")
    other.add_edge("a", "b", event="SUCCEEDED")
    graphs = (machine("start SUCCEEDED a", "a FAILED a", "a SUCCEEDED end"), other)
    texts = ["<Plan/>", *map(text_of, graphs), DOOR.read_text()]
    seen = [seen_of(Viewed(each, check_text(each, "m.json", options)), options) for each in texts]
    for first, second in ((1, 2), (0, 1), (1, 3)):
        answer = compared((seen[first], seen[second]), options)
        assert answer["verdict"] == "different"
        for play in answer["plays"]:
            assert play["ends"] in [*map(str, End)]
            assert len(play["story_at"]) == len(play["story"])
            assert all(0 <= place < len(play["records"]) for place in play["story_at"])
    assert compared((seen[3], seen[3]), options)["verdict"] == "equal"


def test_visits_of_a_difference_are_played_one_by_one() -> None:
    lines = ("start SUCCEEDED a", "a FAILED b", "b FAILED c", "a SUCCEEDED end")
    one = machine(*lines, "b SUCCEEDED a", "c SUCCEEDED a")
    for name in "bc":
        one.nodes[name]["interface"] = "a"
    plan, _ = machine_of(one)
    assert plan is not None
    records, places, ends = play_visits(
        compile_plan(plan), [(0, Outcome.FAILED), (1, Outcome.SUCCEEDED), (0, Outcome.FAILED)]
    )
    assert ends == "COMPLETED"  # whatever comes after these succeeds
    failed = [place for place, row in enumerate(records) if row["kind"] == "FAILED"]
    assert [places[0], places[2]] == failed
