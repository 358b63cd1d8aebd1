"""Which instances a selector selects."""

from __future__ import annotations

import pytest

from gpsfsm.analysis.assumptions import runners
from tests.analysis.assumptions.support import NAV, TALK, bind, plan_of


@pytest.mark.parametrize(
    ("selector", "chosen"),
    [
        ("WaypointRunner(x=1.0, y=3)", {0}),
        ("WaypointRunner(x=1)", {0}),
        ('WaypointRunner(y="3.0")', {0}),
        ("WaypointRunner(x=2.0)", {2}),
        ("WaypointRunner(goal=dock)", {2}),
        ("WaypointRunner(goal='dock')", {2}),
        ("WaypointRunner(x=3)", set()),
        ("WaypointRunner(z=1)", set()),
        ("SpeechRunner(loud=true)", {1}),
        ("SpeechRunner(loud=1)", set()),
        ("SpeechRunner(name=greet)", {1}),
        ("WaypointRunner()", {0, 2}),
    ],
)
def test_parameters_compare_as_typed(selector: str, chosen: set[int]) -> None:
    assert runners(bind(f"never fails: {selector}")) == chosen


def test_a_line_in_the_middle_of_a_start_tag_selects_it() -> None:
    plan = plan_of((1, NAV, 2, 3, {}), (1, TALK, 7, 3, {}), spread=3)
    assert runners(bind("line 4 fails", plan)) == {0}
    assert runners(bind("line 10 fails", plan)) == {1}


def test_every_spelling_of_nan_selects_nan() -> None:
    plan = plan_of((1, NAV, 2, 3, {"x": float("nan")}), (1, NAV, 3, 3, {"x": 1.0}))
    assert runners(bind("never fails: *(x=NaN)", plan)) == {0}
    assert runners(bind("never fails: *(x=nan)", plan)) == {0}
