"""The package of ROS 2 without ROS 2: command lines, launch files, names, versions."""

from __future__ import annotations

import ast
import importlib
import importlib.util
import re
import sys
import tomllib
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest
from lxml import etree

from gpsfsm import __version__
from gpsfsm.cli import main

if TYPE_CHECKING:
    from collections.abc import Callable

REPO = Path(__file__).parents[2]
PACKAGE = REPO / "ros" / "gpsfsm_ros"
WAIT = "generic_capabilities/WaitRunner"
PLAN = f'<Plan><Runner interface="{WAIT}" provider="{WAIT}" seconds="0.01"/></Plan>'


@pytest.fixture
def module(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Any]:
    monkeypatch.syspath_prepend(str(PACKAGE))
    return lambda name: importlib.import_module(f"gpsfsm_ros.{name}")


# -- scripts --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("", "run --real"),
        ("a.xml --verbose", "run --real a.xml --verbose"),
        ("--ros-args -p plan:=a.xml", "run --real -- a.xml"),
        ("--ros-args --param plan:=a.xml", "run --real -- a.xml"),
        ("--ros-args -p plan:=a.xml -p plan:=b.xml", "run --real -- a.xml b.xml"),
        ("--ros-args -p plan:=-x.xml", "run --real -- -x.xml"),
        ("-- a.xml --ros-args -p plan:=b.xml", "run --real -- a.xml b.xml"),
        ("--ros-args -p robot:=r.yaml -- a.xml", "run --real --robot=r.yaml a.xml"),
        ("--ros-args -p max_plans:=3 -- a.xml", "run --real --max-plans=3 a.xml"),
        ("--ros-args -p force:=true -p verbose:=False", "run --real --force"),
        ("--ros-args -p journal:=--force", "run --real --journal=--force"),
        (
            "a.xml --ros-args -r __node:=g -r __ns:=/r1",
            "run --real --ros-args -r __node:=g -r __ns:=/r1 -- a.xml",
        ),
        (
            "--ros-args -r a:=b -p plan:=a.xml -e f -- x --ros-args --log-level info",
            "run --real --ros-args -r a:=b -e f --log-level info -- x -- a.xml",
        ),
        (
            "--ros-args -p use_sim_time:=true -p n:plan:=x -p qos.depth:=1 -p odd -p",
            "run --real --ros-args -p use_sim_time:=true -p n:plan:=x -p qos.depth:=1 -p odd -p --",
        ),
    ],
)
def test_a_command_line_of_ros_becomes_one_of_gpsfsm(
    words: str, expected: str, module: Callable[[str], Any]
) -> None:
    made = module("scripts").command_line(["run", "--real"], words.split(), plan=True)
    assert made == expected.split()


def test_only_scripts_that_take_a_plan_make_a_path_of_it(module: Callable[[str], Any]) -> None:
    line = module("scripts").command_line
    assert line(["ros", "gate"], ["--ros-args", "-p", "plan:=a"]) == ["ros", "gate", "--plan=a"]


