"""``gpsfsm capabilities``."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from tests.capabilities.support import INTERFACE, PROVIDER, write
from tests.cli.support import environment, run

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    """A folder with one capability; the tests run beside it."""
    files: dict[str, str | bytes] = {
        "arm/interfaces/Grasp.yaml": INTERFACE + "formerly: [old/Grab]\n",
        "arm/providers/Grasp.yaml": PROVIDER,
    }
    write(tmp_path / "mine", files)
    return tmp_path / "mine"


def spoil(arm: Path, body: str) -> None:
    write(arm, {"arm/providers/Grasp.yaml": PROVIDER + body})


def test_list_shows_all_interfaces(arm: Path) -> None:
    builtin = run("capabilities", "list")
    assert builtin.returncode == 0
    names = [line.split()[0] for line in builtin.stdout.decode().splitlines()]
    assert names == sorted(names)
    assert "nav2_capabilities/WaypointRunner" in names
    both = run("capabilities", "list", "--capabilities", "mine").stdout.decode().splitlines()
    assert len(both) == len(names) + 1
    alone = run("capabilities", "list", "--capabilities", "mine", "--no-builtin")
    assert alone.stdout.decode() == "arm/Grasp  mine/arm/interfaces/Grasp.yaml  arm/Grasp\n"


def test_list_as_json(arm: Path) -> None:
    done = run("capabilities", "list", "--capabilities", "mine", "--no-builtin", "--format", "json")
    assert json.loads(done.stdout) == {
        "version": 1,
        "capabilities": [
            {
                "name": "arm/Grasp",
                "redefines": None,
                "providers": ["arm/Grasp"],
                "deprecated": "",
                "family": "mine/arm/interfaces/Grasp.yaml",
                "description": "",
            }
        ],
    }


@pytest.mark.parametrize("name", ["arm/Grasp", "Grasp", "old/Grab"])
def test_show(arm: Path, name: str) -> None:
    done = run("capabilities", "show", name, "--capabilities", "mine")
    assert done.returncode == 0
    lines = done.stdout.decode().splitlines()
    assert lines[0] == "arm/Grasp (interface)"
    assert "Provider arm/Grasp" in lines
    assert '    <Runner interface="arm/Grasp" provider="arm/Grasp"/>' in lines
    data = json.loads(
        run("capabilities", "show", name, "--capabilities", "mine", "--format", "json").stdout
    )
    assert data["version"] == 1
    assert data["name"] == "arm/Grasp"
    assert data["providers"][0]["described"] is False


def test_show_of_what_there_is_not() -> None:
    done = run("capabilities", "show", "WaypointRuner")
    assert done.returncode == 2
    assert done.stdout == b""
    assert done.stderr.decode() == (
        "gpsfsm: there is no capability 'WaypointRuner'; "
        "did you mean 'nav2_capabilities/WaypointRunner' or "
        "'nav2_capabilities/WaypointYawRunner'?\n"
    )


def test_check_of_files_without_defects(arm: Path) -> None:
    done = run("capabilities", "check", "mine")
    assert done.returncode == 0
    assert done.stdout.decode() == (
        "2 files: 1 interface, 1 provider, 0 semantic interfaces; 0 errors, 0 warnings\n"
    )


def test_check_shows_defects(arm: Path) -> None:
    spoil(arm, "duration: {min: 3, max: 2}\nresource: [base]\n")
    done = run("capabilities", "check", "mine")
    assert done.returncode == 1
    assert done.stdout.decode() == (
        "mine/arm/providers/Grasp.yaml:5:12: error: min is greater than max: 3 and 2\n"
        "    change one of them\n"
        "mine/arm/providers/Grasp.yaml:6:1: error: the key 'resource' is not known here\n"
        "    did you mean 'resources'?\n"
        "2 files: 1 interface, 1 provider, 0 semantic interfaces; 2 errors, 0 warnings\n"
    )


def test_check_as_json(arm: Path) -> None:
    spoil(arm, "colour: red\n")
    done = run("capabilities", "check", "mine", "--format", "json")
    assert done.returncode == 0
    assert json.loads(done.stdout) == {
        "version": 1,
        "files": 2,
        "interfaces": 1,
        "providers": 1,
        "semantic_interfaces": 0,
        "errors": 0,
        "warnings": 1,
        "defects": [
            {
                "file": "mine/arm/providers/Grasp.yaml",
                "line": 5,
                "column": 1,
                "severity": "warning",
                "message": "the key 'colour' is not known here",
                "hint": "it is ignored",
            }
        ],
    }


def test_warnings_fail_only_if_asked(arm: Path) -> None:
    spoil(arm, "colour: red\n")
    assert run("capabilities", "check", "mine").returncode == 0
    assert run("capabilities", "check", "mine", "--fail-on", "warning").returncode == 1


def test_names_of_the_builtin_library_are_known_unless_left_out(arm: Path) -> None:
    spoil(arm, "depends_on: {nav2_capabilities/WaypointRunner: {}}\n")
    strict = ("--fail-on", "warning")
    assert run("capabilities", "check", "mine", *strict).returncode == 0
    assert run("capabilities", "check", "mine", "--no-builtin", *strict).returncode == 1


def test_check_of_nothing_readable(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    write(tmp_path / "bad", {"arm/interfaces/Grasp.yaml": b"\xff"})
    for path, message in (("nowhere", "No such file"), ("empty", "there is no capability file")):
        done = run("capabilities", "check", path)
        assert (done.returncode, done.stdout) == (2, b"")
        assert done.stderr.decode().startswith(f"gpsfsm: {path}: ")
        assert message in done.stderr.decode()
    done = run("capabilities", "check", "bad")
    assert done.returncode == 2
    assert done.stdout.decode().startswith("bad/arm/interfaces/Grasp.yaml:1:1: error: this is not")


def test_list_and_show_tell_of_errors_in_the_files(arm: Path) -> None:
    spoil(arm, "resources: 1\n")
    for command in (["list"], ["show", "Grasp"]):
        done = run("capabilities", *command, "--capabilities", "mine")
        assert done.returncode == 0
        assert done.stderr.decode() == (
            "gpsfsm: the capability files have 1 error; 'gpsfsm capabilities check' lists them\n"
        )


def test_without_a_command_the_help_is_shown() -> None:
    for group in ("capabilities", "ros"):
        done = run(group)
        assert (done.returncode, done.stdout) == (2, b"")
        assert done.stderr.decode().startswith(f"Usage: gpsfsm {group}")
    wrong = run("capabilities", "lst")
    assert wrong.returncode == 2
    assert "lst" in wrong.stderr.decode()


@pytest.mark.parametrize(
    ("commands", "loaded"),
    [
        ([["--help"], ["capabilities", "--help"], ["capabilities", "check", "--help"]], []),
        ([["capabilities", "show", "WaypointRunner"]], []),
        ([["capabilities", "check", "mine"]], ["pydantic", "yaml"]),
    ],
)
def test_only_reading_files_loads_yaml(
    arm: Path, commands: list[list[str]], loaded: list[str]
) -> None:
    program = (
        f"import sys; from gpsfsm.cli import main; [main(words) for words in {commands}]; "
        "print([name for name in ('networkx', 'pydantic', 'yaml', 'z3') if name in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=environment(),
        capture_output=True,
        check=True,
        timeout=60,
    )
    assert done.stdout.decode().splitlines()[-1] == str(loaded)
