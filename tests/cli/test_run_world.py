"""``gpsfsm run --world``: worlds that change, and world files that are wrong."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from gpsfsm.cli import main
from tests.conftest import REPO

if TYPE_CHECKING:
    from pathlib import Path

CLOSING = str(REPO / "corpus" / "worlds" / "closing.yaml")
MISSION = str(REPO / "corpus" / "missions" / "closed_door.xml")
WAYPOINT = "nav2_capabilities/WaypointRunner"


def drive(*places: tuple[float, float]) -> str:
    runners = "".join(
        f'<Runner interface="{WAYPOINT}" provider="{WAYPOINT}" x="{x}" y="{y}"/>' for x, y in places
    )
    return f"<Plan>{runners}</Plan>"


@pytest.mark.parametrize("seed", ["0", "5"])
def test_what_was_closed_stays_closed_for_the_next_plan(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], seed: str
) -> None:
    second, third = tmp_path / "second.xml", tmp_path / "third.xml"
    second.write_text(drive((1.0, 1.0), (6.5, 1.5)))
    third.write_text(drive((4.0, 3.0)))
    journal = str(tmp_path / "run.db")
    plans = (MISSION, str(second), str(third))
    assert main(["run", *plans, "--world", CLOSING, "--journal", journal, "--seed", seed]) == 1
    printed = capsys.readouterr().out
    assert "says: the zone 'office door' is closed now" in printed
    assert "failed: no way leads to (6.5, 4.5): the zone 'office door' is closed" in printed
    assert "failed: no way leads to (6.5, 1.5): the zone 'annex door' is closed" in printed
    assert printed.splitlines()[-1].startswith("COMPLETED")
    for number, status in (("1", "GAVE_UP"), ("2", "GAVE_UP"), ("3", "COMPLETED")):
        assert main(["replay", journal, "--run", number]) == 0
        assert f"({status}): replayed and simulated again" in capsys.readouterr().out
    assert main(["events", journal, "--run", "1", "--format", "jsonl"]) == 0
    rows = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [row["message"] for row in rows if row.get("kind") == "LOG"] == [
        "the zone 'office door' is closed now"
    ]


def test_names_are_judged_by_the_chosen_capabilities(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    world = tmp_path / "world.yaml"
    world.write_text("world: w\nrunners:\n  GraspRunner: {fails: 1}\n")
    plan = str(REPO / "docs" / "examples" / "grasp.xml")
    assert main(["run", plan, "--world", str(world)]) == 2
    assert capsys.readouterr().err == (
        f"gpsfsm: {world}:3:3: error: no interface is called 'GraspRunner'\n"
        "    did you mean 'WaitRunner'? Else give the folder of its capability file with "
        "--capabilities, or write it with its package if there is none\n"
    )
    robot = str(REPO / "docs" / "examples" / "my_robot")
    assert main(["run", plan, "--world", str(world), "--capabilities", robot]) == 1
    assert "it failed by chance" in capsys.readouterr().out


def test_a_file_that_is_much_too_large(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    world = tmp_path / "world.yaml"
    world.write_bytes(b"world: w\n" + b"#" * 20_000_000)
    assert main(["run", MISSION, "--world", str(world)]) == 2
    assert "the file is larger than 1048576 bytes" in capsys.readouterr().err
