"""``gpsfsm run`` with behaviour trees, plans and machines: journal, events, replay, resume."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from typing import TYPE_CHECKING, Any

import pytest

from tests.cli.support import environment, run
from tests.conftest import REPO

if TYPE_CHECKING:
    from pathlib import Path

NAV2 = REPO / "docs" / "examples" / "nav2"
DEPOT, PROFILE = NAV2 / "depot.xml", NAV2 / "robot.yaml"
IN_DEPOT = (DEPOT, "--robot", PROFILE, "--world", NAV2 / "depot.yaml", "--seed", "1")
ROUND = REPO / "corpus" / "trees" / "round.xml"
MACHINE = """<root BTCPP_format="4">
  <BehaviorTree ID="Main">
    <Sequence>
      <Repeat num_cycles="{rounds}">
        <Say text="hello"/>
      </Repeat>
      <ReactiveSequence>
        <BatteryOk/>
        <Patrol/>
      </ReactiveSequence>
      <Timeout msec="500"><Nap/></Timeout>
    </Sequence>
  </BehaviorTree>
</root>
"""
WAIT = "generic_capabilities/WaitRunner"


def machine(folder: Path) -> Path:
    file = folder / "machine.xml"
    file.write_text(MACHINE, encoding="utf-8")
    return file


def tree(*leaves: str) -> str:
    inside = "\n".join(leaves)
    return (
        '<root BTCPP_format="4"><BehaviorTree ID="Main"><Sequence>\n'
        f"{inside}\n</Sequence></BehaviorTree></root>"
    )


def rows(journal: str, folder: Path) -> list[dict[str, Any]]:
    done = run("events", journal, "--format", "jsonl", cwd=folder)
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()[1:]]


def test_a_machine_of_a_tree_is_journaled_told_and_replayed(tmp_path: Path) -> None:
    words = ("run", machine(tmp_path), "--seed", "6", "--journal", "j.db")
    done = run(*words, cwd=tmp_path)
    assert done.returncode in (0, 1), done.stderr
    text = done.stdout.decode()
    assert "line  4  the choice 'Repeat: another round' does not hold" in text
    assert "line  8  BatteryOk stopped" in text
    events = run("events", "j.db", cwd=tmp_path).stdout.decode()
    assert "the runner of choices is being loaded" in events
    for words_of_ours in ("ChoiceRunner", "of='", "by chance", "plan"):
        assert words_of_ours not in text
        assert words_of_ours not in events
    last = {row["node"]: row["kind"] for row in rows("j.db", tmp_path) if "node" in row}
    assert set(last.values()) <= {"SUCCEEDED", "FAILED", "STOPPED"}
    assert b"the same" in run("replay", "j.db", cwd=tmp_path).stdout
    over = run("resume", "j.db", cwd=tmp_path)
    assert b"run 1 has ended already" in over.stdout + over.stderr
    drawn = run("events", "j.db", "--format", "svg", cwd=tmp_path).stdout.decode()
    assert "the choice &#x27;Repeat" in drawn or "the choice 'Repeat" in drawn


def test_the_steps_that_a_proof_may_take_are_those_of_the_command_line(tmp_path: Path) -> None:
    """Else what ``check --rlimit`` accepts could only be forced."""
    refused = run("run", *IN_DEPOT, "--rlimit", "1", cwd=tmp_path)
    assert refused.returncode == 2
    assert "undecided (not proved: over --rlimit), so it is not run" in refused.stderr.decode()
    (tmp_path / "gpsfsm.toml").write_text("rlimit = 1\n", encoding="utf-8")
    named = ("run", *IN_DEPOT, "--config", "gpsfsm.toml")
    assert run(*named, cwd=tmp_path).stderr == refused.stderr
    assert run(*named, "--rlimit", "50000000", cwd=tmp_path).returncode == 0


def test_json_of_a_tree_is_that_of_its_journal(tmp_path: Path) -> None:
    file = machine(tmp_path)
    done = run("run", file, "--seed", "2", "--format", "json", "--journal", "j.db", cwd=tmp_path)
    documents = [json.loads(line) for line in done.stdout.splitlines()[1:]]
    assert [row for row in documents if "seq" in row] == rows("j.db", tmp_path)
    elements = {row["element"] for row in documents if "element" in row}
    assert "/root/BehaviorTree[1]/Sequence[1]/Repeat[1]/Say[1]" in elements


@pytest.mark.parametrize("words", [IN_DEPOT, (ROUND, "--seed", "3")], ids=["machine", "plan"])
def test_a_tree_that_was_killed_goes_on(words: tuple[str | Path, ...], tmp_path: Path) -> None:
    whole = run("run", *words, cwd=tmp_path).stdout.splitlines()
    slowly = ("run", *map(str, words), "--speed", "8", "--journal", "j.db")
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "gpsfsm", *slowly],
        cwd=tmp_path,
        env=environment(),
        stdout=subprocess.PIPE,
    )
    assert process.stdout is not None
    assert [process.stdout.readline() for _ in range(2)] == [each + b"\n" for each in whole[:2]]
    process.kill()
    process.stdout.close()
    process.wait(60)
    before = rows("j.db", tmp_path)
    assert before[-1]["kind"] != "ENDED"
    resumed = run("resume", "j.db", cwd=tmp_path)
    assert resumed.returncode == 0, resumed.stderr
    assert resumed.stdout.splitlines()[-1] == whole[-1]
    assert rows("j.db", tmp_path)[: len(before)] == before
    assert run("replay", "j.db", cwd=tmp_path).returncode == 0


def test_the_leaves_of_a_profile_drive_in_a_world(tmp_path: Path) -> None:
    done = run("run", *IN_DEPOT, "--journal", "j.db", cwd=tmp_path)
    assert done.returncode == 0, done.stdout
    journaled = rows("j.db", tmp_path)
    drives = [
        (row["data"]["x"], row["data"]["y"])
        for row in journaled
        if row["kind"] == "TRIGGERED" and row["interface"].endswith("WaypointRunner")
    ]
    assert drives == [(3.5, 5.0), (6.0, 4.0), (6.0, 4.0)]
    took = {
        row["data"]["seconds"]
        for row in journaled
        if row["kind"] == "TRIGGERED" and row["interface"] == WAIT
    }
    assert took == {0.2, 6.0, 5.0, 3.14}
    failed = [row["message"] for row in journaled if row["kind"] == "FAILED"]
    assert "no way leads to (6, 4): the zone 'gate' is closed" in failed


def test_a_condition_is_what_the_world_says(tmp_path: Path) -> None:
    world = (NAV2 / "depot.yaml").read_text(encoding="utf-8").replace("until: 60", "until: 12")
    (tmp_path / "world.yaml").write_text(world, encoding="utf-8")
    words = ("run", DEPOT, "--robot", PROFILE, "--world", "world.yaml", "--seed", "1")
    done = run(*words, cwd=tmp_path)
    assert done.returncode == 1
    assert b"IsBatteryLow succeeded: answer='yes'" in done.stdout
    assert b"NavigateToPose (goal={goal})" not in done.stdout


@pytest.mark.parametrize(
    ("leaf", "message"),
    [
        ('<NavigateToPose goal="{x}"/>', "the value of {x} is unknown; set it in 'black"),
        ('<NavigateToPose goal="1;2"/>', "'1;2' has other parts than those from which x comes"),
        (
            '<NavigateToPose goal="a;2;0"/>',
            "x is a number, not 'a'; define its meaning in 'words' of the leaf",
        ),
        ("<NavigateToPose/>", "it has no port 'goal'; write one"),
        ('<Wait wait_duration="-1"/>', "seconds is -1, which the robot does not accept"),
    ],
)
def test_a_leaf_without_a_value_is_not_run(leaf: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "t.xml").write_text(tree("<Spin/>", leaf), encoding="utf-8")
    words = ("--robot", PROFILE, "--world", NAV2 / "depot.yaml", "--journal", "j.db")
    checked = run("run", "t.xml", *words, cwd=tmp_path)
    assert checked.returncode == (2 if "{x}" in leaf else 1)  # as in a plan: GP205, GP206, GP401
    refused = run("run", "t.xml", *words, "--force", cwd=tmp_path)
    assert refused.returncode == 2
    name = re.match(r"<(\w+)", leaf)
    assert name is not None
    assert f"t.xml:3: {name[1]}: {message}" in refused.stderr.decode()
    assert not refused.stdout
    assert not (tmp_path / "j.db").exists()


def test_the_nine_parts_of_a_pose_and_words_of_a_leaf(tmp_path: Path) -> None:
    profile = """name: mine
