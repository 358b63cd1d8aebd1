"""Puts the gate before a Fabric: ``ros2 launch gpsfsm_ros gate.launch.py fabric_launch:=FILE``.

The gate offers the public names of Fabric. With ``fabric_launch`` your own launch file of Fabric
is included, with rules that move its names below ``private``; without it you start Fabric
with the same rules yourself (the README of this package shows them). All nodes of that file get the
rules. So it must not start a capabilities2 server: runners in it submit plans, and would do so past
the gate.
"""

import shlex

from gpsfsm_ros.fabric_names import PRIVATE, remappings
from launch import LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    GroupAction,
    IncludeLaunchDescription,
    OpaqueFunction,
)
from launch.launch_description_sources import AnyLaunchDescriptionSource
from launch_ros.actions import Node, SetRemap


def generate_launch_description():
    """The launch description."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "private",
                default_value=PRIVATE,
                description="below which namespace the gate looks for the names of Fabric",
            ),
            DeclareLaunchArgument(
                "fabric_launch",
                default_value="",
                description="your launch file of Fabric; empty: Fabric is started elsewhere",
            ),
            DeclareLaunchArgument(
                "options",
                default_value="",
                description="options of 'gpsfsm ros gate', such as '--robot robot.yaml'",
            ),
            OpaqueFunction(function=_actions),
        ]
    )


def _actions(context):
    values = context.launch_configurations
    namespace, fabric = values["private"], values["fabric_launch"]
    rules = remappings(namespace)  # also without a Fabric: a wrong namespace is an error here
    node = Node(
        package="gpsfsm_ros",
        executable="gate",
        output="screen",
        emulate_tty=True,
        arguments=[f"--private={namespace}", *shlex.split(values["options"])],
    )
    if not fabric:
        return [node]
    include = IncludeLaunchDescription(AnyLaunchDescriptionSource(fabric))
    return [node, GroupAction([*(SetRemap(src=a, dst=b) for a, b in rules), include])]
