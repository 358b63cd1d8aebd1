"""``gpsfsm grammar``."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from gpsfsm.cli import grammar
from gpsfsm.grammars import DEPTH, MAX_DEPTH, find_format, format_names
from tests.capabilities.support import INTERFACE, PROVIDER, write
from tests.cli.support import run
from tests.conftest import REPO

if TYPE_CHECKING:
    from pathlib import Path

FORCE = (
    "definition:\n"
    "  configuration_parameters:\n"
    "    - {name: force, type: double, optional: false, minimum: 0, maximum: 40}\n"
)


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    """A folder with one capability."""
    files: dict[str, str | bytes] = {
        "arm/interfaces/Grasp.yaml": INTERFACE,
        "arm/providers/Grasp.yaml": PROVIDER + FORCE,
    }
    write(tmp_path / "mine", files)
    return tmp_path / "mine"


@pytest.mark.parametrize("name", format_names())
def test_each_format_is_what_is_shipped(name: str) -> None:
    done = run("grammar", "--format", name)
    assert done.returncode == 0
    assert done.stderr == b""
    assert done.stdout == (REPO / "grammars" / find_format(name).file).read_bytes()


def test_own_capabilities_alone(arm: Path) -> None:
    done = run(
        *("grammar", "--format", "gbnf", "--capabilities", arm),
        *("--no-builtin-capabilities", "--depth", "1"),
    )
    assert done.stderr == b""
    assert done.stdout.decode() == (
        'root ::= "<Plan>" s1{1,64} "\\n</Plan>"\n'
        's1 ::= "\\n    <" runner\n'
        'runner ::= "Runner interface=\\"" r1 "/>"\n'
        'r1 ::= "arm/Grasp\\" provider=\\"arm/Grasp\\" force=\\"" v1\n'
        'v1 ::= (("0" | [1-9] | [1-3] [0-9]) ("." [0-9]{1,17})? | "40" ("." "0"{1,17})?) "\\""\n'
    )


def test_own_capabilities_beside_the_built_in_ones(arm: Path) -> None:
    done = run("grammar", "--format", "lark", "--capabilities", arm)
    assert b"arm/Grasp" in done.stdout
    assert b"nav2_capabilities/WaypointRunner" in done.stdout
    assert done.stderr.decode().splitlines() == [
        "gpsfsm: capabilities2_runner/InputMultiplexRunner is left out: it is deprecated",
        "gpsfsm: fabric_capabilities/FabricCompletionRunner is left out: "
        "a plan completes by itself",
    ]


def test_a_defect_is_told(arm: Path) -> None:
    (arm / "arm/interfaces/Other.yaml").write_text("name: [\n")
    done = run("grammar", "--format", "gbnf", "--capabilities", arm)
    assert done.returncode == 0
    assert b"the capability files have 1 error; 'gpsfsm capabilities check' lists" in done.stderr


def test_a_few_interfaces_into_a_file(tmp_path: Path) -> None:
    target = tmp_path / "plan.schema.json"
    done = run(
        *("grammar", "--format", "json-schema", "--interface", "WaitRunner", "--depth", "1"),
        *("-o", target),
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, b"", b"")
    step = json.loads(target.read_text())["properties"]["plan"]["items"]
    assert step["properties"]["interface"] == {
        "type": "string",
        "enum": ["generic_capabilities/WaitRunner"],
    }
    assert step["required"] == ["interface", "parameters"]
    assert step["properties"]["parameters"] == {
        "type": "object",
        "properties": {"seconds": {"type": "number", "minimum": 0, "maximum": 1e9}},
        "required": ["seconds"],
        "additionalProperties": False,
    }


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "Missing option '--format'"),
        (["--format", "ebnf"], "'ebnf' is not one of 'gbnf', 'json-schema', 'lark', "),
        (["--format", "gbnf", "--depth", "0"], "0 is not in the range 1<=x<=32"),
        (["--format", "gbnf", "--interface", "fly/*"], "no capability matches 'fly/*'"),
        (["--format", "gbnf", "--capabilities", "nowhere"], "nowhere"),
        (["--format", "gbnf", "--no-builtin-capabilities"], "there is no capability, so there"),
        (["--format", "gbnf", "-o", "no/such/folder"], "its folder does not exist"),
        (["--format", "xsd", "--depth", "3"], "--depth has no effect on xsd, which describes"),
        (["--format", "rnc", "--interface", "x"], "--interface has no effect on rnc"),
    ],
    ids=range(9),
)
def test_what_makes_no_sense(arguments: list[str], message: str, tmp_path: Path) -> None:
    done = run("grammar", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stdout == b""
    assert message in done.stderr.decode()


def test_what_the_help_repeats() -> None:
    assert format_names() == grammar._FORMATS
    assert (grammar._DEPTH, grammar._MAX_DEPTH) == (DEPTH, MAX_DEPTH)
