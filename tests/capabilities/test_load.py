"""What is read: names, versions, kinds, precedence, and the fields of all three kinds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from gpsfsm.capabilities.load import load_directories
from gpsfsm.model.capability import (
    Effects,
    Input,
    Interface,
    Outcomes,
    Output,
    Parameter,
    PromptBuffer,
    SemanticInterface,
    Source,
    Span,
    ValueType,
)
from gpsfsm.model.event import Event
from tests.capabilities.support import INTERFACE, PROVIDER, load, provider, write

if TYPE_CHECKING:
    from pathlib import Path

FULL = """\
runner: plugin::Grasp
description: "Closes
  the gripper."
depends_on: {arm/Grasp: {provider: arm/Grasp}}
remappings: {topics: {/a: /b}, actions: {/c: /d}}
relations:
  - {subject: a, predicate: b, object: c}
deprecated: too old
outcomes: {never_fails: true, may_hang: true, unless: {flush: true}}
duration: {min: 0.5, max: timeout}
energy: {max: 20}
resources: [arm, gripper, arm]
effects:
  prompt_buffer: {uuid: uuid, flush: flush, answer: answer}
  sets_plan: plan
definition:
  command: "<Runner interface=arm/Grasp uuid='$uuid' go='$t' plan='x'/>"
  configuration_parameters:
    - {name: uuid, type: string}
    - {name: flush, type: boolean, default: false, semantic_key: a.b, description: Send it.}
    - {name: timeout, type: double, default: 5, minimum: 0, maximum: 9, aliases: [go]}
    - {name: mode, type: string, optional: true, default: off, choices: [on, off]}
    - {name: count, type: int, default: ~}
    - {name: any, default: 7}
    - {name: names, type: "string[]", default: [a, b]}
  runtime_parameters:
    input:
      - {name: plan, type: string, aliases: [p], semantic_key: c.d}
      - {name: x, type: double, optional: true, satisfiable_from: [upstream, external]}
      - name: uuid
        type: string
        required: true
        satisfiable_from: [configuration]
        fallback_parameter: uuid
    output:
      - {name: answer, type: string, aliases: [text]}
      - {name: code, type: int, on: both, optional: true, status: true}
      - {name: why, type: string, on: failure}
"""


def test_every_field_of_a_provider_is_read(tmp_path: Path) -> None:
    loaded, texts = provider(tmp_path, FULL)
    assert texts == []
    (actual,) = loaded.library.providers
    assert (actual.name, actual.implements, actual.runner) == (
        "arm/Grasp",
        "arm/Grasp",
        "plugin::Grasp",
    )
    assert actual.description == "Closes the gripper."
    assert actual.version == "1.2"
    assert actual.described
    assert actual.depends_on == (("arm/Grasp", "arm/Grasp"),)
    assert actual.remappings == (("topics", "/a", "/b"), ("actions", "/c", "/d"))
    assert actual.deprecated == "too old"
    assert actual.outcomes == Outcomes(never_fails=True, may_hang=True, unless=(("flush", True),))
    assert actual.duration == Span(0.5, "timeout")
    assert actual.energy == Span(0.0, 20.0)
    assert actual.resources == ("arm", "gripper")
    assert actual.effects == Effects(PromptBuffer("uuid", "flush", "answer"), "plan")
    assert actual.origin == str(tmp_path / "arm/providers/Grasp.yaml")


def test_parameters_inputs_and_outputs_are_read(tmp_path: Path) -> None:
    loaded, _ = provider(tmp_path, FULL)
    (actual,) = loaded.library.providers
    double, string, integer = ValueType.DOUBLE, ValueType.STRING, ValueType.INT
    assert actual.configuration == (
        Parameter("uuid", string, required=True),
        Parameter("flush", ValueType.BOOL, False, False, "a.b", description="Send it."),
        Parameter("timeout", double, False, 5.0, aliases=("go",), minimum=0.0, maximum=9.0),
        Parameter("mode", string, False, "off", choices=("on", "off")),
        Parameter("count", integer),
        Parameter("any", ValueType.ANY, False, 7),
        Parameter("names", ValueType.STRINGS, False, '["a", "b"]'),
    )
    assert [type(each.default) for each in actual.configuration[1:3]] == [bool, float]
    assert actual.inputs == (
        Input("plan", string, required=True, aliases=("p",), semantic_key="c.d"),
        Input("x", double, satisfiable_from=(Source.UPSTREAM, Source.EXTERNAL)),
        Input(
            "uuid",
            string,
            True,
            satisfiable_from=(Source.CONFIGURATION,),
            fallback="uuid",
            demanded=True,
        ),
    )
    assert actual.outputs == (
        Output("answer", string, aliases=("text",)),
        Output("code", integer, optional=True, status=True),
        Output("code", integer, Event.FAILED, optional=True, status=True),
        Output("why", string, Event.FAILED),
    )


def test_interfaces_and_semantic_interfaces_are_read(tmp_path: Path) -> None:
    more = "default_provider: arm/Grasp\ndeprecated: why\nformerly: [old/Grasp, older/Grasp]\n"
    semantic = """\
