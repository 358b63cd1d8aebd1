"""The package of ROS 2 as colcon builds and installs it, and its rules on a node of ROS 2."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.ros.support import PYTHON, ROS, missing

if TYPE_CHECKING:
    from collections.abc import Iterator

REPO = Path(__file__).parents[2]
COLCON = ROS / "bin" / "colcon"
WAIT = "generic_capabilities/WaitRunner"
PLAN = f'<Plan><Runner interface="{WAIT}" provider="{WAIT}" seconds="0.01"/></Plan>'
TIMEOUT_S = 120

_REASON = missing() or ("" if COLCON.exists() else "there is no colcon in .venv-ros")
pytestmark = [
    pytest.mark.ros,
    pytest.mark.skipif(bool(_REASON), reason=_REASON or "all is there"),
]


def environment(**changes: str) -> dict[str, str]:
    """Nothing of the environment in which the tests run: neither a ROS 2 nor a Python."""
    return {"PATH": os.defpath, "HOME": os.environ.get("HOME", "/"), **changes}


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A workspace in which the package was built by the colcon of another environment."""
    folder = tmp_path_factory.mktemp("workspace")
    ignored = shutil.ignore_patterns("__pycache__", "build", "*.egg-info")
    shutil.copytree(REPO / "ros", folder / "src", ignore=ignored)
    done = subprocess.run(
        [COLCON, "build"],
        cwd=folder,
        env=environment(),
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    yield folder
    shutil.rmtree(folder)


def test_what_is_installed(workspace: Path) -> None:
    prefix = workspace / "install" / "gpsfsm_ros"
    share = prefix / "share"
    assert (share / "ament_index/resource_index/packages/gpsfsm_ros").is_file()
    assert (share / "gpsfsm_ros/package.xml").is_file()
    launch = sorted(each.name for each in (share / "gpsfsm_ros/launch").iterdir())
    assert launch == ["gate.launch.py", "run_plan.launch.py"]
    scripts = sorted((prefix / "lib/gpsfsm_ros").iterdir())
    assert [each.name for each in scripts] == ["dispatch", "gate", "run_plan"]
    for script in scripts:
        assert script.read_text().splitlines()[0] == "#!/usr/bin/env python3"
        assert os.access(script, os.X_OK)


def run_script(
    workspace: Path, folder: Path, script: str, *, activate: Path
) -> subprocess.CompletedProcess[str]:
    """Run a script as a user does: the environment is active, the workspace is sourced."""
    command = (
        f". '{activate}' && . '{workspace}/install/setup.sh' && "
        f"exec '{workspace}/install/gpsfsm_ros/lib/gpsfsm_ros/'{script}"
    )
    return subprocess.run(
        ["sh", "-c", command],
        cwd=folder,
        env=environment(COLCON_CURRENT_PREFIX=str(workspace / "install")),
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        check=False,
    )


def active(folder: Path, *, has_gpsfsm: bool) -> Path:
    """An environment of its own, perhaps with what the one of the tests has; its script."""
    venv.create(folder, symlinks=True)
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    lines = ["import sys; sys.stderr.write('python of ' + sys.prefix + chr(10))\n"]
    if has_gpsfsm:
        lines.append(f"import site; site.addsitedir({sysconfig.get_path('purelib')!r})\n")
    (folder / "lib" / version / "site-packages" / "tests.pth").write_text("".join(lines))
    return folder / "bin" / "activate"


def test_the_script_runs_a_plan_in_the_active_environment(workspace: Path, tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text(PLAN)
    activate = active(tmp_path / "active", has_gpsfsm=True)
    words = "run_plan --ros-args -p plan:=a.xml -p format:=plain -r __node:=g2"
    done = run_script(workspace, tmp_path, words, activate=activate)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "COMPLETED" in done.stdout
    assert f"python of {tmp_path}/active\n" in done.stderr


def test_an_environment_without_gpsfsm_is_reported(workspace: Path, tmp_path: Path) -> None:
    activate = active(tmp_path / "empty", has_gpsfsm=False)
    done = run_script(workspace, tmp_path, "run_plan a.xml", activate=activate)
    assert done.returncode == 2
    assert f"gpsfsm cannot be used in {tmp_path}/empty/bin/python3" in done.stderr
    assert "Traceback" not in done.stderr


_NAMES = """
import sys
import rclpy
from gpsfsm_ros.fabric_names import ros_arguments
from nav2_msgs.action import NavigateToPose
from rclpy.action import ActionServer, get_action_server_names_and_types_by_node as actions
from std_srvs.srv import Trigger

rclpy.init(args=ros_arguments("/hidden"))
node = rclpy.create_node("server", start_parameter_services=False)
for name in ("/fabric/set_plan", "fabric/plan/submit", "/elsewhere/fabric/set_plan"):
    node.create_service(Trigger, name, lambda request, response: response)
server = ActionServer(node, NavigateToPose, "/fabric/plan/generate", lambda goal: None)
listed = [name for name, _ in node.get_service_names_and_types_by_node("server", "/")]
listed += [name for name, _ in actions(node, "server", "/")]
print(*sorted(name for name in listed if "fabric" in name and "_action" not in name))
server.destroy()
node.destroy_node()
rclpy.shutdown()
"""


def test_the_rules_hide_the_names_of_a_node(workspace: Path, tmp_path: Path) -> None:
    folder = f"python{sys.version_info.major}.{sys.version_info.minor}/site-packages"
    paths = (workspace / "install/gpsfsm_ros/lib" / folder, ROS / "interfaces")
    done = subprocess.run(
        [PYTHON, "-c", _NAMES],
        env=environment(
            PYTHONPATH=os.pathsep.join(map(str, paths)),
            ROS_AUTOMATIC_DISCOVERY_RANGE="OFF",
            ROS_LOG_DIR=str(tmp_path),
        ),
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == [
        "/elsewhere/fabric/set_plan",
        "/hidden/fabric/plan/generate",
        "/hidden/fabric/plan/submit",
        "/hidden/fabric/set_plan",
    ]
