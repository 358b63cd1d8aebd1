"""A package of somebody else: what docs/runners.md shows, installed and used as it says."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from tests.cli.support import environment, run

REPO = Path(__file__).parents[2]
DOCS = REPO / "docs"
PAGE = (DOCS / "runners.md").read_text(encoding="utf-8")
NAME = "gripper_capabilities/GraspRunner"
FILES = DOCS / "examples" / "my_robot" / "gripper_capabilities"
PLAN = DOCS / "examples" / "grasp.xml"
WAYPOINT = "nav2_capabilities/WaypointRunner"


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)


def installed(folder: Path, entries: str, **modules: str) -> Path:
    """A folder for the path of Python with a package ``my-robot`` that is installed there."""
    package = folder / "site" / "my_robot"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    for name, text in modules.items():
        (package / f"{name}.py").write_text(text, encoding="utf-8")
    information = folder / "site" / "my_robot-1.2.dist-info"
    information.mkdir()
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: my-robot\nVersion: 1.2\n")
    (information / "entry_points.txt").write_text(f"[gpsfsm.runners]\n{entries}\n")
    return folder / "site"


def written_in_the_page(folder: Path) -> Path:
    """The package with the runner and the entry point of the page."""
    (toml,) = (block for block in blocks("toml") if "gpsfsm.runners" in block)
    ((name, value),) = re.findall(r'"(.+)" = "(.+)"', toml)
    (template,) = (block for block in blocks("python") if "class GraspRunner" in block)
    return installed(folder, f"{name} = {value}", gripper=template)


def environ(site: Path) -> dict[str, str]:
    return {"PYTHONPATH": f"{site}:{environment()['PYTHONPATH']}"}


def test_the_template_runs_a_plan_once_it_is_installed(tmp_path: Path) -> None:
    """Without a word about its module, since it was installed."""
    env = environ(written_in_the_page(tmp_path))
    shutil.copytree(FILES, tmp_path / "files" / "gripper_capabilities")
    done = run("run", "--real", "--capabilities", tmp_path / "files", PLAN, env=env)
    assert done.returncode == 0, done.stderr
    assert b"GraspRunner (force=12) says: holds " in done.stdout
    assert b"COMPLETED" in done.stdout
    without = run("run", "--real", "--capabilities", tmp_path / "files", PLAN)
    assert without.returncode == 2
    assert b"not allowed" in without.stderr


def test_the_template_has_twenty_lines() -> None:
    (template,) = (block for block in blocks("python") if "class GraspRunner" in block)
    _, _, body = template.partition("class ")
    code = [line for line in body.splitlines() if line.strip() and '"""' not in line]
    assert len(code) <= 20


def test_the_test_of_the_page_passes_for_the_installed_package(tmp_path: Path) -> None:
    site = written_in_the_page(tmp_path)
    (test,) = (block for block in blocks("python") if "check_runner" in block)
    (site / "test_gripper.py").write_text(test, encoding="utf-8")
    words = ("-q", "-p", "no:cacheprovider", "test_gripper.py")
    done = run(*words, cwd=site, module="pytest")
    assert done.returncode == 0, done.stdout
    assert b"1 passed" in done.stdout


RUNNER = (
    "from gpsfsm.execution.runner import Runner\n"
    "class Drives(Runner):\n    async def run(self, parameters, context):\n        return {}\n"
    "def no_runner(): pass\n"
)
WHO = "of the package my-robot 1.2"


@pytest.mark.parametrize(
    ("name", "value", "why"),
    [
        (WAYPOINT, "my_robot.missing:Drives", f"{WHO} cannot be imported: ModuleNotFoundError"),
        (WAYPOINT, "my_robot.exits:Drives", f"{WHO} cannot be imported: SystemExit: 0"),
        (WAYPOINT, "my_robot.drive:Missing", f"{WHO} cannot be imported: AttributeError"),
        (WAYPOINT, "my_robot.drive:no_runner", f"{WHO} is not a runner: it must be a subclass of"),
        (
            "generic_capabilities/LogRunner",
            "my_robot.drive:Drives",
            f"{WHO} claims generic_capabilities/LogRunner, for which gpsfsm has a runner of its",
        ),
    ],
)
def test_a_wrong_runner_is_an_error_and_in_a_world_a_note(
    tmp_path: Path, name: str, value: str, why: str
) -> None:
    site = installed(tmp_path, f"{name} = {value}", drive=RUNNER, exits="raise SystemExit(0)\n")
    plan = tmp_path / "plan.xml"
    values = {WAYPOINT: 'x="2" y="-0.5"', "generic_capabilities/LogRunner": 'text="hello"'}[name]
    plan.write_text(f'<Plan><Runner interface="{name}" provider="{name}" {values}/></Plan>')
    text = f"the runner {name} = {value} {why}"
    # found where it begins, as a package that is installed is found
    real = run("run", "--real", "--force", plan, cwd=site)
    assert real.returncode == 2
    assert real.stdout == b""
    assert text in real.stderr.decode()
    world = REPO / "corpus" / "worlds" / "arena.yaml"
    simulated = run("run", "--world", world, "--force", plan, cwd=site)
    assert simulated.stderr.decode().count(f"note: {text}") == 1
    assert simulated.returncode == 0
    assert simulated.stdout.count(b"COMPLETED") == 1  # with the built-in simulation
