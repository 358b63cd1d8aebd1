"""Task files: what they mean, and what is said about those that make no sense."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.errors import ConfigError
from gpsfsm.syntax import parse
from gpsfsm.tasks.load import load_task, read_task
from gpsfsm.tasks.task import Pattern, Place, Task

ROUNDS = Path("docs/examples/rounds.yaml")


def messages(text: str) -> list[str]:
    """The lines that a defective file is answered with, without hints."""
    with pytest.raises(ConfigError) as caught:
        read_task(text.encode(), file="t.yaml")
    return [line for line in str(caught.value).splitlines() if not line.startswith(" ")]


def task(text: str) -> Task:
    return read_task(text.encode())


def runner(words: str) -> object:
    plan = parse(f"<Plan><Runner {words}/></Plan>").plan
    assert plan is not None
    return plan.runners[0]


def test_a_task_file_is_read() -> None:
    loaded = load_task(ROUNDS)

    lab = Pattern(
        "lab", ("WaypointRunner",), (), Place("lab", (("x", 6.5), ("y", 3.0))), tolerance=0.05
    )
    speak = Pattern("speak", ("SpeechRunner",), tolerance=0.05)
    assert [[one.name for one in step.attempts] for step in loaded.steps] == [
        ["entrance"],
        ["lab", "store"],
        ["office"],
    ]
    assert loaded.steps[1].attempts[0] == lab
    assert loaded.allowed == (speak,)
    assert set(loaded.patterns) >= {lab, speak}
    assert [rule.phrase for rule in loaded.rules] == ["precedence of 'lab' and 'speak'"]
    assert [example.name for example in loaded.not_answers] == ["shown.xml"]
    assert not loaded.others


def test_a_task_goes_to_other_processes() -> None:
    loaded = load_task(ROUNDS)
    again = pickle.loads(pickle.dumps(loaded))  # noqa: S301  (our own)
    assert again.steps == loaded.steps
    assert again.rules == loaded.rules


@pytest.mark.parametrize(
    ("words", "matches"),
    [
        ('interface="nav/Go" x="1" y="2"', True),
        ('interface="nav/Go" x="1.04" y="2.0" speed="3"', True),
        ('interface="nav/Go" x="1.06" y="2"', False),
        ('interface="nav/Go" x="one" y="2"', False),
        ('interface="nav/Go" x="true" y="2"', False),
        ('interface="nav/Go" x="nan" y="2"', False),
        ('interface="nav/Go" x="1"', False),
        ('interface="nav/Go" location="dock"', True),
        ('interface="nav/Go" location="docks"', False),
        ('interface="nav/Go" name="dock"', False),
        ('interface="Go" x="1" y="2"', True),
        ('interface="nav/GoThere" x="1" y="2"', False),
        ('interface="drive/to" x="1" y="2"', True),
        ('interface="drive/to/it" x="1" y="2"', True),
        ('interface="MoveTo" x="1" y="2"', False),
    ],
)
def test_what_a_description_matches(words: str, matches: bool) -> None:
    demand = task(
        "interface: [Go, drive/*]\ntolerance: 0.05\nplaces: {dock: {x: 1, y: 2}}\n"
        "steps: [{do: dock}]\n"
    )
    assert demand.steps[0].attempts[0].matches(runner(words)) is matches  # type: ignore[arg-type]


def test_an_action_can_be_described_where_it_is_used() -> None:
    demand = task(
        "steps:\n  - do: {interface: Say, text: hello, loud: true, tolerance: 0.5, n: 3}\n"
        "    else: [{place: door}, door]\nplaces: {door: {at: 7}}\n"
    )
    say, *others = demand.steps[0].attempts
    assert say.name == "Say (text=hello, loud=True, n=3)"
    assert say.tolerance == 0.5
    assert say.matches(runner('interface="a/Say" text="hello" loud="true" n="3.4"'))  # type: ignore[arg-type]
    assert not say.matches(runner('interface="a/Say" text="hello" loud="1" n="3"'))  # type: ignore[arg-type]
    assert [one.place and one.place.name for one in others] == ["door", "door"]


def test_all_defects_of_a_file_are_told_at_once() -> None:
    assert messages(
        "step: []\n"
        "tolerance: -1\n"
        "places: {A: 3, B: {x: [1]}, C: {x: .inf}}\n"
        "actions: {A: {interface: x}, D: 7, E: {}}\n"
        "steps:\n"
        "  - do: Q\n"
        "  - els: A\n"
        "others: maybe\n"
        "not_answers: missing.xml\n"
    ) == [
        "t.yaml:1:1: error: the key 'step' is not known here",
        "t.yaml:2:1: error: 'tolerance' is negative: -1",
        "t.yaml:3:10: error: the place 'A' must be a mapping, not '3'",
        "t.yaml:3:20: error: 'x' must be a text, a number, true or false, not a list",
        "t.yaml:3:33: error: 'x' must be a finite number",
        "t.yaml:4:11: error: 'A' is both a place and an action",
        "t.yaml:4:30: error: the action 'D' must be a mapping, not '7'",
        "t.yaml:4:36: error: this action says nothing",
        "t.yaml:6:5: error: there is no place or action 'Q'",
        "t.yaml:7:5: error: 'steps[2]' has no 'do'",
        "t.yaml:8:1: error: 'others' must be allowed or refused, not 'maybe'",
        "t.yaml:9:1: error: 'missing.xml': the file cannot be read: No such file or directory",
    ]


def test_what_is_said_about_rules_that_make_no_sense() -> None:
    head = "actions: {A: {interface: a}, B: {interface: b}}\nrules:\n"
    assert messages(
        head + "  - precedence: [A]\n"
        "  - responce: [A, B]\n"
        "  - {existence: A, absence: B}\n"
        "  - {response: [A, B], after: noon, times: 2}\n"
        "  - {exactly: A, times: 0}\n"
        "  - {init: C}\n"
        "  - ltlf: G (start(A) ->\n"
        "  - ltlf: F begin(A)\n"
        "  - ltlf: F start(D)\n"
        "  - {ltlf: F start(A), after: success}\n"
        "  - {name: nothing}\n"
    ) == [
        "t.yaml:3:5: error: 'precedence' must be the names of two actions: [A, B], not a list",
        "t.yaml:4:5: error: there is no rule 'responce'",
        "t.yaml:5:5: error: an entry of 'rules' must hold exactly one rule",
        "t.yaml:6:24: error: 'after' must be start or success or failure, not 'noon'",
        "t.yaml:6:37: error: 'times' has no effect with 'response'",
        "t.yaml:7:18: error: 'times' must be a whole number from 1 to 20, not '0'",
        "t.yaml:8:6: error: there is no place or action 'C'",
        "t.yaml:9:5: error: the formula does not parse, at character 15:"
        " something is missing at the end",
        "t.yaml:10:5: error: the formula does not parse, at character 3: 'begin' is not an event",
        "t.yaml:11:5: error: there is no place or action 'D'",
        "t.yaml:12:24: error: 'after' has no effect with 'ltlf'",
        "t.yaml:13:5: error: an entry of 'rules' must hold exactly one rule",
    ]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("task: rest\n", "t.yaml:1:1: error: the task asks for nothing"),
        ("", "t.yaml:1:1: error: the file is empty"),
        ("- a\n", "t.yaml:1:1: error: the file holds a list, not lines of the form 'key: …'"),
        ("steps: 3\n", "t.yaml:1:1: error: 'steps' must be a list, not '3'"),
    ],
)
def test_files_that_hold_no_task(text: str, line: str) -> None:
    assert line in messages(text)


def answered(content: bytes) -> str:
    try:
        return read_task(content).file
    except ConfigError as error:
        return str(error)


@given(st.binary(max_size=300))
def test_no_file_breaks_the_reader(content: bytes) -> None:
    assert answered(content)


KEYS = [
    *("steps", "do", "else", "rules", "ltlf", "precedence", "places", "x", "A", "[", "]", "{", "}"),
    *(": ", "\n", "  ", "- ", ",", '"', "F start(A)", "1", "allow", "others", "times", "after"),
]


@given(st.lists(st.sampled_from(KEYS), max_size=30).map("".join))
def test_no_piece_of_a_task_breaks_the_reader(text: str) -> None:
    assert answered(text.encode()).startswith("<task>")


def test_an_unknown_rule_is_refused_with_all_rules() -> None:
    with pytest.raises(ConfigError) as refused:
        read_task(b"rules:\n  - never: speak\n", file="t.yaml")
    _, hint, *_ = str(refused.value).splitlines()
    assert hint.strip().startswith("the rules are: ltlf, existence, absence, exactly, ")
