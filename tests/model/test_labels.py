"""How runners are named in messages."""

from __future__ import annotations

import pytest

from gpsfsm.model.labels import action, brief
from gpsfsm.syntax import parse


@pytest.mark.parametrize(
    ("written", "named"),
    [
        ('interface="a/Go" provider="a/Go"', "Go"),
        (
            'interface="a/Go" provider="a/Go" fast="true" x="1" y="2.5"',
            "Go (x=1, y=2.5, fast=true)",
        ),
        (
            'interface="Go" provider="p" a="1" b="2" c="3" text="four"',
            "Go (text=four, a=1, b=2, …)",
        ),
        ('provider="a/Go"', "a runner without interface"),
    ],
)
def test_what_tells_runners_apart_comes_first(written: str, named: str) -> None:
    plan = parse(f"<Plan><Runner {written}/></Plan>", file="p.xml").plan
    assert plan is not None
    assert action(plan.runners[0]) == named


def test_a_text_is_one_short_line() -> None:
    assert brief(" go \n home ") == "go home"
    assert brief("x" * 28) == "x" * 28
    assert brief("x" * 29) == "x" * 27 + "…"
