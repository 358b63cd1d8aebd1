"""Runs a plan on the robot: ``ros2 launch gpsfsm_ros run_plan.launch.py plan:=a.xml``."""

import shlex

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch_ros.actions import Node


def generate_launch_description():
    """The launch description."""
    return LaunchDescription(
        [
            DeclareLaunchArgument("plan", description="the file of the plan"),
            DeclareLaunchArgument(
                "options",
                default_value="",
                description="options of 'gpsfsm run', such as '--robot robot.yaml'",
            ),
            DeclareLaunchArgument(
                "namespace", default_value="", description="the namespace of the node"
            ),
            OpaqueFunction(function=_nodes),
        ]
    )


def _nodes(context):
    values = context.launch_configurations
    return [
        Node(
            package="gpsfsm_ros",
            executable="run_plan",
            namespace=values["namespace"],
            output="screen",
            emulate_tty=True,
            arguments=[*shlex.split(values["options"]), "--", values["plan"]],
        )
    ]
