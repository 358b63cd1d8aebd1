"""Lists in goals and results, through rclpy to a server and back."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path

    from tests.ros.support import Domain, Program

INTERFACE = "name: arm/Move\nspec_type: interface\nspec_version: 1.2\n"
PROVIDER = """
name: arm/Move
spec_type: provider
spec_version: 1.2
implements: arm/Move
ros:
  action: move_arm
  type: arm_msgs/action/Move
  request:
    constraints[].joints[].name: [base, elbow]
    constraints[].joints[].position: $joints
    constraints[].joints[].weight: 3
    offset: [0.5, 1, $z]
    tools: $tools
    limits: [2.5]
    flags: 5
  outputs:
    best: sights[best by scores[first].score].id
    all: sights[all].id
    near: sights[first].distance
  success: [{reached_goal: true}, {stalled: true, effort: '>= 2'}]
definition:
  configuration_parameters:
    - {name: joints, type: 'double[]'}
    - {name: z, type: double}
    - {name: tools, type: string}
  runtime_parameters:
    input: []
    output:
      - {name: best, type: string}
      - {name: all, type: 'string[]'}
      - {name: near, type: double}
"""
MOVE = '<Runner interface="arm/Move" provider="arm/Move" joints="{0}" z="2" tools="gripper, saw"/>'
SIGHTS = [
    {"id": "cup", "scores": [{"label": "cup", "score": 0.5}], "distance": math.inf},
    {"id": "jug", "scores": [{"label": "jug", "score": 0.75}], "distance": 1.0},
]


def moved(ros: Domain, server: Program, joints: str, **answer: Any) -> tuple[int, str]:
    """The exit code and the output of a plan with one move."""
    server.command("answer", **answer)
    files: dict[str, str] = {
        "caps/arm/interfaces/Move.yaml": INTERFACE,
        "caps/arm/providers/Move.yaml": PROVIDER,
        "plan.xml": f"<Plan>\n{MOVE.format(joints)}\n</Plan>\n",
    }
    for name, text in files.items():
        file: Path = ros.folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text.lstrip())
    words = ("--capabilities", ros.folder / "caps", "--journal", "run.db", "--format", "plain")
    ended = ros.gpsfsm("run", "--real", "--force", ros.folder / "plan.xml", *words)
    assert "Traceback" not in ended.stderr
    return ended.returncode, ended.stdout + ended.stderr


def outputs(ros: Domain) -> dict[str, Any]:
    listed = ros.gpsfsm("events", "run.db", "--format", "jsonl")
    rows = [json.loads(line) for line in listed.stdout.splitlines()[1:]]
    data: dict[str, Any] = next(row["data"] for row in rows if row["kind"] == "SUCCEEDED")
    return data


def test_lists_in_lists_arrive_and_what_is_picked_comes_back(ros: Domain) -> None:
    server = ros.server("arm")
    code, out = moved(ros, server, "0.1 0.2", sights=SIGHTS, stalled=True, effort=2)
    assert code == 0, out
    assert server.journal("goal")[0]["request"] == {
        "constraints": [
            {
                "label": "",
                "joints": [
                    {"name": "base", "position": 0.1, "weight": 3},
                    {"name": "elbow", "position": 0.2, "weight": 3},
                ],
            }
        ],
        "offset": [0.5, 1.0, 2.0],
        "tools": ["gripper", "saw"],
        "limits": [2.5],
        "flags": "05",
    }
    assert outputs(ros) == {"best": "jug", "all": ["cup", "jug"]}, "near is not measured"


def test_what_does_not_fit_is_not_sent(ros: Domain) -> None:
    server = ros.server("arm")
    code, out = moved(ros, server, "0.1 0.2 0.3")
    assert code == 2
    assert "the lists for joints of Constraint differ in length" in out
    assert server.journal("goal") == []


def test_no_set_of_conditions_holds(ros: Domain) -> None:
    server = ros.server("arm")
    code, out = moved(ros, server, "0 0", sights=SIGHTS, stalled=True, effort=1)
    assert code == 1
    assert "answers reached_goal=False and effort=1.0" in out