blackboard: {room: kitchen}
leaves:
  MoveTo:
    runner: nav2_capabilities/WaypointRunner
    words: {kitchen: 1;2}
    parameters:
      x: {port: where, part: 1}
      y: {port: where, part: 2}
"""
    (tmp_path / "mine.yaml").write_text(profile, encoding="utf-8")
    (tmp_path / "w.yaml").write_text("world: field\n", encoding="utf-8")
    (tmp_path / "t.xml").write_text(
        tree('<MoveTo where="kitchen"/>', '<MoveTo where="{room}"/>', '<MoveTo where="3;4"/>'),
        encoding="utf-8",
    )
    (tmp_path / "nine.xml").write_text(
        tree('<NavigateToPose goal="0;map;5;6;0;0;0;1;0"/>'), encoding="utf-8"
    )
    for file, robot in (("t.xml", "mine.yaml"), ("nine.xml", PROFILE)):
        words = ("--robot", robot, "--world", "w.yaml", "--journal", f"{file}.db")
        done = run("run", file, *words, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    places = [
        (row["data"]["x"], row["data"]["y"], row["data"]["qz"])
        for name in ("t.xml.db", "nine.xml.db")
        for row in rows(name, tmp_path)
        if row["kind"] == "TRIGGERED"
    ]
    assert places == [(1.0, 2.0, 0.0), (1.0, 2.0, 0.0), (3.0, 4.0, 0.0), (5.0, 6.0, 1.0)]


def test_nothing_acts_for_real_under_another_name(tmp_path: Path) -> None:
    (tmp_path / "t.xml").write_text(tree('<Wait wait_duration="0"/>'), encoding="utf-8")
    refused = run("run", "t.xml", "--real", "--robot", PROFILE, cwd=tmp_path)
    assert refused.returncode == 2
    assert b"the tree cannot be run for real" in refused.stderr
    assert b"what a robot profile says of 'leaves' is for simulations" in refused.stderr


def test_what_leaves_hand_over_reaches_no_other_leaf(tmp_path: Path) -> None:
    """A pose that one leaf has looked up does not replace the place that another one has."""
    leaves = ("nav2_capabilities/RobotPoseRunner", "nav2_capabilities/WaypointRunner")
    profile = f"""name: mine