name: KitchenGrasp
spec_type: semantic_interface
spec_version: 1
description: In the kitchen.
redefines: arm/Grasp
global_namespace: kitchen
remappings: {topics: {/a: /b}}
"""
    files: dict[str, str | bytes] = {
        "arm/interfaces/Grasp.yaml": INTERFACE + more,
        "arm/providers/Grasp.yaml": PROVIDER,
        "home/semantic_interfaces/KitchenGrasp.yml": semantic,
    }
    loaded = load(tmp_path, files)
    assert loaded.defects == ()
    assert loaded.files == 3
    at = str(tmp_path / "arm/interfaces/Grasp.yaml")
    former = ("old/Grasp", "older/Grasp")
    assert loaded.library.interfaces == (
        Interface("arm/Grasp", "", "1.2", "arm/Grasp", "why", former, at),
    )
    assert loaded.library.translation("old/Grasp") == "arm/Grasp"
    at = str(tmp_path / "home/semantic_interfaces/KitchenGrasp.yml")
    assert loaded.library.semantic == (
        SemanticInterface(
            "home/KitchenGrasp", "arm/Grasp", "kitchen", (("topics", "/a", "/b"),),
            "In the kitchen.", at,
        ),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("body", "described"),
    [("", False), ("definition: {command: x}\n", True), ("definition:\n", False)],
)
def test_a_provider_without_definition_is_not_described(
    tmp_path: Path, body: str, described: bool
) -> None:
    loaded, texts = provider(tmp_path, body)
    assert texts == []
    assert loaded.library.providers[0].described is described


@pytest.mark.parametrize(
    ("keys", "required"),
    [
        ("", True),
        ("optional: true", False),
        ("optional: false", True),
        ("default: 1", False),
        ("default: null", False),
        ("default: ", False),
        ("required: true", True),
        ("required: true, default: null", True),
        ("required: true, default: 1", False),
        ("required: false", False),
        ("optional: false, default: null", True),
    ],
)
def test_what_is_required(tmp_path: Path, keys: str, required: bool) -> None:
    entry = f"[{{name: a, {keys}}}]"
    body = f"definition:\n  configuration_parameters: {entry}\n"
    body += f"  runtime_parameters: {{input: {entry}}}\n"
    loaded, texts = provider(tmp_path, body)
    assert texts == []
    actual = loaded.library.providers[0]
    assert actual.configuration[0].required is required
    assert actual.inputs[0].required is required


@pytest.mark.parametrize(
    ("word", "kind"),
    [
        ("string", ValueType.STRING),
        ("boolean", ValueType.BOOL),
        ("bool", ValueType.BOOL),
        ("int", ValueType.INT),
        ("Integer", ValueType.INT),
        ("double", ValueType.DOUBLE),
        ("float", ValueType.DOUBLE),
        ("number", ValueType.DOUBLE),
        ("'string[]'", ValueType.STRINGS),
        ("'float[]'", ValueType.DOUBLES),
        ("'int[]'", ValueType.INTS),
        ("'boolean[]'", ValueType.BOOLS),
        ("''", ValueType.ANY),
    ],
)
def test_type_words(tmp_path: Path, word: str, kind: ValueType) -> None:
    body = f"definition: {{configuration_parameters: [{{name: a, type: {word}}}]}}\n"
    loaded, texts = provider(tmp_path, body)
    assert texts == []
    assert loaded.library.providers[0].configuration[0].type is kind


@pytest.mark.parametrize(
    ("kind", "written", "value"),
    [
        ("double", "1", 1.0),
        ("double", "'2.5'", 2.5),
        ("double", "1e3", 1000.0),
        ("int", "'7'", 7),
        ("bool", "'true'", True),
        ("bool", "yes", True),
        ("string", "007", "007"),
        ("string", "1.50", "1.50"),
        ("string", "''", ""),
        ("string", "2020-01-01", "2020-01-01"),
        ("string", "1:30", "1:30"),
        ("'int[]'", "[1, 2]", "[1, 2]"),
        ("''", "1:30", "1:30"),
    ],
)
def test_defaults_take_the_type_of_the_parameter(
    tmp_path: Path, kind: str, written: str, value: object
) -> None:
    entry = f"{{name: a, type: {kind}, default: {written}}}"
    body = f"definition:\n  configuration_parameters:\n    - {entry}\n"
    loaded, texts = provider(tmp_path, body)
    assert texts == []
    default = loaded.library.providers[0].configuration[0].default
    assert default == value
    assert type(default) is type(value)


@pytest.mark.parametrize("version", ["1", "1.0", "1.1", "1.2", "'1.2'"])
def test_all_versions_of_the_files_are_read(tmp_path: Path, version: str) -> None:
    text = f"name: Grasp\nspec_type: interface\nspec_version: {version}\n"
    loaded = load(tmp_path, {"arm/interfaces/Grasp.yaml": text})
    assert loaded.defects == ()
    assert loaded.library.interfaces[0].version == version.strip("'")


@pytest.mark.parametrize(
    ("file", "written", "name"),
    [
        ("arm/interfaces/Grasp.yaml", "Grasp", "arm/Grasp"),
        ("arm__interfaces__Grasp.yaml", "Grasp", "arm/Grasp"),
        ("arm__interfaces__Grasp@2.1.yaml", "Grasp", "arm/Grasp"),
        ("Grasp.yaml", "arm/Grasp", "arm/Grasp"),
        ("deep/down/arm/interfaces/Grasp.yml", "Grasp", "arm/Grasp"),
        ("arm/interfaces/Grasp.yaml", "arm/Grasp", "arm/Grasp"),
    ],
)
def test_where_the_name_comes_from(tmp_path: Path, file: str, written: str, name: str) -> None:
    loaded = load(tmp_path, {file: f"name: {written}\nspec_type: interface\n"})
    assert loaded.defects == ()
    assert [interface.name for interface in loaded.library.interfaces] == [name]


def test_the_package_of_a_provider_may_come_from_its_interface(tmp_path: Path) -> None:
    files: dict[str, str | bytes] = {"Grasp.yaml": PROVIDER, "arm/interfaces/Grasp.yaml": INTERFACE}
    loaded = load(tmp_path, files)
    assert loaded.defects == ()
    assert [provider.name for provider in loaded.library.providers] == ["arm/Grasp"]


def test_the_kind_may_come_from_the_folder(tmp_path: Path) -> None:
    loaded = load(tmp_path, {"arm/interfaces/Grasp.yaml": "name: Grasp\n"})
    assert loaded.defects == ()
    assert len(loaded.library.interfaces) == 1


def test_a_single_file_can_be_named(tmp_path: Path) -> None:
    write(
        tmp_path, {"arm/interfaces/Grasp.yaml": INTERFACE, "arm/interfaces/Other.yaml": INTERFACE}
    )
    loaded = load_directories([tmp_path / "arm/interfaces/Grasp.yaml"])
    assert (loaded.files, len(loaded.library.interfaces)) == (1, 1)


def test_a_relative_folder_of_one_kind_knows_its_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path, {"arm/interfaces/Grasp.yaml": INTERFACE})
    monkeypatch.chdir(tmp_path / "arm" / "interfaces")
    loaded = load_directories(["."])
    assert [interface.name for interface in loaded.library.interfaces] == ["arm/Grasp"]
    assert loaded.library.interfaces[0].origin == "Grasp.yaml"


def test_other_yaml_files_and_hidden_folders_are_passed_over(tmp_path: Path) -> None:
    files: dict[str, str | bytes] = {
        "arm/interfaces/Grasp.yaml": INTERFACE,
        "arm/config/params.yaml": "a: &x 1\nb: *x\n",
        ".cache/arm/interfaces/Grasp.yaml": INTERFACE,
        "arm/interfaces/README.md": "text",
    }
    loaded = load(tmp_path, files)
    assert (loaded.files, loaded.defects) == (1, ())


def test_links_to_folders_are_not_followed(tmp_path: Path) -> None:
    write(tmp_path, {"arm/interfaces/Grasp.yaml": INTERFACE})
    (tmp_path / "arm" / "again").symlink_to(tmp_path, target_is_directory=True)
    assert load_directories([tmp_path]).files == 1
