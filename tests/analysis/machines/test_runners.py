"""Leaves of behaviour trees and instances of machines as runners of a robot."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import gpsfsm
from gpsfsm.gating import Reason

WAYPOINT = "nav2_capabilities/WaypointRunner"
SPEECH = "fp_perception_capabilities/SpeechRunner"
PROCESS = "generic_capabilities/ProcessRunner"
ROBOT = f"""\
name: lab
runners: [{WAYPOINT}, {SPEECH}, {PROCESS}, nav2_capabilities/RobotPoseRunner]
map: {{x: [-10, 10], y: [-5, 5]}}
resources: {{{SPEECH}: [speaker]}}
allow: {{programs: [echo]}}
blackboard: {{goal: "1;2"}}
leaves:
  MoveTo:
    runner: {WAYPOINT}
    words: {{kitchen: 4;1, moon: 400;1}}
    parameters: {{x: {{port: location, part: 1}}, y: {{port: location, part: 2}}}}
  Say: {{runner: {SPEECH}, parameters: {{text: {{port: text}}}}}}
  Run: {{runner: {PROCESS}, parameters: {{command: {{port: cmd}}}}}}
"""
LOOP = "<KeepRunningUntilFailure>{}</KeepRunningUntilFailure>"
"""Makes a machine of a tree that would be a plan."""


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    file = tmp_path / "robot.yaml"
    file.write_text(ROBOT, encoding="utf-8")
    return file


def tree(inside: str, more: str = "") -> str:
    return (
        '<root BTCPP_format="4" main_tree_to_execute="A">'
        f'<BehaviorTree ID="A">{inside}</BehaviorTree>{more}</root>'
    )


def action(name: str, attributes: str = "") -> str:
    return f'<Action ID="{name}" {attributes}/>'


BOTH = '<Parallel success_count="2"><Say text="a"/><Say text="b"/></Parallel>'
RM = action(PROCESS, 'command="rm -rf /"')
CALLED = '<BehaviorTree ID="B"><Run cmd="{c}"/></BehaviorTree>'


@pytest.mark.parametrize("around", ["{}", LOOP])
@pytest.mark.parametrize(
    ("inside", "more", "codes"),
    [
        ('<MoveTo location="kitchen"/>', "", []),
        ('<MoveTo location="moon"/>', "", ["GP206"]),
        ('<MoveTo location="hall;3"/>', "", ["GP205"]),
        ("<MoveTo/>", "", ["GP401"]),
        ('<Say text="{whom}"/>', "", []),
        ('<Run cmd="echo a"/>', "", []),
        ('<Run cmd="rm a"/>', "", ["GP213"]),
        ('<SubTree ID="B" c="rm -rf /"/>', CALLED, ["GP213"]),
        (BOTH, "", ["GP501"]),
        (action(WAYPOINT, 'x="1" y="1"'), "", []),
        (action(WAYPOINT, 'x="100" y="1"'), "", ["GP206"]),
        (action("capabilities2_runner_nav2/WaypointRunner", 'x="1" y="1"'), "", ["GP208"]),
        (action("nav2_capabilities/FlyRunner", 'x="{x}"'), "", ["GP201"]),
        (RM, "", ["GP213"]),
        (f'<RateController hz="1">{RM}</RateController>', "", ["GP213"]),
    ],
)
def test_a_leaf_is_the_runner_that_it_stands_for(
    robot: Path, around: str, inside: str, more: str, codes: list[str]
) -> None:
    text = tree(around.format(inside), more)
    verdict = gpsfsm.gate(text, budget_ms=None, allow_trees=True, robot=robot)
    assert [each.rule for each in verdict.findings] == codes
    assert verdict.reason is (Reason.FINDINGS if codes else Reason.PASSED)


@pytest.mark.parametrize("around", ["{}", LOOP])
@pytest.mark.parametrize(
    ("inside", "column", "why"),
    [
        ('<ProcessRunner command="rm -rf /"/>', 1, "the leaf 'ProcessRunner' stands for no runner"),
        ('<Condition ID="DoorOpen"/>', 1, "the leaf 'DoorOpen' stands for no runner"),
        ('<Say text="a"><Say text="b"/></Say>', 1, "the node 'Say' with its children"),
        ('<Sequence><Say text="a"/><Jump/></Sequence>', 26, "the leaf 'Jump' stands for no runner"),
        ('<MoveTo location="{goal}"/>', 1, "the blackboard supplies 'x' and 'y'"),
        (action(WAYPOINT, 'x="{x}" y="1"'), 1, "the blackboard supplies 'x' of"),
    ],
)
def test_a_leaf_of_which_nobody_knows_what_it_does_leaves_the_gate_undecided(
    robot: Path, around: str, inside: str, column: int, why: str
) -> None:
    text = tree(around.format(inside))
    (report,) = gpsfsm.check(text, robot=robot).plans
    (left_open,) = [each for each in report.findings if each.rule == "GP214"]
    assert why in left_open.message
    assert left_open.severity.value == "warning"
    assert left_open.location.column == text.index(inside) + column
    for more in ({}, {"fail_on": "warning", "ignore": ["GP214"]}, {"allow_suppressions": True}):
        commented = text.replace("<Beh", "<!-- gpsfsm: ignore GP214 because I know --><Beh")
        for each in (text, commented):
            verdict = gpsfsm.gate(each, budget_ms=None, allow_trees=True, robot=robot, **more)
            assert verdict.reason is Reason.INCONCLUSIVE
            assert why in verdict.message
            assert "GP214" in [finding.rule for finding in verdict.findings]


def test_a_program_of_which_the_tree_does_not_say_which_is_refused(robot: Path) -> None:
    verdict = gpsfsm.gate(tree('<Run cmd="{c}"/>'), budget_ms=None, allow_trees=True, robot=robot)
    assert not verdict
    assert {each.rule for each in verdict.findings} == {"GP213", "GP214"}


def test_without_a_profile_full_names_alone_are_runners() -> None:
    def codes(inside: str) -> list[str]:
        verdict = gpsfsm.gate(tree(inside), budget_ms=None, allow_trees=True)
        return [each.rule for each in verdict.findings]

    assert codes('<ProcessRunner command="rm -rf /"/>') == []
    assert codes(RM) == ["GP213"]
    assert codes(action(WAYPOINT, 'x="a" y="1"')) == ["GP205"]


def test_a_value_from_any_of_several_steps_of_a_machine_has_no_bounds(robot: Path) -> None:
    def node(name: str, interface: str, **parameters: object) -> dict[str, object]:
        return {"id": name, "kind": "runner", "interface": interface, "parameters": parameters}

    pose, say = "nav2_capabilities/RobotPoseRunner", SPEECH
    nodes = [
        {"id": "s", "kind": "start"},
        node("a", say, text="a"),
        node("b", pose),
        node("c", WAYPOINT, x=1, y=1),
        {"id": "end", "kind": "complete"},
    ]
    edges = [("s", "a"), ("a", "b"), ("a", "c"), ("b", "c"), ("c", "end")]
    failed = {("a", "c"), ("b", "end")}
    machine = {
        "nodes": nodes,
        "edges": [
            {"source": s, "event": "FAILED" if (s, t) in failed else "SUCCEEDED", "target": t}
            for s, t in [*edges, ("b", "end")]
        ],
    }
    (report,) = gpsfsm.check(json.dumps(machine), robot=robot).plans
    messages = [each.message for each in report.findings if each.rule == "GP206"]
    assert len(messages) == 2  # x and y
    assert all("from RobotPoseRunner" in each for each in messages)
