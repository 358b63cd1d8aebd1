from __future__ import annotations

import json
import re
import shutil
import subprocess

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gpsfsm.model.automaton import Automaton, Edge, Node, NodeKind
from gpsfsm.model.drawing import (
    automaton_to_dot,
    automaton_to_json,
    automaton_to_mermaid,
    plan_to_tree,
)
from gpsfsm.model.event import Event
from gpsfsm.model.plan import ControlType
from tests.cases import many
from tests.model.plans import PlanBuilder, single, tour

HOSTILE = (
    'a"b',
    "back\\slash",
    "ends with \\",
    "two\nlines",
    "<b>bold</b>",
    "&lt;&#60;",
    '"]; evil [label="',
    "\\N\\G\\l",
    "#quot;",
    "%%{init: {}}%%",
    "`markdown`",
    "\x1b[31m\x00\u202e",
    "\ud800",
    "end",
    "世界",
)
ANY_TEXT = st.text(st.characters(codec=None, exclude_categories=()), max_size=80)

needs_graphviz = pytest.mark.skipif(
    shutil.which("dot") is None, reason="Graphviz (dot) is not installed"
)


def graphviz(text: str) -> dict[str, object]:
    done = subprocess.run(
        ["dot", "-Tdot_json"], input=text.encode(), capture_output=True, check=True, timeout=60
    )
    assert done.stderr == b""
    document: dict[str, object] = json.loads(done.stdout)
    return document


def dot_tokens(text: str) -> list[str]:
    """Graphviz' tokens: quoted strings, words, punctuation. Fails on anything else."""
    tokens = re.findall(r'"(?:[^"\\]|\\.)*"|[\w.]+|->|[\[\]{}=,;]|\s+|.', text)
    assert "".join(tokens) == text
    assert not [token for token in tokens if token in ('"', "\\", "<", ">", "&")]
    return [token for token in tokens if not token.isspace()]


def without_strings(tokens: list[str]) -> list[str]:
    return [token for token in tokens if not token.startswith('"')]


class TestDot:
    def test_controls_are_clusters_around_their_nodes(self) -> None:
        text = automaton_to_dot(tour())
        inside = re.search(r"subgraph cluster_2 \{(.*?)\n  \}", text, re.DOTALL)
        assert inside is not None
        assert re.findall(r"^ *(\w+) \[", inside[1], re.MULTILINE) == ["n2", "n3", "n7", "n8"]
        assert 'label="parallel_all “welcome” (line 3)"' in inside[1]

    def test_labels(self) -> None:
        text = automaton_to_dot(tour())
        assert r'n1 [label="WaypointRunner\nx=1.5, y=2, …\nline 2"' in text
        assert 'n7 [label="all 2"' in text
        assert 'n8 [label="any"' in text

    def test_events_have_their_own_style(self) -> None:
        text = automaton_to_dot(tour())
        assert re.search(r'n0 -> n1 \[label="SUCCEEDED", .*style=solid', text)
        assert re.search(r'n2 -> n8 \[label="FAILED", .*style=dashed', text)
        assert re.search(r'n1 -> n3 \[label="STARTED", .*style=dotted', text)

    def test_outcomes_without_connection_end_in_an_open_point(self) -> None:
        text = automaton_to_dot(tour())
        assert re.findall(r"-> (open\w+)", text) == ["open1_FAILED", "open4_FAILED"]
        assert text.count("open1_FAILED [shape=circle") == 1

    def test_a_join_that_triggers_nothing_ends_in_an_open_point(self) -> None:
        plan = PlanBuilder()
        both = plan.control(0, ControlType.PARALLEL_ALL)
        nodes = (
            Node(0, NodeKind.START, 0),
            Node(1, NodeKind.JOIN, both, 3),
            Node(2, NodeKind.COMPLETE, 0),
            Node(3, NodeKind.GIVE_UP, 0),
        )
        automaton = Automaton.of(plan.build(), nodes, (Edge(0, Event.SUCCEEDED, 1),) * 4)
        assert 'n1 [label="3 of 4"' in automaton_to_dot(automaton)
        assert "n1 -> open1_SUCCEEDED" in automaton_to_dot(automaton)

    @pytest.mark.parametrize("text", HOSTILE)
    def test_hostile_labels_change_nothing_but_labels(self, text: str) -> None:
        expected = without_strings(dot_tokens(automaton_to_dot(single("plain", a="plain"))))
        tokens = dot_tokens(automaton_to_dot(single(text, a=text)))
        assert without_strings(tokens) == expected

    @given(ANY_TEXT)
    def test_any_text_stays_inside_its_quotes(self, text: str) -> None:
        expected = without_strings(dot_tokens(automaton_to_dot(single("plain", a="plain"))))
        tokens = dot_tokens(automaton_to_dot(single(text or "x", a=text)))
        assert without_strings(tokens) == expected

    @needs_graphviz
    def test_graphviz_reads_the_tour(self) -> None:
        drawn = graphviz(automaton_to_dot(tour()))
        edges = drawn["edges"]
        objects = drawn["objects"]
        assert isinstance(edges, list)
        assert isinstance(objects, list)
        assert len(edges) == len(tour().edges) + 2  # two open ends
        names = {thing["name"] for thing in objects}
        assert {"cluster_2", "cluster_5", "cluster_7", "n0", "n13", "open4_FAILED"} <= names

    @needs_graphviz
    @given(ANY_TEXT)
    @settings(max_examples=many(25), deadline=None)
    def test_graphviz_reads_any_text(self, text: str) -> None:
        drawn = graphviz(automaton_to_dot(single(text or "x", a=text)))
        objects = drawn["objects"]
        assert isinstance(objects, list)
        names = sorted(thing["name"] for thing in objects)
        assert names == ["cluster_1", "n0", "n1", "n2", "n3", "open1_FAILED"]


