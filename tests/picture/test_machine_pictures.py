"""Pictures of machines: all connections are in all of them, whatever the loops."""

from __future__ import annotations

import json
import re
from itertools import combinations
from typing import TYPE_CHECKING, Any

from hypothesis import given, settings
from lxml import etree

from gpsfsm.compile.machine_files import automaton_to_graphml, read_machine
from gpsfsm.compile.machines import machine_of
from gpsfsm.model.drawing import machine_to_text, open_events
from gpsfsm.model.labels import drawn_nodes
from gpsfsm.picture import automaton_to_svg
from gpsfsm.picture.layout import draws_stops, flat_layout
from gpsfsm.viewing.picture import automaton_data
from tests.analysis.machines.random_machines import automaton_of, machine, machines
from tests.cases import many

if TYPE_CHECKING:
    import networkx as nx

    from gpsfsm.model.automaton import Automaton

DOOR = machine(
    "start SUCCEEDED drive",
    "drive STARTED watch",
    "watch SUCCEEDED stop drive",
    "drive STOPPED drive",
    "drive SUCCEEDED end",
)

REACTIVE = machine(
    *("start SUCCEEDED check", "check SUCCEEDED look", "look SUCCEEDED drive"),
    "drive SUCCEEDED end",
    *("check FAILED stop look", "check FAILED stop drive", "look FAILED stop check"),
    *("look FAILED stop drive", "drive FAILED stop check", "drive FAILED stop look"),
)


def connections(automaton: Automaton) -> list[tuple[int, str, int, bool]]:
    """All that a picture has to show: connections and open ends, as the automaton has them."""
    rows = [(source, event.value, end, False) for source, event, end in automaton.edges]
    rows += [(source, event.value, end, True) for source, event, end in automaton.stops]
    for node in automaton.nodes:
        rows += [(node.index, event.value, -1, False) for event in open_events(automaton, node)]
    return sorted(rows)


def in_dot(text: str) -> list[tuple[int, str, int, bool]]:
    arrows = re.findall(r'^  n(\d+) -> (n|open)(\w+) \[label="(\w+)( stops)?', text, re.MULTILINE)
    return sorted(
        (int(source), event, int(end) if kind == "n" else -1, bool(stops))
        for source, kind, end, event, stops in arrows
    )


def in_mermaid(text: str) -> list[tuple[int, str, int, bool]]:
    arrows = re.findall(r"^  n(\d+) -\S+\|(\w+)( stops)?\| (n|open)(\w+)$", text, re.MULTILINE)
    return sorted(
        (int(source), event, int(end) if kind == "n" else -1, bool(stops))
        for source, event, stops, kind, end in arrows
    )


@settings(max_examples=many(150), deadline=None)
@given(machines())
def test_every_connection_is_in_every_picture(graph: nx.MultiDiGraph[Any]) -> None:
    plan, _ = machine_of(graph)
    if plan is None:
        return
    automaton = plan.automaton
    wanted = connections(automaton)
    assert in_dot(automaton.to_dot()) == wanted
    assert in_mermaid(automaton.to_mermaid()) == wanted
    data = automaton_data(automaton)
    assert wanted == sorted(
        (edge["source"], edge["event"], edge["target"], edge.get("stops", False))
        for edge in data["edges"]
    )
    routed = [edge for edge in data["edges"] if len(edge["route"]) >= 4]
    bare = 0 if draws_stops(automaton) else len(automaton.stops)
    assert len(routed) == len(wanted) - bare
    assert all(edge.get("stops") for edge in data["edges"] if edge not in routed)
    svg = etree.fromstring(automaton_to_svg(automaton, all_stops=True).encode())
    lines = [each for each in svg.iter("{*}path") if "edge" in each.get("class", "").split()]
    assert len(lines) == len(wanted)
    bars = [each for each in lines if each.get("marker-end") == "url(#gpsfsm-stop)"]
    assert len(bars) == len(automaton.stops)
    listed = machine_to_text(automaton)
    assert len(re.findall("├── |└── ", listed)) == len(wanted)
    assert listed.count(" stops → ") == len(automaton.stops)


@settings(max_examples=many(150), deadline=None)
@given(machines())
def test_nothing_overlaps_and_lines_begin_and_end_at_their_nodes(
    graph: nx.MultiDiGraph[Any],
) -> None:
    plan, _ = machine_of(graph)
    if plan is None:
        return
    automaton = plan.automaton
    flat = flat_layout(automaton)
    boxes = [box for box in flat.layout.nodes if box.width]
    assert len(boxes) == len(drawn_nodes(automaton))
    for one, other in combinations(boxes, 2):
        across = one.right <= other.x or other.right <= one.x
        assert across or one.bottom <= other.y or other.bottom <= one.y
    width, height = flat.layout.size
    for edge in flat.edges:
        begin = flat.layout.nodes[edge.source]
        assert edge.route[0][1] in (round(begin.y, 1), round(begin.bottom, 1))
        assert begin.x <= edge.route[0][0] <= begin.right
        if edge.target >= 0:
            end = flat.layout.nodes[edge.target]
            assert edge.route[-1][1] in (round(end.y, 1), round(end.bottom, 1))
            assert end.x <= edge.route[-1][0] <= end.right
        assert all(0 <= x <= width and 0 <= y <= height for x, y in edge.route)


