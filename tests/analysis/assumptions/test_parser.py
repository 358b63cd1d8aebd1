"""What parses, and to what."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gpsfsm.analysis.assumptions import holds, parse_assumption, runners
from gpsfsm.errors import AssumptionError
from tests.analysis.assumptions.support import (
    PLAN,
    H,
    N,
    Predicate,
    S,
    bind,
    failed,
    refusal,
    scenarios,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from gpsfsm.model.event import Outcome


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("!" * 51 + "line 2 fails", "nests at most 50 levels"),
        ("line 2 fails => " * 51 + "line 2 fails", "nests at most 50 levels"),
        ("x" * 10_001, "at most 10000 characters"),
        ("(" * 9_000, "expected"),
        ("line " + "9" * 9_000 + " fails", "line number"),
        ("line 2 fails iff " * 500, "nests at most 50 levels"),
    ],
)
def test_hostile_text_ends_in_a_message(text: str, said: str) -> None:
    assert said in str(refusal(text))


def test_limits_admit_what_is_just_inside() -> None:
    assert runners(bind("!" * 50 + "line 2 fails")) == {0}
    assert runners(bind("(" * 4_000 + "line 2 fails" + ")" * 4_000)) == {0}
    assert runners(bind(" or ".join(["line 2 fails"] * 600))) == {0}


PIECES = (
    "line 2 7:1 fails succeed never always not and or implies iff if then any all at most one of"
    ' ( ) , : => ! "a" SpeechRunner /Plan/Runner[1] (x=1) same xor agree name does start'
)


@given(st.lists(st.sampled_from(PIECES.split()), max_size=12).map(" ".join) | st.text(max_size=40))
def test_any_text_parses_or_is_refused(text: str) -> None:
    try:
        parse_assumption(text).bind(PLAN)
    except AssumptionError as error:
        assert str(error)  # noqa: PT017  (any other exception fails the test)


SELECTORS = {
    "line 2": 0, "/Plan/Runner[1]": 0, "SpeechRunner": 1, 'name "greet"': 1, "line 5:5": 2,
    "nav2_capabilities/Way*(x=2)": 2, '"line"': 3,
}  # fmt: skip
VERBS: dict[str, Callable[[Outcome], bool]] = {
    "fails": failed,
    "succeeds": lambda outcome: outcome is S,
    "hangs": lambda outcome: outcome is H,
    "does not start": lambda outcome: outcome is N,
    "does not fail": lambda outcome: not failed(outcome),
}
Level = tuple[int, str, Predicate]  # binding strength, text, meaning


def claim(selector: str, verb: str) -> Level:
    return 9, f"{selector} {verb}", lambda o: VERBS[verb](o[SELECTORS[selector]])


def within(level: Level, least: int) -> str:
    return level[1] if level[0] >= least else f"({level[1]})"


def combine(parts: tuple[str, Level, Level]) -> Level:
    """The text with as few parentheses as the precedences of the documentation need."""
    operator, one, two = parts
    p, q = one[2], two[2]
    if operator == "not":
        return 8, f"not {within(one, 8)}", lambda o: not p(o)
    if operator == "if":
        return 2, f"if {one[1]} then {within(two, 2)}", lambda o: not p(o) or q(o)
    if operator == "at most":
        return 9, f"at most 1 of ({one[1]}, {two[1]})", lambda o: not (p(o) and q(o))
    strength, left, right, meaning = {
        "and": (7, 8, 8, lambda o: p(o) and q(o)),
        "xor": (6, 7, 7, lambda o: p(o) != q(o)),
        "or": (5, 6, 6, lambda o: p(o) or q(o)),
        "implies": (2, 5, 2, lambda o: not p(o) or q(o)),
        "iff": (1, 1, 2, lambda o: p(o) == q(o)),
    }[operator]
    return strength, f"{within(one, left)} {operator} {within(two, right)}", meaning


CLAIMS = st.builds(claim, st.sampled_from(sorted(SELECTORS)), st.sampled_from(sorted(VERBS)))
OPERATORS = st.sampled_from(["not", "if", "at most", "and", "xor", "or", "implies", "iff"])
TEXTS = st.recursive(
    CLAIMS, lambda level: st.tuples(OPERATORS, level, level).map(combine), max_leaves=8
)


@given(TEXTS)
@settings(deadline=None)
def test_precedence_and_meaning_of_random_texts(level: Level) -> None:
    _, text, meaning = level
    assumption = parse_assumption(text)
    formula = assumption.bind(PLAN).formula
    assert all(holds(formula, scenario) == meaning(scenario) for scenario in scenarios(4))
    assert parse_assumption(str(assumption)).statement == assumption.statement


def test_lark_is_imported_only_when_an_assumption_is_parsed() -> None:
    code = "import sys, gpsfsm.analysis.assumptions as a; assert 'lark' not in sys.modules;"
    code += "a.parse_assumption('line 7 fails'); assert 'lark' in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


def examples_of_the_documentation() -> list[str]:
    text = (Path(__file__).parents[3] / "docs" / "assumptions.md").read_text(encoding="utf-8")
    section = text.partition("## Examples")[2].partition("\n## ")[0]
    return re.findall(r"^\| `([^`]+)`", section, flags=re.MULTILINE)


def test_the_examples_of_the_documentation_parse() -> None:
    examples = examples_of_the_documentation()
    assert len(examples) > 10
    for example in examples:
        assert str(parse_assumption(example))