leaves:
  Where: {{runner: {leaves[0]}}}
  Go: {{runner: {leaves[1]}, parameters: {{x: {{port: x}}, y: {{port: y}}}}}}
"""
    (tmp_path / "mine.yaml").write_text(profile, encoding="utf-8")
    (tmp_path / "w.yaml").write_text("world: field\n", encoding="utf-8")
    (tmp_path / "t.xml").write_text(tree("<Where/>", '<Go x="3" y="4"/>'), encoding="utf-8")
    words = ("--robot", "mine.yaml", "--world", "w.yaml", "--journal", "j.db")
    assert run("run", "t.xml", *words, cwd=tmp_path).returncode == 0
    begun = [row["data"] for row in rows("j.db", tmp_path) if row["kind"] == "TRIGGERED"]
    assert (begun[-1]["x"], begun[-1]["y"]) == (3.0, 4.0)


def test_a_scenario_of_a_machine_is_refused_as_such(tmp_path: Path) -> None:
    file = machine(tmp_path)
    run("check", file, "--format", "json", "--output-file", "report.json", cwd=tmp_path)
    refused = run("run", file, "--scenario", "report.json", cwd=tmp_path)
    assert refused.returncode == 2
    assert b"a scenario of a machine has outcomes for each visit" in refused.stderr


def test_a_leaf_of_no_runner_is_drawn_in_a_simulation_but_never_acts(tmp_path: Path) -> None:
    (tmp_path / "t.xml").write_text(tree("<Look/>", '<Wait wait_duration="1"/>'), encoding="utf-8")
    drawn = run("run", "t.xml", "--robot", PROFILE, "--seed", "1", cwd=tmp_path)
    assert drawn.returncode == 0, drawn.stderr
    assert "Look started" in drawn.stdout.decode()
    excused = tree("<!-- gpsfsm: ignore GP214 because I know -->", "<Look/>")
    (tmp_path / "excused.xml").write_text(excused, encoding="utf-8")
    assert (
        run("run", "excused.xml", "--robot", PROFILE, "--seed", "1", cwd=tmp_path).returncode == 0
    )
    real = run("run", "t.xml", "--robot", PROFILE, "--real", cwd=tmp_path)
    assert real.returncode == 2
    assert "the leaf 'Look' stands for no runner on the robot 'nav2'" in real.stderr.decode()
    assert not real.stdout
