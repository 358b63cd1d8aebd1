"""How far runners are, as they say: in words, at the acting runner, and not three hundred times."""

from __future__ import annotations

import io

import pytest

from gpsfsm.execution.records import Input, Kind, Record, RunValue
from gpsfsm.watch.live import LiveTree, Tree
from gpsfsm.watch.record_text import Detail, Lines, feedback_words
from tests.watch.support import Watched, runner

SECOND = 1_000_000
PLAN = f"<Plan>{runner()}{runner('Next')}</Plan>"


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ({"feedback": "drive", "distance_left_m": 1.24}, "1.2 m left"),
        ({"feedback": "drive", "time_left_s": 12.3, "distance_left_m": 3}, "12 s left, 3.0 m left"),
        ({"feedback": "dock", "battery_percent": 45.2}, "battery 45 %"),
        ({"feedback": "dock", "waypoints_left": 3}, "3 waypoints left"),
        (
            {"feedback": "dock", "state": "turns\naround", "docked": False},
            "state turns around, docked false",
        ),
        ({"feedback": "dock"}, ""),
        ({"feedback": "x", **{f"n{i}": i for i in range(9)}}, "n0 0, n1 1, n2 2, n3 3"),
    ],
)
def test_units_stand_at_the_ends_of_names(data: dict[str, RunValue], words: str) -> None:
    assert feedback_words(data) == words


def drive(watcher: LiveTree | Lines, seconds: int) -> None:
    """One instance starts and says every second how far it is, and where."""
    watcher(0, Input(Kind.LOADED, runner=0), [Record(Kind.STARTED, 1)])
    for second in range(1, seconds + 1):
        data: dict[str, RunValue] = {
            "feedback": "drive",
            "distance_left_m": float(seconds - second),
        }
        watcher(second * SECOND, Input(Kind.LOG, 0, outputs=data, message="drives"), [])
        pose: dict[str, RunValue] = {"world": "pose", "x": 1.0, "y": 2.0, "yaw": 0.0}
        watcher(second * SECOND, Input(Kind.LOG, 0, outputs=pose, message="is there"), [])


def test_plain_lines_tell_it_every_ten_seconds() -> None:
    actual: list[str] = []
    drive(Lines(Watched(PLAN).words, actual.append), 35)
    assert actual == [
        "     0.000 s  line 1  Go started",
        "    10.000 s  line 1  Go: 25.0 m left",
        "    20.000 s  line 1  Go: 15.0 m left",
        "    30.000 s  line 1  Go: 5.0 m left",
    ]


def test_verbose_lines_tell_all() -> None:
    actual: list[str] = []
    drive(Lines(Watched(PLAN).words, actual.append, detail=Detail.ALL), 3)
    assert len(actual) == 1 + 2 * 3
    assert actual[1] == "     1.000 s  line 1  Go: 2.0 m left"
    assert actual[2] == "     1.000 s  line 1  Go says: is there"


def test_the_tree_shows_the_last_one_while_it_acts() -> None:
    tree = Tree(Watched(PLAN).kernel.automaton)
    tree.add(0, [Record(Kind.STARTED, 1)])
    for left in (2.0, 1.2):
        data: dict[str, RunValue] = {"feedback": "drive", "distance_left_m": left}
        tree.hear(Record(Kind.LOG, 1, data=data))
    assert [line.says for line in tree.lines(SECOND)] == ["", "1.2 m left", ""]
    tree.add(2 * SECOND, [Record(Kind.SUCCEEDED, 1)])
    assert [line.says for line in tree.lines(SECOND)] == ["", "", ""]


def test_the_live_tree_replaces_its_line() -> None:
    stream = io.StringIO()
    words = Watched(PLAN).words
    with LiveTree(words, stream, color=False) as live:
        drive(live, 40)
        picture = live._picture().plain
    assert picture.count("m left") == 1
    assert "0.0 m left" in picture
    assert "says" not in picture