class TestMermaid:
    def test_subgraphs_nodes_and_arrows(self) -> None:
        lines = automaton_to_mermaid(tour()).splitlines()
        assert lines[0] == "flowchart TD"
        assert '  subgraph c2 ["parallel_all “welcome” (line 3)"]' in lines
        assert '  n1["WaypointRunner<br/>x=1.5, y=2, …<br/>line 2"]' in lines
        assert '    n7(("all 2"))' in lines
        assert "  n2 -.->|FAILED| n8" in lines
        assert "  n4 -.->|FAILED| open4_FAILED" in lines
        starts = sum(line.strip().startswith("subgraph ") for line in lines)
        assert starts == sum(line.strip() == "end" for line in lines) == 3

    def test_link_styles_name_the_right_arrows(self) -> None:
        lines = automaton_to_mermaid(tour()).splitlines()
        arrows = [line.split("|")[1] for line in lines if ">|" in line]
        for line in lines:
            if "linkStyle" in line:
                numbers = [int(number) for number in line.split()[1].split(",")]
                assert len({arrows[number] for number in numbers}) == 1
        assert sum("linkStyle" in line for line in lines) == len(set(arrows))

    @given(ANY_TEXT)
    def test_any_text_stays_inside_its_quotes(self, text: str) -> None:
        def shape(drawn: str) -> str:
            return re.sub(r'"[^"]*"', '""', drawn)

        drawn = automaton_to_mermaid(single(text or "x", a=text))
        assert shape(drawn) == shape(automaton_to_mermaid(single("plain", a="plain")))
        for label in re.findall(r'"([^"]*)"', drawn):
            plain = re.sub(r"#\d+;|<br/>", "", label)
            assert not set(plain) & set("#;<>&%{}[]|`\\'\"\n\x1b")

    def test_a_quote_is_an_entity(self) -> None:
        assert 'n1["a#34;b<br/>line 3"]' in automaton_to_mermaid(single('a"b'))