_FILE = """
/**:
  ros__parameters: {robot: r.yaml, max_plans: 3, force: true, qos: {depth: 1}, use_sim_time: true}
gpsfsm:
  ros__parameters: {plan: [a.xml, b.xml], verbose: false}
/r1:
  gpsfsm: {ros__parameters: {timeout: 2.5}}
  "*": {ros__parameters: {via: capabilities2}}
named: {ros__parameters: {plan: c.xml, robot: s.yaml}}
"""


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("--params-file f", "--robot=r.yaml --max-plans=3 --force -- a.xml b.xml"),
        (
            "--params-file f -r __ns:=/r1",
            "--robot=r.yaml --max-plans=3 --force --timeout=2.5 --via=capabilities2",
        ),
        ("--params-file f -r __node:=named", "--robot=s.yaml --max-plans=3 --force -- c.xml"),
        (
            "--params-file f -p force:=false -p max_plans:=4 -p plan:=d.xml -p plan:=e.xml",
            "--robot=r.yaml --max-plans=4 -- d.xml e.xml",
        ),
        (
            "-p robot:=t.yaml -p plan:=d.xml --params-file f",
            "--robot=r.yaml --max-plans=3 --force -- a.xml b.xml",
        ),
    ],
)
def test_parameters_of_files_are_options(
    words: str,
    expected: str,
    module: Callable[[str], Any],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("f").write_text(_FILE)
    line = module("scripts").command_line([], ["--ros-args", *words.split()], plan=True)
    for_node = line.index("--") + 1
    assert {"--ros-args", "--params-file", "f"} <= set(line[:for_node])
    assert line[for_node:] == expected.split()


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (None, "f cannot be read: [Errno 2] No such file or directory: 'f'"),
        ("a: [", "f cannot be read: while parsing a flow node"),
        ("plan: a.xml", "f is not a parameter file: NODE, and below it ros__parameters"),
        ("ros__parameters: {plan: a}", "f has ros__parameters without a node, or without"),
        ("/**: {ros__parameters: {plan: null}}", "f: the parameter plan has no value that ROS 2"),
        ("/**: {ros__parameters: {plan: [[a]]}}", "f: the parameter plan has no value that ROS 2"),
    ],
)
def test_a_parameter_file_that_is_none_is_refused(
    text: str | None,
    reason: str,
    *,
    module: Callable[[str], Any],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    if text is not None:
        Path("f").write_text(text)
    monkeypatch.setattr(sys, "argv", ["run_plan", "--ros-args", "--params-file", "f"])
    assert module("scripts").run_plan() == 2
    assert f"gpsfsm_ros: {reason}" in capsys.readouterr().err


def test_a_parameter_file_of_other_nodes_is_reported(
    module: Callable[[str], Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "nav2.yaml"
    file.write_text("amcl: {ros__parameters: {alpha1: 0.2}}\nrun_plan: {ros__parameters: {a: 1}}\n")
    words = ["--ros-args", "--params-file", str(file)]
    assert module("scripts").command_line([], words) == [*words, "--"]
    said = capsys.readouterr().err
    assert said == f"gpsfsm_ros: {file} has parameters of /amcl, /run_plan, and none of /gpsfsm\n"


def test_a_script_runs_the_command(
    module: Callable[[str], Any],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.xml").write_text(PLAN)
    words = ["run_plan", "--ros-args", "-p", "plan:=a.xml", "-p", "journal:=run.db"]
    monkeypatch.setattr(sys, "argv", [*words, "-r", "__node:=g2"])
    assert module("scripts").run_plan() == 0
    assert "COMPLETED" in capsys.readouterr().out
    assert main(["events", "run.db", "--format", "jsonl"]) == 0
    heading = capsys.readouterr().out.splitlines()[0]
    assert '"mode":"real"' in heading
    assert '"arguments":["-r","__node:=g2"]' in heading
    monkeypatch.setattr(sys, "argv", ["run_plan", "--ros-args", "-p", "nothing:=1"])
    assert module("scripts").run_plan() == 2
    assert "--nothing" in capsys.readouterr().err


def test_an_environment_without_gpsfsm_is_reported(
    module: Callable[[str], Any],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setitem(sys.modules, "gpsfsm.cli", None)
    monkeypatch.setattr(sys, "argv", ["gate"])
    assert module("scripts").gate() == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert sys.executable in err
    assert "pip install 'gpsfsm[ros]'" in err


# -- launch files, with stand-ins of what PyPI does not have --------------------------------------


class Recorded(SimpleNamespace):
    """An action of a launch file: its class and what it was made with."""

    def __init__(self, kind: str, *values: Any, **named: Any) -> None:
        super().__init__(kind=kind, values=values, **named)


@pytest.fixture
def launched(module: object, monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[Recorded]]:
    """Load a launch file as ROS 2 does, and return the actions that it ends in."""
    stands = {
        "launch": ["LaunchDescription"],
        "launch.actions": [
            "DeclareLaunchArgument",
            "GroupAction",
            "IncludeLaunchDescription",
            "OpaqueFunction",
        ],
        "launch.launch_description_sources": ["AnyLaunchDescriptionSource"],
        "launch_ros": [],
        "launch_ros.actions": ["Node", "SetRemap"],
    }
    for name, kinds in stands.items():
        stand = ModuleType(name)
        for kind in kinds:
            setattr(stand, kind, lambda *a, _kind=kind, **b: Recorded(_kind, *a, **b))
        monkeypatch.setitem(sys.modules, name, stand)

    def load(file: str, **arguments: str) -> list[Recorded]:
        path = PACKAGE / "launch" / file
        spec = importlib.util.spec_from_file_location("a_launch_file", path)
        assert spec is not None
        assert spec.loader is not None
        loaded = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(loaded)
        (actions,) = loaded.generate_launch_description().values
        declared = [each for each in actions if each.kind == "DeclareLaunchArgument"]
        names = {each.values[0] for each in declared}
        assert set(arguments) <= names
        assert all(each.description for each in declared)
        values = {each.values[0]: getattr(each, "default_value", None) for each in declared}
        values |= arguments
        assert None not in values.values(), "an argument without a default is missing"
        (function,) = (each.function for each in actions if each.kind == "OpaqueFunction")
        made: list[Recorded] = function(SimpleNamespace(launch_configurations=values))
        return made

    return load


def test_the_launch_file_of_a_plan(
    launched: Callable[..., list[Recorded]], module: Callable[[str], Any]
) -> None:
    (node,) = launched(
        "run_plan.launch.py", plan="my plan.xml", options="--robot 'my robot.yaml'", namespace="/r"
    )
    assert (node.package, node.executable, node.namespace) == ("gpsfsm_ros", "run_plan", "/r")
    assert node.arguments == ["--robot", "my robot.yaml", "--", "my plan.xml"]
    line = module("scripts").command_line
    words = [*node.arguments, "--ros-args", "-r", "__ns:=/r"]  # as launch_ros appends them
    assert line(["run"], words, plan=True) == [
        *("run", "--ros-args", "-r", "__ns:=/r", "--"),
        *("--robot", "my robot.yaml", "--", "my plan.xml"),
    ]


def test_the_launch_file_of_the_gate_starts_it_alone(
    launched: Callable[..., list[Recorded]],
) -> None:
    (node,) = launched("gate.launch.py", options="--robot r.yaml")
    assert (node.package, node.executable) == ("gpsfsm_ros", "gate")
    assert node.arguments == ["--private=/gpsfsm_private", "--robot", "r.yaml"]


def test_the_launch_file_of_the_gate_hides_a_fabric(
    launched: Callable[..., list[Recorded]], module: Callable[[str], Any]
) -> None:
    node, group = launched("gate.launch.py", fabric_launch="/f.launch.py", private="/h/")
    assert node.arguments == ["--private=/h/"]
    (*rules, include) = group.values[0]
    assert {each.kind for each in rules} == {"SetRemap"}
    pairs = [(each.src, each.dst) for each in rules]
    assert pairs == module("fabric_names").remappings("/h")
    for name in ("/fabric/set_plan", "/fabric/plan/submit", "/fabric/plan/generate"):
        assert (name, f"/h{name}") in pairs
    assert include.kind == "IncludeLaunchDescription"
    assert include.values[0].kind == "AnyLaunchDescriptionSource"
    assert include.values[0].values == ("/f.launch.py",)


@pytest.mark.parametrize("namespace", ["", "/", "//", "fabric", "fabric/"])
def test_a_namespace_that_hides_nothing_is_refused(
    namespace: str, launched: Callable[..., list[Recorded]]
) -> None:
    """Else gate and Fabric would offer the same names, and half of the plans would pass by."""
    with pytest.raises(ValueError, match="has to begin with /"):
        launched("gate.launch.py", private=namespace)


# -- what the files say ---------------------------------------------------------------------------


def test_the_page_shows_all_rules(module: Callable[[str], Any]) -> None:
    page = (PACKAGE / "README.md").read_text()
    written = re.findall(r"-r (\S+):=(\S+)", page.partition("On a command line")[2])
    names = module("fabric_names")
    assert written == names.remappings()
    words = names.ros_arguments()
    assert words[:3] == ["--ros-args", "-r", ":=".join(written[0])]
    assert len(words) == 1 + 2 * len(written)


def test_the_rules_cover_what_the_gate_offers(module: Callable[[str], Any]) -> None:
    """It does not begin where another node offers one of its names."""
    fabric = pytest.importorskip("gpsfsm.ros.fabric")
    offered = {
        f"{fabric.PUBLIC}/{name}"
        for release in fabric.RELEASES
        for name in (*(name for _, name, _ in release.services), release.generates)
        if name
    }
    assert offered == {
        name for name in module("fabric_names").hidden_names() if "/_action/" not in name
    }


@pytest.mark.parametrize(("script", "option"), [("gate", "--private"), ("dispatch", "PATH")])
def test_the_commands_of_scripts_exist(
    script: str,
    option: str,
    module: Callable[[str], Any],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    pytest.importorskip("gpsfsm.cli.ros")
    monkeypatch.setattr(sys, "argv", [script, "--help"])
    assert getattr(module("scripts"), script)() == 0
    assert option in capsys.readouterr().out


def _interfaces_of_our_own() -> set[str]:
    """The packages of definitions that gpsfsm uses whatever runners a plan has."""
    text = "".join(file.read_text() for file in (REPO / "gpsfsm" / "ros").glob("*.py"))
    packages = set(re.findall(r'definition\("(\w+)/|from (\w+_msgs)\.', text))
    return {each for pair in packages for each in pair if each} - {
        *("bond", "capabilities2_msgs", "fabric_msgs")  # of what a plan may need
    }


def test_the_manifest() -> None:
    manifest = etree.parse(PACKAGE / "package.xml")
    project = tomllib.loads((REPO / "pyproject.toml").read_text())["project"]
    assert manifest.findtext("version") == __version__
    assert f'version="{__version__}"' in (PACKAGE / "setup.py").read_text()
    assert manifest.findtext("license") == project["license"]
    (address,) = manifest.xpath("maintainer/@email")
    assert re.fullmatch(r"[\w-]+@users\.noreply\.github\.com", address)
    addresses = {each.get("type"): each.text for each in manifest.iter("url")}
    assert addresses["bugtracker"] == project["urls"]["Issues"]
    assert set(addresses.values()) <= set(project["urls"].values())
    assert [each.text for each in manifest.iter("test_depend")] == ["python3-pytest"]
    needs = {each.text for each in manifest.iter("exec_depend")}
    assert needs >= {"launch", "launch_ros", "rclpy"} | _interfaces_of_our_own()
    assert manifest.findtext("export/build_type") == "ament_python"


def test_nothing_but_gpsfsm_and_the_launch_system_is_imported() -> None:
    """So the package builds and says what is missing wherever there is a Python."""
    for file in PACKAGE.rglob("*.py"):
        names = set()
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Import):
                names |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                names.add(str(node.module))
        allowed = {"gpsfsm_ros", "launch", "launch_ros", "setuptools", "gpsfsm", "yaml"}
        tops = {name.partition(".")[0] for name in names}
        assert tops <= allowed | set(sys.stdlib_module_names), file
