"""The network of a robot, as the environment and the settings have it."""

from __future__ import annotations

import pytest

from gpsfsm.model.ros import RosSettings


@pytest.mark.parametrize(
    ("settings", "environment", "differs"),
    [
        (RosSettings(), {}, {}),
        (RosSettings(), {"ROS_DOMAIN_ID": "3"}, {"domain": "3"}),
        (RosSettings(domain=0), {"ROS_DOMAIN_ID": "3"}, {}),
        (RosSettings(namespace="r1"), {}, {"namespace": "/r1"}),
        (RosSettings(namespace="r1", arguments=("-r", "__ns:=/r2")), {}, {"namespace": "/r2"}),
        (RosSettings(), {"ROS_LOCALHOST_ONLY": "1"}, {"discovery": "LOCALHOST"}),
        (RosSettings(discovery="off"), {}, {"discovery": "OFF"}),
        (
            RosSettings(),
            {"RMW_IMPLEMENTATION": "rmw_zenoh_cpp", "ROS_STATIC_PEERS": "10.0.0.7"},
            {"rmw": "rmw_zenoh_cpp", "peers": "10.0.0.7"},
        ),
    ],
)
def test_the_network_in_effect(
    settings: RosSettings, environment: dict[str, str], differs: dict[str, str]
) -> None:
    usual = {
        "domain": "0",
        "namespace": "/",
        "discovery": "SUBNET",
        "rmw": "rmw_fastrtps_cpp",
    }
    assert settings.network(environment) == usual | differs
