"""Every simulated runner keeps to the contract of runners and to its capability file."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gpsfsm.execution.conformance import check_runner
from gpsfsm.simulation.makers import Drawn, simulated_class, world_services
from gpsfsm.simulation.world import Answer, Person, Reply, Sound, Stay
from tests.simulation.support import LIBRARY, field_of

POSE = {"x": 1.0, "y": 1.0, "z": 0.0, "qx": 0.0, "qy": 0.0, "qz": 0.0, "qw": 1.0}
JOINTS = {"joint_names": ["a", "b"], "joint_positions": [0.1, 0.2]}
PARAMETERS = {
    "nav2_capabilities/WaypointRunner": POSE,
    "nav2_capabilities/WaypointYawRunner": {"x": 1.0, "y": 1.0, "yaw": 1.5, "frame": "map"},
    "perception_capabilities/CheckRunner": {"prompt": "Is it so?", "text": "Yes."},
    "perception_capabilities/TranscribeRunner": {"audio_request_window": 5},
    "perception_capabilities/SpeechRunner": {"text": "hello"},
    "perception_capabilities/SentimentRunner": {"text": "hello"},
    "prompt_capabilities/PromptTextRunner": {"text": "a", "uuid": "u", "flush": True},
    "prompt_capabilities/PromptPoseRunner": {**POSE, "uuid": "u", "flush": True},
    "prompt_capabilities/PromptCapabilityRunner": {"CapabilitySpecs": ["a"], "flush": True},
    "prompt_capabilities/PromptOccupancyRunner": {"OccupancyGrid": "#", "flush": False},
    "prompt_capabilities/PromptNamedPosesRunner": {"pose_names": ["a"], "descriptions": ["b"]},
    "prompt_capabilities/PromptCurrentJointPoseRunner": JOINTS,
    "prompt_capabilities/PromptGripperStateRunner": {**JOINTS, "flush": True},
    "prompt_capabilities/PromptCurrentCartesianPoseRunner": POSE,
    "prompt_capabilities/PromptSpeechRunner": {"task": "t", "flush": True},
    "prompt_capabilities/PromptPlanRunner": {"task": "t", "flush": True},
    "fabric_capabilities/FabricSetPlanRunner": {"ReceivedPlan": "<Plan/>"},
    "fabric_capabilities/FabricGeneratePlanRunner": {"task": "t", "flush": True},
    "generic_capabilities/WaitRunner": {"seconds": 2.0},
    "generic_capabilities/LogRunner": {"text": "t"},
    "generic_capabilities/HttpRunner": {"url": "http://a/", "timeout_s": 30.0},
    "generic_capabilities/ProcessRunner": {"command": "a", "timeout_s": 30.0},
    "generic_capabilities/PythonRunner": {"function": "a:b"},
}
WORLD = field_of(
    people=(Person("Ada", stays=(Stay(2.0, 0.0),), replies=(Reply((), "Hello."),)),),
    sounds=(Sound("good morning", 1.0, 3.0),),
    answers=(Answer("tested/Runner", text="<Plan/>"),),  # as the kit calls every interface
)


class Queue:
    def submit(self, text, name=""):
        return 1

    def status(self, plan):
        return "QUEUED"

    def findings(self, plan):
        return ()


def services(**changes):
    return world_services(replace(WORLD, **changes), LIBRARY, plans=Queue())


@pytest.mark.parametrize("provider", LIBRARY.providers, ids=lambda provider: provider.name)
def test_simulated_runners_keep_to_the_contract(provider):
    additional = {"answers": ()} if provider.effects.checks else {}
    observed = check_runner(
        simulated_class(provider),
        PARAMETERS.get(provider.name, {}),
        provider=provider,
        services=lambda: services(**additional),
        expect="succeeds",
        real=False,
    )
    declared = {output.name for output in provider.outputs if not output.optional}
    assert declared <= set(observed.outputs)


@pytest.mark.parametrize("provider", LIBRARY.providers, ids=lambda provider: provider.name)
def test_drawn_runners_keep_to_the_contract(provider):
    check_runner(
        lambda: Drawn(provider, failure=0.0),
        PARAMETERS.get(provider.name, {}),
        provider=provider,
        expect="succeeds",
        real=False,
    )