class TestJson:
    def test_nodes_and_edges_are_complete(self) -> None:
        automaton = tour()
        document = json.loads(automaton_to_json(automaton))
        assert [node["index"] for node in document["nodes"]] == list(range(14))
        assert [(edge["source"], edge["event"], edge["target"]) for edge in document["edges"]] == [
            (edge.source, edge.event.value, edge.target) for edge in automaton.edges
        ]
        assert (document["complete"], document["give_up"]) == (12, 13)
        assert document["nodes"][1]["parameters"] == {"x": 1.5, "y": 2, "frame": "map"}
        assert document["nodes"][7]["need"] == 2

    def test_values_that_json_does_not_know_are_text(self) -> None:
        document = json.loads(
            automaton_to_json(single("x", a=float("inf"), b=float("nan"), c=True))
        )
        assert document["nodes"][1]["parameters"] == {"a": "inf", "b": "nan", "c": True}

    def test_an_automaton_without_edges(self) -> None:
        nodes = (
            Node(0, NodeKind.START, 0),
            Node(1, NodeKind.COMPLETE, 0),
            Node(2, NodeKind.GIVE_UP, 0),
        )
        automaton = Automaton.of(PlanBuilder().build(), nodes, ())
        assert json.loads(automaton_to_json(automaton))["edges"] == []
        assert "->" not in automaton_to_dot(automaton)
        assert ">|" not in automaton_to_mermaid(automaton)


class TestTree:
    def test_the_tour(self) -> None:
        assert plan_to_tree(tour().plan) == (
            " 1  plan “tour”\n"
            " 2  ├── nav2_capabilities/WaypointRunner x=1.5 y=2 frame=map (nav2)\n"
            " 3  ├── parallel_all “welcome”\n"
            " 4  │   ├── speech/SayRunner text=hello (tts)\n"
            " 5  │   └── camera/PhotoRunner (cam)\n"
            " 6  ├── recovery\n"
            " 7  │   └── speech/HelpRunner (tts)\n"
            " 8  └── parallel_any\n"
            " 9      ├── nav2_capabilities/WaypointRunner x=0 (nav2)\n"
            "10      └── nav2_capabilities/WaypointRunner x=9 (nav2)\n"
            "11  x/FabricCompletionRunner (left out: completion is implied)\n"
        )

    def test_rails_stop_after_the_last_child(self) -> None:
        plan = PlanBuilder()
        outer = plan.control(0, ControlType.SEQUENTIAL)
        inner = plan.control(outer, ControlType.PARALLEL_ANY)
        plan.runner(inner, "a/A")
        plan.control(inner, ControlType.SEQUENTIAL)
        plan.runner(0, "b/B")
        assert plan_to_tree(plan.build()) == (
            "1  plan\n"
            "2  ├── sequential\n"
            "3  │   └── parallel_any\n"
            "4  │       ├── a/A\n"
            "5  │       └── sequential\n"
            "6  └── b/B\n"
        )

    @given(ANY_TEXT)
    def test_any_text_stays_on_its_line(self, text: str) -> None:
        assert len(plan_to_tree(single(text, a=text).plan).splitlines()) == 3


def test_deep_nesting_does_not_exhaust_the_stack() -> None:
    plan = PlanBuilder()
    parent = 0
    for _ in range(1200):
        parent = plan.control(parent, ControlType.SEQUENTIAL)
    runner = plan.runner(parent, "a/A")
    nodes = (
        Node(0, NodeKind.START, 0),
        Node(1, NodeKind.RUNNER, runner),
        Node(2, NodeKind.COMPLETE, 0),
        Node(3, NodeKind.GIVE_UP, 0),
    )
    automaton = Automaton.of(plan.build(), nodes, (Edge(0, Event.SUCCEEDED, 1),))
    assert automaton_to_dot(automaton).count("subgraph") == 1200
    assert automaton_to_mermaid(automaton).count("subgraph") == 1200
    assert plan_to_tree(automaton.plan).count("\n") == 1202


def test_the_methods_of_the_automaton_draw_the_same() -> None:
    automaton = tour()
    assert automaton.to_dot() == automaton_to_dot(automaton)
    assert automaton.to_mermaid() == automaton_to_mermaid(automaton)
    assert automaton.to_json() == automaton_to_json(automaton)
