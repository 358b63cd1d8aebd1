"""The view document of all kinds of texts: it is always there, and always whole."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.api import check_options
from gpsfsm.syntax import Limits
from gpsfsm.tasks.load import load_task
from gpsfsm.viewing import plans as plans_of_document
from tests.fixing.support import DAMAGES, STEPS, damaged, go, say
from tests.viewing.support import document_of, only

if TYPE_CHECKING:
    from gpsfsm.checking import CheckOptions

REPO = Path(__file__).parents[2]
CORPUS = REPO / "corpus"
TEXTS = sorted(CORPUS.glob("*/*.xml"))
OF_RULES = sorted(CORPUS.glob("rules/*/fail-*.xml"))
TASK = REPO / "docs" / "examples" / "rounds.yaml"


def _options_of(file: Path) -> CheckOptions:
    """Plans that show something of an engine are seen on that engine."""
    return check_options(engine="fabric-v2" if "engines" in file.parts else "paper")


@pytest.mark.parametrize("file", TEXTS, ids=lambda file: file.stem)
def test_every_plan_of_the_corpus(file: Path) -> None:
    plan = only(file.read_bytes(), _options_of(file))
    assert plan["automaton"] is not None
    assert plan["source"] == file.read_text()
    assert len(plan["elements"]) > 1


@pytest.mark.parametrize("family", sorted({file.parent.name[:3] for file in OF_RULES}))
def test_every_plan_that_a_rule_finds_something_in(family: str) -> None:
    files = [file for file in OF_RULES if file.parent.name.startswith(family)]
    shown = document_of(*(file.read_bytes() for file in files))
    assert len(shown["plans"]) == len(files)
    for plan in shown["plans"]:
        assert plan["plays_left_out"] == 0
        for each in plan["findings"]:
            # of a goal that is missed only after the plan has completed there is no play
            late = each["rule"] == "GP315" and "parallel_any" in each["message"]
            assert late or (each["play"] >= 0) == bool(each["ends"])


@pytest.mark.parametrize("name", sorted(DAMAGES))
def test_damaged_texts(name: str) -> None:
    plan = only(damaged(name, STEPS, 1))
    assert plan["source"]
    assert plan["elements"] or plan["findings"]


@given(st.binary(max_size=200) | st.text(max_size=200))
def test_any_text_at_all(text: str | bytes) -> None:
    shown = document_of(text)
    assert shown["plans"][0]["verdict"] != "accepted"


@given(st.integers(0, len(STEPS)), st.integers(0, 40))
def test_a_plan_with_a_piece_missing(start: int, length: int) -> None:
    text = STEPS[:start] + STEPS[start + length :]
    plan = only(text)
    assert plan["source"] == text


def test_elements() -> None:
    text = (
        '<Plan>\n  <Control type="recovery" name="n">\n'
        '    <Runner interface="a/Go" provider="a/Go" x="1"/>\n  </Control>\n</Plan>\n'
    )
    plan, control, runner = only(text)["elements"]
    assert (plan["kind"], plan["line"], plan["endLine"], plan["parent"]) == ("plan", 1, 5, -1)
    assert (control["type"], control["name"], control["endLine"]) == ("recovery", "n", 4)
    assert (runner["label"], runner["detail"], runner["parent"]) == ("Go", "x=1", 1)
    assert (runner["path"], runner["column"]) == ("/Plan/Control[1]/Runner[1]", 5)
    assert not runner["reachable"]  # a recovery that recovers nothing
    assert not control["reachable"]
    assert plan["reachable"] == control["reachable"]


def test_dangling_outcomes_end_in_the_open() -> None:
    automaton = only(
        f"<Plan>{go(1, 2)}<Control type='parallel_any'>{say('a')}{say('b')}</Control></Plan>"
    )["automaton"]
    ends = [(edge["source"], edge["event"]) for edge in automaton["edges"] if edge["target"] < 0]
    names = [automaton["nodes"][source]["label"][0] for source, _ in ends]
    assert {event for _, event in ends} <= {"SUCCEEDED", "FAILED"}
    assert all(
        not any(
            (edge["source"], edge["event"]) == end and edge["target"] >= 0
            for edge in automaton["edges"]
        )
        for end in ends
    )
    assert len(names) == len(set(ends))


def test_what_remains_of_a_text_is_shown_and_said_to_be_no_plan() -> None:
    plan = only(
        f"<Plan>\n{go(1, 2)}\n<Control type='sequential'>\n{say('a')}\n<Speak/></Control>"
        f"\n{say('b')}"
    )
    assert [element["label"] for element in plan["elements"]] == [
        *("plan", "WaypointRunner", "sequential", "SpeechRunner", "SpeechRunner")
    ]
    assert plan["automaton"] is not None
    assert plan["facts"] is None
    assert any("the text is not a plan" in note for note in plan["notes"])
    assert plan["plays"] == []


def test_a_control_of_no_known_type_is_shown_without_an_automaton() -> None:
    plan = only(f"<Plan><Control type='often'>{say('a')}</Control></Plan>")
    assert len(plan["elements"]) == 3
    assert plan["automaton"] is None


def test_a_tree_that_is_not_decided_is_shown_as_it_is_written() -> None:
    text = (
        '<root BTCPP_format="4"><BehaviorTree ID="t"><Sequence><Go/>'
        '</Sequence></BehaviorTree><include path="other.xml"/></root>'
    )
    plan = only(text)
    assert "Go" in [element["label"] for element in plan["elements"]]
    assert plan["automaton"] is None
    assert plan["verdict"] == "undecided"


def test_a_file_that_was_not_read_is_told() -> None:
    shown = document_of(STEPS, None)
    assert shown["plans"][1]["source"] is None
    assert shown["plans"][1]["findings"][0]["rule"] == "GP901"
    assert shown["title"] == "2 plans"


@pytest.mark.parametrize("engine", ["paper", "fabric-v2"])
@pytest.mark.parametrize(
    "text",
    [
        "root:hunter2:1:1::/root:/bin/sh\n",
        "<config><password>hunter2</password></config>",
        "<hunter2 key='hunter2'>",
        b"\xff\xfe" + "<hunter2/>".encode("utf-16-le"),
    ],
)
def test_a_text_that_is_not_about_plans_is_not_shown(text: str | bytes, engine: str) -> None:
    """The path may be a link to anything, and a page is handed on."""
    task = load_task(TASK)
    plan = only(text, replace(check_options(engine=engine), task=task))
    assert plan["source"] is None
    assert "hunter2" not in json.dumps(plan)
    assert any("not shown" in note for note in plan["notes"])


def test_the_engine_that_is_seen() -> None:
    options = check_options(engine="fabric-v2")
    plan = only((CORPUS / "engines" / "medicine_round.xml").read_bytes(), options)
    assert plan["engine"] == "fabric-v2"
    assert [node["kind"] for node in plan["automaton"]["nodes"] if node.get("hidden")] == [
        "give_up"
    ]
    assert {play["ends"] for play in plan["plays"]} & {"HANG", "ABORT"}


def test_an_engine_that_refuses_the_text() -> None:
    plan = only("<Plan/> bye", check_options(engine="fabric-v2"))
    assert plan["engine"] == "paper"
    assert any("fabric-v2 makes no plan of this text" in note for note in plan["notes"])


def test_a_task_and_where_the_plan_leaves_it() -> None:
    options = replace(check_options(), task=load_task(TASK))
    plan = only((CORPUS / "rules/GP605/fail-no-store.xml").read_bytes(), options)
    task = plan["task"]
    assert (task["grade"], task["name"]) == ("partial", str(TASK))
    assert plan["plays"][task["play"]]["title"].startswith("GP605")
    assert "store" in task["text"]
    finding = next(each for each in plan["findings"] if each["rule"] == "GP605")
    assert (task["element"], task["line"]) == (finding["element"], finding["line"])


def test_two_plans_that_differ() -> None:
    one = f"<Plan><Control type='parallel_any'>{go(1, 2)}{say('a')}</Control>{say('b')}</Plan>"
    diff = document_of(one, one.replace("_any", "_all"), diff=True)["diff"]
    assert diff["verdict"] == "different"
    assert all(play["ends"] == "COMPLETED" for play in diff["plays"])
    left, right = (play["story"] for play in diff["plays"])
    assert left[:-1] == right[:-1]
    assert left[-1] != right[-1]


def test_two_plans_that_do_the_same() -> None:
    diff = document_of(STEPS, STEPS.replace("hall", "room"), diff=True)["diff"]
    assert (diff["verdict"], diff["plays"]) == ("equal", [None, None])


@pytest.mark.parametrize("other", ["<Plan><Runner", "", None])
def test_two_texts_of_which_one_is_no_plan(other: str | None) -> None:
    diff = document_of(STEPS, other, diff=True)["diff"]
    assert diff["verdict"] == "undecided"
    assert "not a plan" in diff["words"][0]


def test_the_same_document_twice() -> None:
    text = (CORPUS / "plans" / "tour_guide.xml").read_bytes()
    assert json.dumps(document_of(text)) == json.dumps(document_of(text))


def test_a_plan_that_is_too_large_is_not_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plans_of_document, "MOST_ELEMENTS", 3)
    plan = only(STEPS)
    assert (plan["elements"], plan["automaton"]) == ([], None)
    assert any("is not drawn" in note for note in plan["notes"])


def test_a_plan_that_is_nested_too_deeply_is_not_drawn() -> None:
    inner = say("a")
    for _ in range(1_200):
        inner = f"<Control type='sequential'>{inner}</Control>"
    options = check_options(limits=Limits(max_depth=5_000))
    plan = only(f"<Plan>{inner}</Plan>", options)
    assert (plan["elements"], plan["automaton"]) == ([], None)
    assert any("nested more than 1,000 deep" in note for note in plan["notes"])
    assert plan["facts"]["runners"] == 1


def test_a_defect_costs_a_part_and_not_the_page(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise ZeroDivisionError("of the universe")

    monkeypatch.delenv("GPSFSM_DEBUG", raising=False)
    monkeypatch.setattr(plans_of_document, "automaton_data", fail)
    plan = only(STEPS)
    assert plan["elements"]
    assert plan["automaton"] is None
    assert any("of the universe" in note for note in plan["notes"])


SUBTREES = """<root BTCPP_format="4" main_tree_to_execute="Main">
<BehaviorTree ID="Main"><ReactiveSequence name="while safe">
  <Fallback><IsSafe/><Stop/></Fallback>
  <RetryUntilSuccessful num_attempts="2"><SubTree ID="Away"/></RetryUntilSuccessful>
