"""What `colcon test` runs: the scripts make command lines of gpsfsm."""

from gpsfsm_ros.fabric_names import PRIVATE, remappings
from gpsfsm_ros.scripts import command_line


def test_parameters_are_options():
    """Parameters of ROS become options, and what is not a parameter stays for the node."""
    words = ["--ros-args", "-p", "plan:=a.xml", "-p", "robot:=r.yaml", "-r", "a:=b"]
    assert command_line(["run"], words, plan=True) == [
        *("run", "--ros-args", "-r", "a:=b", "--", "--robot=r.yaml", "--", "a.xml"),
    ]


def test_a_fabric_is_moved():
    """The names that a Fabric has behind the gate."""
    assert all(new == PRIVATE + old for old, new in remappings())
