from __future__ import annotations

import itertools
import json
import re
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.errors import InputError
from gpsfsm.generation.attempt_log import (
    Session,
    attempt_data,
    attempt_of,
    session_data,
    session_of,
)
from gpsfsm.generation.language_model import Answer, Constraint, Finish, Usage
from gpsfsm.generation.loop import Attempt, Judgement
from tests.conftest import REPO

TEXT = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)
COUNT = st.integers(0, 10**6)
ANSWERS = st.builds(
    Answer,
    TEXT,
    TEXT,
    st.sampled_from(Finish),
    st.builds(Usage, st.none() | COUNT, st.none() | COUNT, estimated=st.booleans()),
    st.floats(0, 1e6),
    st.none() | st.sampled_from(Constraint),
    st.just(""),
    st.integers(1, 9),
    st.none() | st.floats(0, 100),
)
JUDGEMENTS = st.builds(
    Judgement,
    st.booleans(),
    TEXT,
    TEXT,
    COUNT,
    COUNT,
    st.booleans(),
    st.lists(TEXT, max_size=3).map(tuple),
    st.lists(st.tuples(TEXT, TEXT), max_size=3).map(tuple),
)
ATTEMPTS = st.builds(
    Attempt, st.integers(1, 9), st.integers(1, 9), TEXT, st.none() | ANSWERS, st.none(), TEXT
) | st.builds(Attempt, st.integers(1, 9), st.integers(1, 9), TEXT, ANSWERS, JUDGEMENTS, TEXT)


@given(ATTEMPTS)
def test_an_attempt_comes_back_as_it_was(attempt: Attempt) -> None:
    data = json.loads(json.dumps(attempt_data(attempt)))
    assert attempt_of(data) == attempt


@given(st.builds(Session, TEXT, TEXT, TEXT, TEXT, TEXT, TEXT, COUNT, COUNT, COUNT, TEXT))
def test_a_session_comes_back_as_it_was(session: Session) -> None:
    assert session_of(json.loads(json.dumps(session_data(session)))) == session


JUNK = st.dictionaries(
    st.sampled_from(["round", "candidate", "asked", "answer", "accepted", "plan", "finish"]),
    st.none() | st.booleans() | st.integers() | TEXT | st.lists(st.integers(), max_size=2),
)


@given(JUNK)
def test_what_is_none_is_refused(data: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="not an attempt that gpsfsm recorded"):
        attempt_of({**data, "asked": 3})
    with pytest.raises(InputError, match="not an attempt that gpsfsm recorded"):
        session_of(data)


def test_what_came_is_kept_if_it_was_something_else() -> None:
    attempt = Attempt(1, 1, "go", Answer("<Plan/>", "m", raw='{"steps": []}'))
    assert attempt_of(attempt_data(attempt)) == attempt
    assert "raw" not in attempt_data(Attempt(1, 1, "go", Answer("<Plan/>", "m", raw="<Plan/>")))


@pytest.mark.parametrize("latency_s", [-1.0, float("nan"), float("inf")])
def test_a_time_that_would_undo_every_bound_is_refused(latency_s: float) -> None:
    data = attempt_data(Attempt(1, 1, "go", Answer("<Plan/>", "m", latency_s=1.0)))
    assert attempt_of(data).answer is not None
    with pytest.raises(InputError, match="'latency_s' does not fit"):
        attempt_of({**data, "latency_s": latency_s})


def test_the_page_names_every_field() -> None:
    page = (REPO / "docs" / "generation.md").read_text(encoding="utf-8")
    _, sessions, attempts = re.split(r"\| Field of an? \w+ \| Meaning \|\n", page)
    usage = Usage(1, 2, estimated=True)
    answer = Answer("a", "m", usage=usage, constrained=Constraint.GBNF, raw="r", cost=1.0)
    judgement = Judgement(True, "p", "t")
    attempt = attempt_data(Attempt(1, 1, "go", answer, judgement, "problem", "note"))
    assert named(attempts) == sorted(attempt)
    session = session_data(Session("t", "m", "plan.1", "", "", ""))
    fields = {"session", "plan", "accepted", "interrupted", "reason", "attempts"}
    assert named(sessions) == sorted(fields.union(session))


def named(table: str) -> list[str]:
    """What stands in the first column of the table with which the text begins."""
    rows = itertools.takewhile(lambda line: line.startswith("|"), table.splitlines())
    return sorted(name for row in rows for name in re.findall(r"`(\w+)`", row.split("|")[1]))
