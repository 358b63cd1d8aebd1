"""The templates of Declare: what the documentation says is what is decided."""

from __future__ import annotations

import re
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from gpsfsm.tasks.load import BINARY, COUNTED, UNARY, formula_text
from gpsfsm.tasks.ltlf import Atom, Tracker, parse_formula

if TYPE_CHECKING:
    from gpsfsm.tasks.load import After

ROWS = re.findall(
    r"^\| `(\w+): ([^`]*)`[^|]*\|[^|]*\| `((?:\\\||[^|])*)` \|$",
    Path("docs/tasks.md").read_text(),
    re.MULTILINE,
)
COMPOSED = {"succession", "alternate_succession", "chain_succession", "chain_precedence"}


def documented(formula: str) -> str:
    """A formula of the page, with its letters written out."""
    events = {"a": 'start("A")', "b": 'start("B")', "s": "start(*)"}
    return re.sub(r"\b[abs]\b", lambda actual: events[actual[0]], formula.replace("\\|", "|"))


@pytest.mark.parametrize(("name", "actions", "formula"), ROWS, ids=[row[0] for row in ROWS])
def test_a_formula_of_the_page_is_that_of_the_template(
    name: str, actions: str, formula: str
) -> None:
    names = tuple(re.findall("[AB]", actions))
    assert parse_formula(documented(formula)) == parse_formula(formula_text(name, names))


def test_the_page_lists_every_template() -> None:
    listed = {name for name, _, _ in ROWS}
    assert listed | COMPOSED | set(COUNTED) == {*COUNTED, *UNARY, *BINARY}
    text = Path("docs/tasks.md").read_text()
    assert all(f"| `{name}: " in text for name in (*COUNTED, *UNARY, *BINARY))


def test_times_and_outcomes() -> None:
    twice = formula_text("existence", ("A",), after="failure", times=2)
    assert parse_formula(twice) == parse_formula("F (fails(A) & X F fails(A))")
    exactly = formula_text("exactly", ("A",), times=1)
    assert parse_formula(exactly) == parse_formula("F start(A) & !F (start(A) & X F start(A))")
    fewer = formula_text("absence", ("A",), after="success", times=2)
    assert parse_formula(fewer) == parse_formula("!F (succeeds(A) & X F succeeds(A))")


@pytest.mark.parametrize("event", ["start", "succeeds"])
def test_nothing_starts_after_the_last(event: str) -> None:
    """Another formula for the same, whose opposite is easier to follow."""
    after: After = "start" if event == "start" else "success"
    texts = [
        formula_text("last", ("A",), after=after),
        f"G !start(*) | F ({event}(A) & WX G !start(*))",
    ]
    start, star, success = Atom("start", "A"), Atom("start", "*"), Atom("succeeds", "A")
    letters = [frozenset(letter) for letter in ({start, star}, {star}, {success}, set())]
    for size in range(5):
        for trace in product(letters, repeat=size):
            answers = []
            for text in texts:
                tracker = Tracker(parse_formula(text))
                state = tracker.start
                for letter in trace:
                    state = tracker.after(state, letter & tracker.atoms)
                answers.append(tracker.fulfilled(state))
            assert answers[0] == answers[1]
