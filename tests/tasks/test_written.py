"""Formulas as they are written."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.tasks.ltlf import MistakeError, TooLargeError, Tracker, parse_formula
from tests.cases import many


@pytest.mark.parametrize(
    ("short", "long"),
    [
        ("start(A) & start(B) | fails(C)", "(start(A) & start(B)) | fails(C)"),
        ("start(A) -> start(B) -> fails(C)", "start(A) -> (start(B) -> fails(C))"),
        ("start(A)->start(B)", "!start(A) | start(B)"),
        ("G start(A) & F start(B)", "(G (start(A))) & (F (start(B)))"),
        ("! start(A) U start(B)", "(!start(A)) U start(B)"),
        ("start(A) U start(B) U start(C)", "start(A) U (start(B) U start(C))"),
        ("!X start(A)", "WX !start(A)"),
        ("!F start(A)", "G !start(A)"),
        ("start(A) W start(B)", "start(B) R (start(A) | start(B))"),
        ("start(A) M start(B)", "start(B) U (start(A) & start(B))"),
        ("!(start(A) W start(B))", "(!start(B)) U (!start(A) & !start(B))"),
        ("!(completes & gives_up)", "!completes | !gives_up"),
        ('start("A")', "start(A)"),
        ("start(A) <-> true", "(!start(A) | true) & (start(A) | !true)"),
    ],
)
def test_what_is_short_for_what(short: str, long: str) -> None:
    assert parse_formula(short) == parse_formula(long)


@pytest.mark.parametrize(
    ("text", "position", "message"),
    [
        ("", 0, "something is missing at the end"),
        ("F", 1, "something is missing at the end"),
        ("start", 5, "'start' needs a name"),
        ("start()", 6, "'start' needs a name"),
        ("start(A", 7, "a closing bracket is missing"),
        ("start(go there)", 9, "a closing bracket is missing"),
        ("start(A) start(B)", 9, "the formula continues where it should end"),
        ("(start(A)", 9, "a closing bracket is missing"),
        ("f start(A)", 0, "'f' is not an event"),
        ("start(A) <> true", 9, "'<' is not allowed here"),
        ("! " * 101 + "true", 200, "the formula is nested more than 100 levels deep"),
        ("true& " * 600 + "true", 2999, "the formula has more than 1000 words and signs"),
    ],
)
def test_what_is_said_about_mistakes(text: str, position: int, message: str) -> None:
    with pytest.raises(MistakeError) as caught:
        parse_formula(text)
    assert (caught.value.position, caught.value.message) == (position, message)


WORDS = [
    *("start(A)", "start", "(", ")", "!", "&", "|", "->", "<->", "U", "W", "X", "WX", "F", "G"),
    *("completes", "true", '"a b"', "*", " ", "<", "-"),
]


def place_of_mistake(text: str) -> int:
    try:
        return 0 if Tracker(parse_formula(text)).start else -1
    except MistakeError as mistake:
        return mistake.position


@given(st.lists(st.sampled_from(WORDS), max_size=20).map("".join))
def test_no_text_breaks_the_parser(text: str) -> None:
    assert 0 <= place_of_mistake(text) <= len(text)


@pytest.mark.parametrize("operator", ["<->", "W", "M"])
def test_what_is_written_twice_does_not_explode(operator: str) -> None:
    """Each of these writes a part twice, and so 40 of them 2 to the 40 parts."""
    assert parse_formula(f" {operator} ".join(["start(A)"] * 6))
    with pytest.raises(MistakeError, match="the formula is too large"):
        parse_formula(f" {operator} ".join(["start(A)"] * 40))


def test_a_formula_with_a_huge_automaton_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """After a quarter of the steps that it may take; CASES=all goes as far as it does for users."""
    monkeypatch.setattr("gpsfsm.tasks.ltlf._MOST", many(2_000))
    parts = [f"F (start(A{n}) & X F start(B{n}))" for n in range(12)]
    tracker = Tracker(parse_formula(" & ".join(parts)))
    with pytest.raises(TooLargeError):
        _follow_all(tracker)


def _follow_all(tracker: Tracker) -> None:
    for number in range(1 << 12):
        names = {f"A{at}" for at in range(12) if number >> at & 1}
        starts = (one for one in tracker.atoms if one.happening == "start")
        tracker.after(tracker.start, frozenset(one for one in starts if one.name in names))