@settings(max_examples=many(60), deadline=None)
@given(machines())
def test_json_and_graphml_are_read_as_the_same_machine(graph: nx.MultiDiGraph[Any]) -> None:
    plan, _ = machine_of(graph)
    if plan is None:
        return
    for text in (plan.automaton.to_json(), automaton_to_graphml(plan.automaton)):
        read = read_machine(text)
        assert read is not None
        assert read.plan is not None, read.problems
        again = read.plan.automaton  # type: ignore[attr-defined]
        assert len(connections(again)) == len(connections(plan.automaton))
        assert len(again.stops) == len(plan.stops)


def test_dot_of_a_small_machine() -> None:
    text = automaton_of(DOOR).to_dot()
    assert '  n0 [label="start", shape=oval' in text
    assert "  n1 [label=\"drive\\nnode 'drive'\", shape=box, style=rounded];" in text
    assert (
        '  n2 -> n1 [label="SUCCEEDED stops", color="#8250df", fontcolor="#8250df", '
        "style=dashed, arrowhead=tee];"
    ) in text
    assert '  n1 -> n1 [label="STOPPED", color="#9a6700"' in text
    assert "give up" not in text  # nothing leads to it
    assert "cluster" not in text


def test_mermaid_of_a_small_machine() -> None:
    assert automaton_of(DOOR).to_mermaid() == (
        "flowchart TD\n"
        '  n0(["start"])\n'
        '  n1["drive<br/>node #39;drive#39;"]\n'
        '  open1_FAILED((" "))\n'
        '  n2["watch<br/>node #39;watch#39;"]\n'
        '  open2_FAILED((" "))\n'
        '  n3(["complete"])\n'
        "  n0 -->|SUCCEEDED| n1\n"
        "  n1 -.->|STARTED| n2\n"
        "  n1 -.->|STOPPED| n1\n"
        "  n1 -->|SUCCEEDED| n3\n"
        "  n2 -.-x|SUCCEEDED stops| n1\n"
        "  n1 -.->|FAILED| open1_FAILED\n"
        "  n2 -.->|FAILED| open2_FAILED\n"
        "  linkStyle 1 stroke:#6e7781\n"
        "  linkStyle 2 stroke:#9a6700\n"
        "  linkStyle 0,3 stroke:#1a7f37\n"
        "  linkStyle 5,6 stroke:#cf222e\n"
        "  linkStyle 4 stroke:#8250df\n"
        "  style n3 stroke:#1a7f37\n"
        "  classDef open fill:none,stroke:#6e7781\n"
        "  class open1_FAILED,open2_FAILED open\n"
    )


def picture_of(
    graph: nx.MultiDiGraph[Any], **options: bool
) -> tuple[etree._Element, list[etree._Element]]:
    """The picture of a machine, and the lines in it that stop a node."""
    svg = etree.fromstring(automaton_to_svg(automaton_of(graph), **options).encode())
    return svg, [
        each for each in svg.iter("{*}path") if each.get("class", "").startswith("edge stop")
    ]


def test_many_stops_are_counted_instead_of_drawn() -> None:
    automaton = automaton_of(REACTIVE)
    assert len(automaton.stops) > len(automaton.edges)
    svg, stops = picture_of(REACTIVE)
    assert stops == []
    [note] = [each for each in svg.iter("{*}text") if each.get("class") == "note"]
    assert f"Not drawn: {len(automaton.stops)} connections that stop a node" in (note.text or "")
    assert float(note.get("y", "")) < float(svg.get("height", ""))
    assert not any(
        " stops" in (each.text or "") for each in svg.iter("{*}text") if each is not note
    )
    titles = " ".join(each.text or "" for each in svg.iter("{*}title"))
    assert "FAILED stops look, drive" in titles, "tooltips list what a node stops"


def test_all_stops_are_drawn_on_request_and_where_they_are_few() -> None:
    automaton = automaton_of(REACTIVE)
    svg, stops = picture_of(REACTIVE, all_stops=True)
    assert len(stops) == len(automaton.stops)
    assert not [each for each in svg.iter("{*}text") if each.get("class") == "note"]
    door, bars = picture_of(DOOR)
    assert len(bars) == len(automaton_of(DOOR).stops) == 1
    assert not [each for each in door.iter("{*}text") if each.get("class") == "note"]


def test_svg_of_a_small_machine_names_its_events() -> None:
    svg = etree.fromstring(automaton_to_svg(automaton_of(DOOR)).encode())
    named = [each.text for each in svg.iter("{*}text") if "named" in each.get("class", "")]
    assert sorted(filter(None, named)) == [
        "FAILED", "FAILED", "STARTED", "STOPPED", "SUCCEEDED", "SUCCEEDED stops",
    ]  # fmt: skip
    titles = [each.text for each in svg.iter("{*}title")]
    assert titles[0] == "2 runners in a machine, and what leads to what"


def test_a_large_machine_is_drawn() -> None:
    lines = [f"r{number} SUCCEEDED r{(number * 7 + 1) % 300}" for number in range(300)]
    graph = machine("start SUCCEEDED r0", *lines, "r299 FAILED end")
    data = automaton_data(automaton_of(graph))
    assert len(json.dumps(data)) < 2_000_000