</ReactiveSequence></BehaviorTree>
<BehaviorTree ID="Away"><Sequence><Turn angle="90"/><Drive/></Sequence></BehaviorTree>
</root>"""


def test_uses_of_the_leaves_of_a_tree_stand_below_its_nodes() -> None:
    plan = only(SUBTREES)
    rows, automaton = plan["elements"], plan["automaton"]
    assert automaton["flat"]
    assert all(row["parent"] < place for place, row in enumerate(rows))
    for row in rows:
        base = row["path"].partition("@")[0]
        around = rows[row["parent"]]["path"].partition("@")[0]
        if row["kind"] == "runner" and row["type"] not in ("choice", "tick"):
            assert base.startswith(f"{around}/")
            assert "/" not in base.removeprefix(f"{around}/"), "the node right above it"
    labels = {row["path"].rpartition("/")[2].partition("[")[0] for row in rows}
    assert {"ReactiveSequence", "Fallback", "Sequence", "IsSafe", "Turn"} <= labels
    [reactive] = [row for row in rows if row["type"] == "ReactiveSequence"]
    assert (reactive["kind"], reactive["name"], reactive["line"]) == ("control", "while safe", 2)
    [away] = [row for row in rows if row["type"] == "BehaviorTree"]
    assert away["name"] == "Away"
    for node in automaton["nodes"]:
        if node["kind"] == "runner" and not node.get("hidden"):
            row = rows[node["element"]]
            assert row["kind"] == "runner"
            assert row["label"] in node["label"][0] or row["type"] in ("choice", "tick")
            assert f"line {row['line']}" in node["label"][-1]
