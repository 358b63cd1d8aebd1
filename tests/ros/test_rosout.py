"""The lines of a run on /rosout, without ROS 2: which severity they have, and when they go."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from gpsfsm.execution.records import Input, Kind, Record
from gpsfsm.ros import telemetry
from gpsfsm.ros.telemetry import Rosout

INFO, WARN, ERROR = 20, 30, 40


@pytest.fixture
def published(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, str]]:
    lines: list[tuple[int, str]] = []
    topics = SimpleNamespace(log=lambda _file, rows: lines.extend(rows))
    monkeypatch.setattr(telemetry._Topics, "of", lambda _: topics)
    monkeypatch.setattr(telemetry, "node_if_made", object)
    return lines


@pytest.mark.parametrize(
    ("record", "severity"),
    [
        (Record(Kind.BEGIN), INFO),
        (Record(Kind.STARTED, 1), INFO),
        (Record(Kind.SUCCEEDED, 1), INFO),
        (Record(Kind.FAILED, 1, message="no way"), WARN),
        (Record(Kind.TIMEOUT, 1), WARN),
        (Record(Kind.NOT_LOADED, runner=0), WARN),
        (Record(Kind.CANCEL, message="stopped by a client"), WARN),
        (Record(Kind.CANCEL, message="in doubt: goal 1"), ERROR),
        (Record(Kind.ENDED, data={"status": "COMPLETED"}), INFO),
        (Record(Kind.ENDED, data={"status": "CANCELLED"}), WARN),
        (Record(Kind.ENDED, data={"status": "GAVE_UP"}), ERROR),
    ],
)
def test_severities(record: Record, severity: int, published: list[tuple[int, str]]) -> None:
    Rosout(lambda each: each.kind.value, "p.xml")(0, Input(record.kind), [record])
    assert published == [(severity, record.kind.value)]


def test_lines_of_runners_are_lines(published: list[tuple[int, str]]) -> None:
    said: list[Record] = []

    def sentence(record: Record) -> str:
        said.append(record)
        return record.message

    watcher = Rosout(sentence, "p.xml")
    watcher(0, Input(Kind.LOG, 0, outputs={"left": "unknown"}, message="in doubt: goal 1"), [])
    watcher(0, Input(Kind.LOG, 0, message="it is waited for, for at most 30 s: goal 1"), [])
    watcher(0, Input(Kind.NOTE, message=""), [])
    assert published == [
        (ERROR, "in doubt: goal 1"),
        (ERROR, "it is waited for, for at most 30 s: goal 1"),
    ]
    assert said[0] == Record(Kind.LOG, 1, data={"left": "unknown"}, message="in doubt: goal 1")
    assert said[2].node == -1


def test_lines_wait_for_the_node(
    published: list[tuple[int, str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    node: list[Any] = []
    monkeypatch.setattr(telemetry, "node_if_made", lambda: node[0] if node else None)
    watcher = Rosout(lambda each: each.message, "p.xml")
    for number in range(100):  # a plan without a runner of ROS 2 never has one
        watcher(0, Input(Kind.STARTED), [Record(Kind.STARTED, 1, message=f"step {number}")])
    assert not published
    node.append(object())
    watcher(0, Input(Kind.SUCCEEDED), [Record(Kind.SUCCEEDED, 1, message="done")])
    assert [line for _, line in published] == [f"step {each}" for each in range(51, 100)] + ["done"]
    watcher(0, Input(Kind.SUCCEEDED), [])
    assert len(published) == 50
