"""What the fake capability server offers, and the texts in which it describes that."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import yaml

if TYPE_CHECKING:
    from collections.abc import Iterator

_OLD = (
    "capabilities2_runner_nav2/WaypointRunner",
    "capabilities2_runner_system/InputMultiplexAnyRunner",
    "capabilities2_runner_system/InputMultiplexAllRunner",
)
_NEW = (
    "nav2_capabilities/WaypointRunner",
    "nav2_capabilities/RobotPoseRunner",
    "prompt_capabilities/PromptTextRunner",
    "gripper_capabilities/GraspRunner",
    "capabilities2_runner/InputMultiplexRunner",
)
INTERFACES = {1: _OLD, 2: _NEW, 3: _NEW}
PROVIDERS = tuple((name, name) for name in (*_OLD, *_NEW))

GRASP: dict[str, Any] = {
    "command": "<Runner interface=gripper_capabilities/GraspRunner "
    "provider=gripper_capabilities/GraspRunner force='$force' label='$label' fingers='$fingers' />",
    "configuration_parameters": [
        {"name": "force", "type": "double"},
        {"name": "label", "type": "string", "optional": True, "default": ""},
        {"name": "fingers", "type": "int[]", "optional": True},
    ],
    "runtime_parameters": {
        "input": [],
        "output": [{"name": "widths", "type": "double[]"}, {"name": "held", "type": "bool"}],
    },
}
_DEFINITIONS = {"GraspRunner": GRASP}

HOSTILE = (
    ("..", "capability_interface", "name: ../../escaped\nspec_type: interface\n"),
    ("a/../../b", "capability_provider", "name: x\nspec_type: provider\nimplements: a/x\n"),
    ("broken", "capability_interface", 'name: Broken\ndescription: "no end\n'),
    ("tagged", "capability_interface", "name: !!python/object/apply:os.getcwd []\n"),
    ("large", "capability_interface", "name: Large\ndescription: " + "x" * (1 << 21)),
    ("deep", "capability_interface", "name: Deep\ndescription: " + "[" * 5000),
)


def _text(data: Any) -> str:
    return str(yaml.safe_dump(data, sort_keys=False))


def redumped(version: int) -> Iterator[tuple[str, str, str]]:
    """Package, kind and text of each, as the server writes it out of its database.

    The version has become one character, and definitions are lost.
    """
    for name in INTERFACES[version]:
        package, _, short = name.partition("/")
        header = {"name": short, "spec_version": "\x01", "description": f"It is {short}."}
        interface = header | {"spec_type": "interface", "interface": {"services": {}}}
        yield package, "interface", _text(interface)
        provider = header | {
            "spec_type": "provider",
            "implements": name,
            "runner": f"capabilities2_runner::{short}",
        }
        yield package, "provider", _text(provider)


def runnable(*, hostile: bool) -> Iterator[tuple[str, str]]:
    """Name and text of each, with a definition in a definition."""
    for name in INTERFACES[3]:
        short = name.rpartition("/")[2]
        header = {"name": name, "spec_version": 1, "description": f"It is {short}."}
        described: dict[str, Any] = {
            "provider": header | {"spec_type": "provider"},
            "interface": header | {"spec_type": "interface"},
        }
        if short in _DEFINITIONS:
            described["definition"] = {"definition": _DEFINITIONS[short]}
        yield name, _text(described)
    if hostile:
        for package, _, content in HOSTILE:
            yield f"{package}/Hostile", content
        yield "a/Mapping", "provider: [1, 2]\ninterface: 3\n"
        yield "../up/Away", "provider: {name: ../up/Away}\ninterface: {name: ../up/Away}\n"
