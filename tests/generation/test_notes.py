"""Notes about a model in a journal: data for programs, the same in words for people."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.execution.journal_rows import LogLine
from gpsfsm.execution.records import Kind
from gpsfsm.execution.runner import checked
from gpsfsm.generation.attempt_log import (
    AcceptedNote,
    NoteKind,
    RejectedNote,
    RequestNote,
    answered,
    kind_of,
    rejected,
    requests_in,
)
from gpsfsm.generation.language_model import Answer, ModelError, Usage
from gpsfsm.generation.loop import Attempt, Judgement
from tests.generation.scripted import Scripted
from tests.runners.prompting import Ran, run_real
from tests.simulation.support import control, plan, runner

if TYPE_CHECKING:
    from gpsfsm.execution.records import RunValue

GOOD = "<Plan><Runner/></Plan>"


def notes(ran: Ran) -> list[tuple[dict[str, RunValue], str]]:
    happened = [row[1] for row in ran.rows]
    return [(dict(row.outputs), row.message) for row in happened if row.kind is Kind.LOG]


def test_a_run_journals_what_a_model_did_as_data() -> None:
    usage = Usage(1200, 34, estimated=True)
    answer = Answer(GOOD, "m", usage=usage, latency_s=2.5, cost=0.25)
    text = plan(runner("PromptPlan", task="Go.", flush="true"))
    request = {"note": "request", "model": "scripted:test"}
    assert notes(run_real(text, Scripted(["no", answer]))) == [
        ({**request, "latency_s": 0.0}, "asked scripted:test: 0.0 s"),
        (
            {"note": "rejected", "attempt": 1, "mistakes": [["GP1", "no plan"]]},
            "attempt 1 was rejected: GP1: no plan",
        ),
        (
            {
                **request,
                "estimated": True,
                "prompt_tokens": 1200,
                "answer_tokens": 34,
                "cost": 0.25,
                "latency_s": 2.5,
            },
            "asked scripted:test: about 1,200 tokens asked, about 34 tokens answered, "
            "cost 0.2500, 2.5 s",
        ),
        ({"note": "accepted", "attempt": 2}, "accepted the plan of attempt 2"),
    ]


def test_a_request_without_an_answer_has_its_error() -> None:
    text = plan(
        runner("PromptText", text="Hello?", flush="true"),
        control("recovery", runner("Wait", seconds="0.01")),
    )
    assert notes(run_real(text, Scripted([ModelError("the server is away")]))) == [
        (
            {"note": "request", "model": "scripted:test", "error": "the server is away"},
            "asked scripted:test: the server is away",
        )
    ]


@pytest.mark.parametrize(
    ("text", "data", "first_edition", "kind"),
    [
        ("whatever", {"note": "request"}, False, NoteKind.REQUEST),
        ("whatever", {"note": "accepted"}, False, NoteKind.ACCEPTED),
        ("asked m: 2.0 s", {}, True, NoteKind.REQUEST),
        ("accepted the plan of attempt 12", {}, True, NoteKind.ACCEPTED),
        ("asked m: 2.0 s", {}, False, None),
        ("accepted the plan of attempt 12", {}, False, None),
        ("accepted the plan of attempt 1, and drove", {}, True, None),
        ("asked m: 2.0 s", {"world": "say"}, True, None),
        ("asked m: 2.0 s", {"note": 7}, True, None),
        ("asked m: 2.0 s", {"note": ["request"]}, True, None),
        ("They asked me", {}, True, None),
    ],
)
def test_only_the_data_say_what_a_line_is(
    text: str, data: dict[str, RunValue], first_edition: bool, kind: NoteKind | None
) -> None:
    assert kind_of(text, data, first_edition=first_edition) is kind


def test_requests_are_counted() -> None:
    noted = RequestNote("m", latency_s=1.0)
    lines = [
        LogLine(0, noted.text, noted.data),
        LogLine(1, noted.text, {}),
        LogLine(2, "accepted the plan of attempt 1", AcceptedNote(1).data),
    ]
    assert requests_in(lines, first_edition=False) == 1
    assert requests_in(lines, first_edition=True) == 2


COUNTS = st.none() | st.integers(0, 2**70)
AMOUNTS = st.none() | st.floats()


@given(COUNTS, COUNTS, st.booleans(), AMOUNTS, AMOUNTS)
def test_whatever_a_provider_counts_can_be_journaled(
    prompt_tokens: int | None,
    answer_tokens: int | None,
    estimated: bool,
    cost: float | None,
    latency_s: float | None,
) -> None:
    usage = Usage(prompt_tokens, answer_tokens, estimated)
    note = answered("m", Answer("x", "m", usage=usage, cost=cost, latency_s=latency_s or 0.0))
    data = note.data
    assert checked(dict(data)) == data
    if cost is not None and math.isfinite(cost) and abs(cost) < 2**53:
        assert data["cost"] == cost


@given(st.lists(st.tuples(st.text(max_size=8), st.text(max_size=4_000)), max_size=9))
def test_the_mistakes_of_an_answer_can_be_journaled(findings: list[tuple[str, str]]) -> None:
    judged = Judgement(False, "", "no", errors=len(findings), findings=tuple(findings))
    note = rejected(Attempt(3, 1, "", answer=Answer("x", "m"), judgement=judged))
    assert checked(dict(note.data)) == note.data
    assert len(note.text) <= 12_000  # escapes are longer than what they stand for
    assert note.text.startswith("attempt 3 was rejected: ")
    assert RejectedNote(3, problem="it was cut off").data["problem"] == "it was cut off"
