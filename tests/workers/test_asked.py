"""A process that is asked: its answers, and what is said when there is none."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import gpsfsm
from gpsfsm.workers.asked import Asked
from gpsfsm.workers.frames import Gone

if TYPE_CHECKING:
    from collections.abc import Iterator

CODE = f"""
import sys
sys.path.insert(0, {str(Path(gpsfsm.__file__).parents[1])!r})
from gpsfsm.workers.line import Line
line = Line()
print("this is no answer")
while True:
    head, body = line.messages.get()
    if "exit" in head:
        raise SystemExit(head["exit"])
    if "wait" not in head:
        line.say({{"length": len(body), **head}}, body[::-1])
"""


@pytest.fixture
def asked() -> Iterator[Asked]:
    found = Asked([sys.executable, "-I", "-c", CODE], silent=True)
    yield found
    found.end()


def test_answers_come_in_the_order_of_the_questions(asked: Asked) -> None:
    for body in (b"", b"abc", bytes(1 << 20)):
        answer = asked.ask({"a": [1, "\ud800"]}, body, within_s=60)
        assert answer == ({"length": len(body), "a": [1, "\ud800"]}, body[::-1])


def test_who_has_ended_is_gone(asked: Asked) -> None:
    with pytest.raises(Gone):
        asked.ask({"exit": 3}, within_s=60)


def test_who_says_nothing_is_too_late_and_is_ended(asked: Asked) -> None:
    with pytest.raises(TimeoutError):
        asked.ask({"wait": True}, within_s=0.2)
    asked.end()
    assert asked._process.poll() is not None
    assert not asked._thread.is_alive()


def test_what_cannot_be_written_is_not_sent(asked: Asked) -> None:
    with pytest.raises(TypeError):
        asked.ask({"a": object()}, within_s=60)
    assert asked.ask({}, within_s=60) == ({"length": 0}, b"")


def test_a_program_that_is_not_there() -> None:
    with pytest.raises(OSError, match="no/such"):
        Asked(["/no/such/program"], silent=True)
