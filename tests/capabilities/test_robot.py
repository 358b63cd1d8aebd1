"""Robot profiles: reading them, the library of a robot, and what its plans may write."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest
from hypothesis import given
from hypothesis import strategies as st

import gpsfsm
from gpsfsm.analysis.rules.gp2xx_parameters import inside
from gpsfsm.capabilities.library import choose_capabilities
from gpsfsm.capabilities.robot import load_profile
from gpsfsm.errors import ConfigError
from tests.cli.support import runner

WAYPOINT = "nav2_capabilities/WaypointRunner"
SPEECH = "fp_perception_capabilities/SpeechRunner"
OLD_SPEECH = "perception_capabilities/SpeechRunner"
PROCESS = "generic_capabilities/ProcessRunner"
HTTP = "generic_capabilities/HttpRunner"
LAB = f"""\
name: lab
runners: [{WAYPOINT}, {SPEECH}, {PROCESS}, {HTTP}]
map: {{x: [-10, 10], y: [-5, 5]}}
allow: {{programs: [echo], hosts: ["robot.local:8080"]}}
engine: fabric-v2
tolerate: 0
"""


def step(name: str, **attributes: str) -> str:
    written = "".join(f' {key}="{value}"' for key, value in attributes.items())
    return f'<Runner interface="{name}" provider="{name}"{written}/>'


def plan(*steps: str) -> str:
    return "<Plan>\n" + "\n".join(steps) + "\n</Plan>"


def write(folder: Path, text: str) -> Path:
    file = folder / "robot.yaml"
    file.write_text(text, encoding="utf-8")
    return file


def errors(text: str, robot: Path | None, **options: Any) -> list[tuple[str, int]]:
    (report,) = gpsfsm.check(text, robot=robot, **options).plans
    return [
        (each.rule, each.location.line)
        for each in report.findings
        if each.severity.value == "error"
    ]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "1:1: error: the file is empty"),
        ("runners: []\nname: r\n", "1:1: error: 'runners' is empty"),
        ("name: r\nrunner: [a/B]\n", "2:1: error: the key 'runner' is not known here\n    did you"),
        (f"name: r\nrunners: [{WAYPOINT[:-1]}]\n", "2:11: error: no file describes the runner"),
        (f"name: r\nrunners: [{SPEECH}, {OLD_SPEECH}]\n", "is the same runner as"),
        ("name: r\nbounds: {x: 3}\n", "2:10: error: the bounds of 'x' must be two numbers"),
        ("name: r\nbounds: {x: [3, 1]}\n", "2:10: error: the least 'x' is greater"),
        ("name: r\nrunners:\n", "2:1: error: nothing is behind 'runners'"),
        ("name: r\nmap: {x: [0, 1], y: }\n", "2:18: error: nothing is behind 'y'"),
        (
            "name: r\nbounds: {generic_capabilities/WaitRunner: {seconds: [-9, -3]}}\n",
            "2:44: error: with its file, no value of 'seconds' is left",
        ),
        ("name: r\nbounds: {speed: [0, 1]}\n", "2:10: error: no runner of this robot has"),
        ("name: r\nbounds: {a/B: {x: [0, 1]}}\n", "2:10: error: the robot has no runner 'a/B'"),
        ("name: r\nmap: {x: [0, 1]}\n", "the map has no area"),
        ("name: r\nmap: {corners: [[0, 0], [1, 1]]}\n", "a polygon has from 3"),
        ("name: r\nengine: fabric-v9\n", "2:1: error: there is no engine 'fabric-v9'\n    did you"),
        ("name: r\ntolerate: 1.5\n", "2:1: error: 'tolerate' must be a whole number"),
        ("name: r\ncapabilities: [/etc]\n", "2:1: error: '/etc' is not a folder beside or below"),
        ("name: r\ncapabilities: [../x]\n", "2:1: error: '../x' is not a folder beside or below"),
        ("name: r\nresources: {a/B: [arm]}\n", "2:13: error: the robot has no runner 'a/B'"),
        ("name: r\nleaves: {Go: {}}\n", "'leaves.Go' has no 'runner'"),
        ("name: r\nleaves: {Go: {runner: a/B}}\n", "'Go' stands for 'a/B', which is not a runner"),
        (
            f"name: r\nleaves: {{Go: {{runner: {WAYPOINT}}}}}\n",
            f"2:10: error: '{WAYPOINT}' needs a value for 'x'",
        ),
        (
            f"name: r\nleaves: {{Go: {{runner: {WAYPOINT}, parameters: {{x: {{}}, y: 1}}}}}}\n",
            "nothing says where 'x' comes from",
        ),
        (
            f"name: r\nleaves: {{Go: {{runner: {WAYPOINT}, parameters: {{x: 1, y: 1, w: 1}}}}}}\n",
            f"'{WAYPOINT}' has no parameter 'w'",
        ),
        (
            "name: r\nleaves: {Go: {runner: a/B, parameters: {x: {port: p, part: 0}}}}\n",
            "must be the number of a part, from 1 on",
        ),
        (
            "name: r\nleaves: {Go: {runner: a/B, parameters: {x: {port: p, part: {2: 3}}}}}\n",
            "must be the number of a part, from 1 on",
        ),
        (
            "name: r\nleaves: {Go: {runner: a/B, parameters: {x: {prot: p, text: 1}}}}\n",
            "the key 'prot' is not known here\n    did you mean 'port'",
        ),
        ("name: r\nx: &a 1\n", "the anchor '&a' is not allowed"),
        ('name: r\nallow: {programs: [""]}\n', "2:9: error: '' is not a program"),
        (
            "name: r\nros: {via: capabilities}\n",
            "2:7: error: 'capabilities' is not a server for runners\n    did you mean 'capa",
        ),
        ("name: r\nros: {deadline: 0}\n", "2:7: error: 'deadline' must be more than 0 seconds"),
        ("name: r\nros: {deadline: .inf}\n", "2:"),
    ],
)
def test_a_mistake_is_told_with_its_place(tmp_path: Path, text: str, expected: str) -> None:
    file = write(tmp_path, text)
    with pytest.raises(ConfigError) as raised:
        choose_capabilities((), robot=file)
    assert expected in str(raised.value)
    assert str(raised.value).startswith(str(file))


def test_a_file_that_is_not_there_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"robot\.yaml:1:1: error: the file cannot be read"):
        load_profile(tmp_path / "robot.yaml")


@pytest.mark.parametrize(
    ("written", "expected"),
    [
        (step(WAYPOINT, x="2", y="1"), []),
        (step(WAYPOINT, x="1000000", y="1"), [("GP206", 2)]),
        (step(OLD_SPEECH, text="hi"), [("GP208", 2)]),
        (step(SPEECH, text="hi"), []),
        (step("my_robot/Fly"), [("GP201", 2)]),
        (step("nav2_capabilities/RobotPoseRunner"), [("GP201", 2)]),
        (step(PROCESS, command="echo hi"), []),
        (step(PROCESS, command="rm -rf /"), [("GP213", 2)]),
        (step(HTTP, url="http://robot.local:8080/go"), []),
        (step(HTTP, url="http://robot.local/go"), [("GP213", 2)]),
        (step(HTTP, url="http://robot.local:8080@evil.example/"), [("GP213", 2)]),
    ],
)
def test_what_the_robot_lacks_is_an_error(
    tmp_path: Path, written: str, expected: list[tuple[str, int]]
) -> None:
    robot = write(tmp_path, LAB.replace("engine: fabric-v2\n", ""))
    assert errors(plan(written), robot) == expected


def test_without_a_profile_published_names_are_equally_right() -> None:
    def codes(*steps: str) -> set[str]:
        (report,) = gpsfsm.check(plan(*steps)).plans
        return {each.rule for each in report.findings}

    older = step("capabilities2_runner_nav2/WaypointRunner", x="1.5", y="1.5")
    assert "GP208" not in codes(older)
    assert "GP208" not in codes(step(SPEECH, text="hi"), step(WAYPOINT, x="1.5", y="1.5"))
    assert "GP208" in codes(older, step(WAYPOINT, x="1.5", y="2.5"))
    assert "GP208" in codes(step(SPEECH, text="hi"), step(OLD_SPEECH, text="ho"))


def test_a_gate_permits_nothing_by_itself(tmp_path: Path) -> None:
    text = plan(step(PROCESS, command="echo hi"))
    refused = gpsfsm.gate(text, budget_ms=None)
    assert [each.rule for each in refused.findings] == ["GP213"]
    permitted = gpsfsm.gate(text, budget_ms=None, allow={"program": ["echo"]})
    assert permitted
    assert not gpsfsm.gate(text, budget_ms=None, allow={"program": ["cat"]})
    (report,) = gpsfsm.check(text).plans
    assert ("GP213", "warning") in [(each.rule, each.severity.value) for each in report.findings]
    robot = write(tmp_path, LAB.replace("engine: fabric-v2\n", ""))
    accepted = gpsfsm.gate(text, budget_ms=None, robot=robot)
    assert accepted
    digests = {refused.digests.all, permitted.digests.all, accepted.digests.all}
    assert len(digests) == 3


@pytest.mark.parametrize(
    "changed",
    [
        LAB.replace("name: lab", "name: hall"),
        LAB.replace("10]", "11]"),
        LAB.replace("[echo]", "[echo, cat]"),
        LAB.replace("fabric-v2", "fabric-v1"),
        LAB.replace("tolerate: 0", "tolerate: 1"),
        LAB.replace("map:", "resources: {nav2_capabilities/WaypointRunner: [arm]}\nmap:"),
        LAB + "deadline: 60\n",
    ],
)
def test_the_digests_cover_the_whole_profile(tmp_path: Path, changed: str) -> None:
    text = plan(step(WAYPOINT, x="1.5", y="1.5"))
    before = gpsfsm.gate(text, budget_ms=None, robot=write(tmp_path, LAB)).digests
    after = gpsfsm.gate(text, budget_ms=None, robot=write(tmp_path, changed)).digests
    assert before.all != after.all


def test_the_call_goes_over_the_profile(tmp_path: Path) -> None:
    robot = write(tmp_path, LAB)
    settings = gpsfsm.api.CheckSettings.of({"robot": robot})
    assert settings.engine == "paper", "a field that was not an argument is as it was"
    settings = gpsfsm.api.CheckSettings.of({"robot": robot, "engine": "paper"})
    assert settings.engine == "fabric-v2"
    settings = gpsfsm.api.CheckSettings.of({"robot": robot, "engine": "fabric-v1"})
    assert settings.engine == "fabric-v1"


def test_a_polygon_bounds_places(tmp_path: Path) -> None:
    robot = write(tmp_path, "name: lab\nmap: {corners: [[0, 0], [4, 0], [4, 4]]}\n")
    assert errors(plan(runner(x="3.0", y="1.0")), robot) == []
    assert errors(plan(runner(x="1.0", y="3.0")), robot) == [("GP206", 2)]
    assert errors(plan(runner(x="5.0", y="1.0")), robot)[0] == ("GP206", 2)


@pytest.mark.parametrize("area", ["{x: [0, 4], y: [0, 4]}", "{corners: [[0, 0], [4, 0], [4, 4]]}"])
def test_a_map_allows_no_place_in_another_frame(tmp_path: Path, area: str) -> None:
    """Nothing says where that is on the map."""
    drive = step("nav2_capabilities/WaypointYawRunner", x="3.0", y="1.0", yaw="1.5", frame="odom")
    robot = write(tmp_path, f"name: lab\nmap: {area}\n")
    assert errors(plan(drive), robot) == [("GP206", 2)]
    assert errors(plan(drive.replace("odom", "map")), robot) == []
    assert errors(plan(drive), write(tmp_path, "name: lab\nbounds: {x: [0, 4]}\n")) == []


places = st.integers(-6, 6)


@given(st.tuples(places, places), st.tuples(places, places), st.tuples(places, places))
def test_a_rectangle_is_a_polygon(
    low: tuple[int, int], high: tuple[int, int], point: tuple[int, int]
) -> None:
    (x1, x2), (y1, y2) = sorted((low[0], high[0])), sorted((low[1], high[1]))
    corners = [(x1, y1), (x2, y1), (x2, y2), (x1, y2)]
    expected = x1 <= point[0] <= x2 and y1 <= point[1] <= y2
    if x1 < x2 and y1 < y2:
        assert inside(point, corners) is expected
        assert inside(point, corners[::-1]) is expected


steps = st.one_of(
    st.builds(
        lambda x, y: step(WAYPOINT, x=x, y=y),
        st.sampled_from(["0.5", "10", "-10.5", "1000000", "nan", "1e9"]),
        st.sampled_from(["0.5", "5", "-6"]),
    ),
    st.sampled_from([SPEECH, OLD_SPEECH, "my_robot/Fly"]).map(lambda name: step(name, text="a")),
    st.sampled_from(["echo hi", "rm -rf /", "'echo' b", "echo", ""]).map(
        lambda text: step(PROCESS, command=text)
    ),
)


@given(st.lists(steps, min_size=1, max_size=4))
def test_an_accepted_plan_uses_the_robot_alone(written: list[str]) -> None:
    text = plan(*written)
    if errors(text, PROFILE):
        return
    for each in ET.fromstring(text):  # noqa: S314  (it is ours)
        assert each.get("interface") in (WAYPOINT, SPEECH, PROCESS, HTTP)
        assert each.get("provider") == each.get("interface")
        if each.get("interface") == WAYPOINT:
            assert -10 <= float(each.get("x", "")) <= 10
            assert -5 <= float(each.get("y", "")) <= 5
        if each.get("interface") == PROCESS:
            assert each.get("command", "").replace("'", "").split()[0] == "echo"


PROFILE = Path(__file__).parents[2] / "docs/examples/robot/robot.yaml"


def test_what_arrives_is_not_known_to_be_within_the_bounds(tmp_path: Path) -> None:
    """The value of the step before replaces the one that the plan writes."""
    pose = "nav2_capabilities/RobotPoseRunner"
    profile = f"name: lab\nrunners: [{WAYPOINT}, {pose}, {SPEECH}]\nbounds: {{x: [0, 4]}}\n"
    robot = write(tmp_path, profile)
    go, there = step(pose), step(WAYPOINT, x="1.0", y="1.0")
    assert errors(plan(go, there), robot) == [("GP206", 3)]
    assert errors(plan(go, step(SPEECH, text="hi"), there), robot) == []
    unbounded = write(tmp_path, profile.replace("bounds: {x: [0, 4]}\n", ""))
    assert errors(plan(go, there), unbounded) == []
