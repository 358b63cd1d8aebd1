"""Spans: none without a recording; with one they are nested as the work is."""

from __future__ import annotations

import pytest

import gpsfsm
from gpsfsm import tracing
from gpsfsm.gating import gate_text

PLAN = '<Plan><Runner interface="a/Go" provider="a/Go"/></Plan>'


def tree(rows: list[tracing.Row]) -> list[str]:
    """Each span with those above it."""
    paths: list[str] = []
    for name, _, _, parent, _, _ in rows:
        short = name.removeprefix("gpsfsm.")
        paths.append(short if parent < 0 else f"{paths[parent]}/{short}")
    return paths


def test_without_a_recording_there_is_one_span_for_all() -> None:
    assert tracing.span("a") is tracing.span("b")
    with tracing.span("a") as span:
        span.note(x=1)
    with tracing.recording() as rows:
        pass
    assert rows == []


def test_a_gate_is_recorded_in_its_parts() -> None:
    with tracing.recording() as rows:
        verdict = gate_text(PLAN, "plan.xml")
    assert verdict.accepted
    parts = ("read", "compile", "decide", "rules")
    assert tree(rows) == ["gate", "gate/check", *(f"gate/check/{each}" for each in parts)]
    for _, began_ns, ended_ns, parent, _, error in rows:
        assert began_ns <= ended_ns
        assert error == ""
        if parent >= 0:
            assert rows[parent][1] <= began_ns <= ended_ns <= rows[parent][2]
    assert [row[4] for row in rows[:2]] == [{"gpsfsm.verdict": "accepted"}] * 2
    assert not any("Go" in str(row) for row in rows), "a plan has no business in a trace"


def test_a_report_that_is_written_is_recorded() -> None:
    report = gpsfsm.check(PLAN.encode())
    with tracing.recording() as rows:
        gpsfsm.render(report, "json")
    assert tree(rows) == ["render"]


def test_an_exception_ends_a_span_and_is_named() -> None:
    with tracing.recording() as rows:
        with pytest.raises(KeyError), tracing.span("outer"), tracing.span("inner"):
            raise KeyError("secret")
        with tracing.span("next"):
            pass
    assert [(row[0], row[3], row[5]) for row in rows] == [
        *(("outer", -1, "KeyError"), ("inner", 0, "KeyError"), ("next", -1, "")),
    ]


def test_a_recording_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tracing, "_MOST", 3)
    with tracing.recording() as rows:
        for _ in range(5):
            with tracing.span("outer"), tracing.span("inner"):
                pass
    assert [(row[0], row[3]) for row in rows] == [("outer", -1), ("inner", 0), ("outer", -1)]
