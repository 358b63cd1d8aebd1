"""Logs: for people or one object per line, never what a client could forge or should not read."""

from __future__ import annotations

import json
import logging
import re
import threading
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm import logs
from gpsfsm.streams import complain, to_stderr

if TYPE_CHECKING:
    from collections.abc import Callable

RFC_3339 = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z")
PLAN = "<Plan>of a client</Plan>"


def rows(text: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in text.splitlines()]


def test_an_object_has_time_level_event_message_and_fields(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with logs.writing("info", "json"):
        logs.event("info", "serving", "serving at x", address="x", root_path=None)
    (row,) = rows(capsys.readouterr().err)
    assert RFC_3339.fullmatch(row.pop("time"))
    assert row == {
        "level": "info",
        "event": "serving",
        "message": "serving at x",
        "address": "x",
    }


@pytest.mark.parametrize(("level", "count"), [("debug", 4), ("info", 3), ("error", 1)])
def test_a_level_leaves_out_what_is_below_it(
    capsys: pytest.CaptureFixture[str], level: logs.Level, count: int
) -> None:
    with logs.writing(level, "json"):
        for each in logs.LEVELS:
            logs.event(each, "x", each)
    assert [row["level"] for row in rows(capsys.readouterr().err)] == [*logs.LEVELS][-count:]


def test_as_text_it_is_a_message_as_all_others(capsys: pytest.CaptureFixture[str]) -> None:
    with logs.writing("info", "text"):
        logs.event("info", "serving", "serving at x")
        logs.event("info", logs.REQUEST, "GET / 200")
    first, second = capsys.readouterr().err.splitlines()
    assert first == "gpsfsm: serving at x"
    time, _, rest = second.removeprefix("gpsfsm: ").partition(" ")
    assert RFC_3339.fullmatch(time)
    assert rest == "GET / 200"


@given(st.text())
def test_no_text_makes_a_line_of_its_own(text: str) -> None:
    for output_format in logs.FORMATS:
        line = logs.Log("info", output_format)._line("info", "x", text, {"field": text})
        if output_format == "json":
            assert line.count("\n") == 1
            assert line.isascii()
            assert json.loads(line)["message"] == text[:1_999] + ("…" if len(text) > 2_000 else "")
        else:
            first, *others = line.split("\n")[:-1]
            assert first.startswith("gpsfsm: ")
            assert all(each.startswith("  ") for each in others)


def test_control_characters_are_escaped(capsys: pytest.CaptureFixture[str]) -> None:
    for output_format in logs.FORMATS:
        with logs.writing("info", output_format):
            logs.event("info", "x", "a\x1b[2Jb\x7f\u202e")
    written = capsys.readouterr().err
    assert not re.search("[\x1b\x7f\u202e]", written)


def test_messages_of_commands_are_events_as_well(capsys: pytest.CaptureFixture[str]) -> None:
    with logs.writing("info", "json"):
        complain("it failed\nbecause of x")
    to_stderr("plain again\n")
    first, second = capsys.readouterr().err.splitlines()
    row = json.loads(first)
    assert (row["level"], row["message"]) == ("error", "it failed\n  because of x")
    assert second == "plain again"


def raised() -> ValueError:
    try:
        raise ValueError(PLAN)
    except ValueError as error:
        return error


@pytest.mark.parametrize("name", ["uvicorn.error", "asyncio", "opentelemetry.sdk"])
def test_messages_of_libraries_are_events(capsys: pytest.CaptureFixture[str], name: str) -> None:
    logger = logging.getLogger(name)
    with logs.writing("info", "json"):
        logger.info("of no use")
        logger.warning("careful: %s", 3)
        logger.error("it broke\n%s", PLAN, exc_info=raised())
    logger.info("after that")
    written = capsys.readouterr().err
    careful, broke = rows(written)
    assert careful["message"].endswith("careful: 3")
    assert (broke["level"], broke["error"]) == ("error", "ValueError")
    assert broke["stack"][0].endswith(" raised")
    assert PLAN not in written


def test_a_failure_shows_where_and_not_what(capsys: pytest.CaptureFixture[str]) -> None:
    with logs.writing("info", "json"):
        logs.failure("request_failed", "the request failed", raised(), endpoint="check")
    written = capsys.readouterr().err
    (row,) = rows(written)
    assert (row["error"], row["endpoint"]) == ("ValueError", "check")
    assert PLAN not in written
    with logs.writing("info", "text"):
        logs.failure("request_failed", "the request failed", raised(), endpoint="check")
    written = capsys.readouterr().err
    message, place, *_ = written.splitlines()
    assert message == "gpsfsm: the request failed"
    assert re.fullmatch(r"  at .*test_logs\.py:[0-9]+ raised", place)
    assert PLAN not in written


def test_the_lines_of_a_child_are_events(capsys: pytest.CaptureFixture[str]) -> None:
    with logs.writing("info", "json"):
        logs.from_child("plan queue", b"gpsfsm: the disk is full\xff\n")
    (row,) = rows(capsys.readouterr().err)
    assert (row["event"], row["process"]) == ("output", "plan queue")
    assert row["message"] == "the disk is full�"


def test_nobody_waits_for_a_reader_that_is_gone(monkeypatch: pytest.MonkeyPatch) -> None:
    blocked, written = threading.Event(), list[str]()

    def write(line: str, *_: object) -> None:
        blocked.wait(20)
        written.append(line)

    monkeypatch.setattr(logs, "write_stderr", write)
    monkeypatch.setattr(logs, "_MOST_WAITING", 5)
    log = logs.Log("info", "json")
    log.start()
    for number in range(20):
        log.event("info", "x", str(number), {})
    blocked.set()
    log.end()
    lost = [row for row in map(json.loads, written) if row["event"] == "log_dropped"]
    kept = [row for row in map(json.loads, written) if row["event"] == "x"]
    assert len(kept) + sum(row["lines"] for row in lost) == 20
    assert lost


def test_without_a_log_only_what_goes_wrong_is_written(capsys: pytest.CaptureFixture[str]) -> None:
    speak: Callable[..., None] = logs.event
    speak("info", "x", "nobody wants this")
    speak("warning", "x", "this is wrong")
    assert capsys.readouterr().err == "gpsfsm: this is wrong\n"
