"""How runners are named in messages."""

from __future__ import annotations

import pytest

from gpsfsm.compile import compile_plan
from gpsfsm.compile.plan_text import read_plan
from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.capability import CHOICE
from gpsfsm.model.event import Event
from gpsfsm.model.labels import action, brief, node_label, verb
from gpsfsm.syntax import parse


@pytest.mark.parametrize(
    ("written", "named"),
    [
        ('interface="a/Go" provider="a/Go"', "Go"),
        (
            'interface="a/Go" provider="a/Go" fast="true" x="1" y="2.5"',
            "Go (x=1, y=2.5, fast=true)",
        ),
        (
            'interface="Go" provider="p" a="1" b="2" c="3" text="four"',
            "Go (text=four, a=1, b=2, …)",
        ),
        ('provider="a/Go"', "a runner without interface"),
    ],
)
def test_what_tells_runners_apart_comes_first(written: str, named: str) -> None:
    plan = parse(f"<Plan><Runner {written}/></Plan>", file="p.xml").plan
    assert plan is not None
    assert action(plan.runners[0]) == named


@pytest.mark.parametrize(
    ("interface", "words"),
    [("a/Go", ["succeeds", "fails"]), (CHOICE, ["holds", "does not hold"])],
)
def test_a_choice_neither_succeeds_nor_fails(interface: str, words: list[str]) -> None:
    text = f'<Plan><Runner interface="{interface}" provider="p"/></Plan>'
    plan = parse(text, file="p.xml").plan
    assert plan is not None
    assert [verb(plan.runners[0], each) for each in (Event.SUCCEEDED, Event.FAILED)] == words


def test_a_node_of_a_tree_is_labelled_with_its_action_and_the_number_of_its_use() -> None:
    tree = """<root BTCPP_format="4"><BehaviorTree ID="Main"><ReactiveSequence>
    <Speak text="hello"/>
    <RetryUntilSuccessful num_attempts="2"><Action ID="MoveBase" name="home" x="1"/>
    </RetryUntilSuccessful></ReactiveSequence></BehaviorTree></root>"""
    plan = read_plan(tree).plan
    assert plan is not None
    automaton = compile_plan(plan).automaton
    labels = [node_label(automaton, n) for n in automaton.nodes if n.kind is NodeKind.RUNNER]
    assert {
        ("Speak", "text=hello", "line 2"),
        ("MoveBase", "name=home, x=1", "line 3"),
        ("MoveBase@2", "name=home, x=1", "line 3"),
    } <= set(labels)
    assert not [label for label in labels if label[0].startswith("Action")]


def test_a_text_is_one_short_line() -> None:
    assert brief(" go \n home ") == "go home"
    assert brief("x" * 28) == "x" * 28
    assert brief("x" * 29) == "x" * 27 + "…"
