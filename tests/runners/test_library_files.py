"""The capability files of the built-in library, read as plain YAML."""

from __future__ import annotations

import re
from collections import defaultdict
from functools import cache
from typing import TYPE_CHECKING, Any

import pytest
import yaml

from gpsfsm.capabilities.load import load_directories
from gpsfsm.syntax import parse
from tests.conftest import REPO

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

RUNNERS = REPO / "runners"
DOCS = REPO / "docs" / "capabilities.md"
FAMILIES = ("fabric", "generic", "navigation", "perception", "prompting", "system")
LABELS = {"interface", "provider", "name", "id"}
POSE = {"x", "y", "z", "qx", "qy", "qz", "qw"}
TEXTS = {f"perception_capabilities/{name}Runner" for name in ("Speech", "Sentiment", "Check")}
TEXTS |= {"prompt_capabilities/PromptTextRunner", "generic_capabilities/LogRunner"}
OF_AN_ARM = {
    *(("pose_names", "string[]"), ("descriptions", "string[]")),
    *(("joint_names", "string[]"), ("joint_positions", "double[]")),
}
"""What only runners hand over that robots with an arm describe themselves."""
PYTHON = {"generic_capabilities/PythonRunner"}
PYTHON_TYPES = {"string": str, "bool": bool, "int": int, "double": float}

INTERFACE_KEYS = {
    *("name", "spec_type", "spec_version", "description"),
    *("default_provider", "deprecated", "formerly"),
}
PROVIDER_KEYS = {
    *("name", "spec_type", "spec_version", "description", "implements", "runner", "depends_on"),
    *("outcomes", "duration", "resources", "effects", "achieves", "definition"),
    *("reaches", "ros"),
}
PARAMETER_KEYS = {
    *("name", "type", "optional", "default", "semantic_key", "description"),
    *("aliases", "minimum", "maximum", "choices"),
}
INPUT_KEYS = {
    *("name", "type", "required", "optional", "default", "semantic_key", "description"),
    *("satisfiable_from", "fallback_parameter"),
}
OUTPUT_KEYS = {
    *("name", "type", "semantic_key", "aliases", "description"),
    *("on", "optional", "status"),
}


@cache
def files(kind: str) -> dict[str, tuple[Path, dict[str, Any]]]:
    """The files of a kind by ``package/Name``; two of one name are an error."""
    results: dict[str, tuple[Path, dict[str, Any]]] = {}
    for path in sorted(RUNNERS.glob(f"*/*/{kind}/*.yaml")):
        name = f"{path.parts[-3]}/{path.stem}"
        assert name not in results, name
        results[name] = (path, yaml.safe_load(path.read_text(encoding="utf-8")))
    return results


def interfaces() -> dict[str, dict[str, Any]]:
    return {name: data for name, (_, data) in files("interfaces").items()}


def providers() -> dict[str, dict[str, Any]]:
    return {name: data for name, (_, data) in files("providers").items()}


def parameters(data: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {entry["name"]: entry for entry in data["definition"]["configuration_parameters"]}


def inputs(data: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {entry["name"]: entry for entry in data["definition"]["runtime_parameters"]["input"]}


def outputs(data: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {entry["name"]: entry for entry in data["definition"]["runtime_parameters"]["output"]}


def entries(data: dict[str, Any]) -> Iterator[dict[str, Any]]:
    yield from data["definition"]["configuration_parameters"]
    yield from data["definition"]["runtime_parameters"]["input"]
    yield from data["definition"]["runtime_parameters"]["output"]


each_provider = pytest.mark.parametrize("name", sorted(providers()))


def test_the_families_are_all_there_and_every_file_is_in_one_of_them() -> None:
    paths = {path for kind in ("interfaces", "providers") for path, _ in files(kind).values()}
    assert set(RUNNERS.rglob("*.y*ml")) == paths
    assert {path.relative_to(RUNNERS).parts[0] for path in paths} == set(FAMILIES)


def test_every_interface_has_a_provider_of_its_name_and_the_other_way_round() -> None:
    assert list(interfaces()) == list(providers())
    for name, (path, _) in files("interfaces").items():
        assert files("providers")[name][0].parts[-4] == path.parts[-4], "another family"


def test_interfaces_say_what_they_are() -> None:
    for name, data in interfaces().items():
        assert set(data) <= INTERFACE_KEYS, name
        assert (data["name"], data["spec_type"]) == (name.partition("/")[2], "interface")
        assert data["spec_version"] == 1.2
        assert data["default_provider"] == name


@each_provider
def test_providers_say_what_they_are(name: str) -> None:
    path, data = files("providers")[name]
    family, short = path.parts[-4], path.stem
    assert set(data) <= PROVIDER_KEYS
    assert (data["name"], data["spec_type"]) == (short, "provider")
    assert data["spec_version"] == 1.2
    assert data["implements"] == name
    assert data["runner"] == f"gpsfsm.runners.{family}:{short}"
    for interface, wanted in data.get("depends_on", {}).items():
        assert interface in interfaces()
        assert providers()[wanted["provider"]]["implements"] == interface


@each_provider
def test_entries_have_known_keys_and_different_names(name: str) -> None:
    definition = providers()[name]["definition"]
    assert set(definition) == {"command", "configuration_parameters", "runtime_parameters"}
    assert set(definition["runtime_parameters"]) == {"input", "output"}
    for group, allowed in (
        (definition["configuration_parameters"], PARAMETER_KEYS),
        (definition["runtime_parameters"]["input"], INPUT_KEYS),
        (definition["runtime_parameters"]["output"], OUTPUT_KEYS),
    ):
        names = [word for entry in group for word in (entry["name"], *entry.get("aliases", ()))]
        assert len(names) == len(set(names))
        for entry in group:
            assert set(entry) <= allowed, entry["name"]
            assert entry["type"].removesuffix("[]") in PYTHON_TYPES
            assert {"name", "type", "description", "semantic_key"} <= set(entry)


@each_provider
def test_the_command_names_exactly_the_parameters(name: str) -> None:
    data = providers()[name]
    command = data["definition"]["command"]
    written = "".join(f"{parameter}='${parameter}' " for parameter in parameters(data))
    assert command == f"<Runner interface={name} provider={name} {written}/>"


@each_provider
def test_what_other_fields_name_exists(name: str) -> None:
    data = providers()[name]
    buffer = data.get("effects", {}).get("prompt_buffer")
    if buffer is not None:
        assert parameters(data)[buffer["uuid"]]["type"] == "string"
        assert parameters(data)[buffer["flush"]]["type"] == "bool"
        assert "answer" not in buffer or outputs(data)[buffer["answer"]]["type"] == "string"
    effects = data.get("effects", {})
    assert "sets_plan" not in effects or effects["sets_plan"] in inputs(data)
    assert "answers" not in effects or outputs(data)[effects["answers"]]["type"] == "string"
    for key in {"question", "checks"} & set(effects):
        assert parameters(data)[effects[key]]["type"] == "string"
    assert set(data.get("outcomes", {}).get("unless", {})) <= set(parameters(data))
    for bound in data.get("duration", {}).values():
        assert not isinstance(bound, str) or parameters(data)[bound]["minimum"] >= 0
    for entry in inputs(data).values():
        if "configuration" in entry["satisfiable_from"]:
            assert parameters(data)[entry["fallback_parameter"]]["type"] == entry["type"]
        else:
            assert entry["name"] not in parameters(data)


@each_provider
def test_required_is_what_has_no_default_and_defaults_fit(name: str) -> None:
    data = providers()[name]
    for entry in entries(data):
        if "default" in entry:
            assert entry["optional"] is True
            assert type(entry["default"]) is PYTHON_TYPES[entry["type"]]
        default = entry.get("default")
        if "choices" in entry:
            assert default in entry["choices"]
        if isinstance(default, int | float) and not isinstance(default, bool):
            assert entry.get("minimum", default) <= default <= entry.get("maximum", default)
    for entry in inputs(data).values():
        assert entry.get("required", False) is not entry.get("optional", False)


def test_descriptions_are_short_sentences_and_every_interface_has_its_own() -> None:
    written = [data["description"] for data in interfaces().values()]
    assert len(set(written)) == len(written)
    for data in (*interfaces().values(), *providers().values()):
        texts = [data["description"]]
        texts += [entry["description"] for entry in entries(data)] if "definition" in data else []
        for text in texts:
            assert re.fullmatch(r"\S(.{8,440}\S)\.", text), text


def test_a_name_of_another_dialect_means_one_thing() -> None:
    names = [name for data in interfaces().values() for name in data.get("formerly", ())]
    assert len(names) == len(set(names))
    assert not set(names) & set(interfaces())
    assert all(re.fullmatch(r"\w+/\w+Runner", name) for name in names)


def test_no_value_replaces_a_literal_by_accident() -> None:
    """An output that another runner reads is one that is meant to be read by it."""
    read = defaultdict(set)
    for name, data in providers().items():
        for word in (*parameters(data), *inputs(data)):
            read[word].add(name)
    handed = {word for data in providers().values() for word in outputs(data)}
    poses = {"nav2_capabilities/WaypointRunner", "prompt_capabilities/PromptPoseRunner"}
    poses |= {"prompt_capabilities/PromptCurrentCartesianPoseRunner"}
    places = poses | {"nav2_capabilities/WaypointYawRunner"}  # by name only: it has no inputs
    assert {word: read[word] for word in sorted(handed) if word in read} == {
        **dict.fromkeys(POSE, poses),
        **dict.fromkeys("xy", places),
        "CapabilitySpecs": {"prompt_capabilities/PromptCapabilityRunner"},
        "OccupancyGrid": {"prompt_capabilities/PromptOccupancyRunner"},
        "ReceivedPlan": {"fabric_capabilities/FabricSetPlanRunner"},
        "text": TEXTS | PYTHON,
        "response_body": PYTHON,
        "result": PYTHON,
        "stdout": PYTHON,
    }


def test_what_can_only_arrive_is_supplied_by_some_runner() -> None:
    handed = {
        (word, entry["type"])
        for data in providers().values()
        for word, entry in outputs(data).items()
    }
    needed = {
        (word, entry["type"])
        for data in providers().values()
        for word, entry in inputs(data).items()
        if entry.get("required") and entry["satisfiable_from"] == ["upstream"]
    }
    assert needed
    assert needed - handed == OF_AN_ARM


def test_prompt_runners_that_only_fill_never_fail() -> None:
    prompting = {
        name for name, data in providers().items() if "prompt_buffer" in data.get("effects", {})
    }
    safe = {
        name: data["outcomes"].get("unless", {})
        for name, data in providers().items()
        if data.get("outcomes", {}).get("never_fails")
    }
    assert {name for name in safe if name in prompting} == {
        f"prompt_capabilities/Prompt{what}Runner"
        for what in (
            *("Text", "Capability", "Pose", "Occupancy"),
            *("NamedPoses", "CurrentJointPose", "CurrentCartesianPose", "GripperState"),
        )
    }
    for name, unless in safe.items():
        assert unless == ({"flush": True} if name in prompting else {})
    assert not any("may_hang" in data.get("outcomes", {}) for data in providers().values())


def unknown_attributes(plans: Iterable[Path]) -> dict[tuple[str, str], int]:
    """How often plans write an attribute that its runner does not know."""
    names = dict(zip(interfaces(), interfaces(), strict=True))
    for name, data in interfaces().items():
        names |= dict.fromkeys(data.get("formerly", ()), name)
    results: dict[tuple[str, str], int] = defaultdict(int)
    for path in plans:
        plan = parse(path.read_text(encoding="utf-8", errors="replace")).plan
        for runner in () if plan is None else plan.runners:
            if runner.interface not in names:
                results[(runner.interface, "")] += 1
                continue
            seen = set(LABELS)
            for parameter in parameters(providers()[names[runner.interface]]).values():
                seen |= {parameter["name"], *parameter.get("aliases", ())}
            for attribute in runner.attributes:
                if attribute.name not in seen:
                    results[(runner.interface, attribute.name)] += 1
    return dict(results)


def test_the_plans_of_this_repository_write_nothing_unknown() -> None:
    assert unknown_attributes(sorted((REPO / "corpus" / "plans").glob("*.xml"))) == {}


def test_real_plans_write_little_that_is_unknown(shared_corpus: Path) -> None:
    """Each of these is a mistake of the plan, or a runner that the library does not describe."""
    plans = [
        *sorted((shared_corpus / "plans").glob("*.xml")),
        *sorted((shared_corpus / "experiment1" / "fabric").rglob("*.xml")),
        *sorted((shared_corpus / "experiment2").glob("*.xml")),
    ]
    attributes = unknown_attributes(plans)
    assert {name for name in attributes if name[1]} == {
        ("fabric_capabilities/FabricSetPlanRunner", "plan")
    }
    undescribed = {name for name, attribute in attributes if not attribute}
    assert "capabilities2_runner/PromptTextRunner" in undescribed
    assert {name.partition("/")[0] for name in undescribed} == {
        *("capabilities2_runner", "gripper_capabilities", "moveit2_capabilities"),
    }


def test_the_files_have_no_defects_and_describe_every_provider() -> None:
    loaded = load_directories([RUNNERS])
    assert [str(defect) for defect in loaded.defects] == []
    assert [provider.name for provider in loaded.library.providers] == sorted(providers())
    assert all(provider.described for provider in loaded.library.providers)


def yaml_blocks() -> list[str]:
    return re.findall(r"```yaml\n(.*?)```", DOCS.read_text(encoding="utf-8"), re.DOTALL)


def test_the_files_in_the_documentation_have_no_defects(tmp_path: Path) -> None:
    whole = [block for block in yaml_blocks() if "spec_type:" in block]
    for block in whole:
        data = yaml.safe_load(block)
        folder = tmp_path / "gripper_capabilities" / f"{data['spec_type']}s"
        folder.mkdir(parents=True)
        (folder / f"{data['name']}.yaml").write_text(block, encoding="utf-8")
    loaded = load_directories([tmp_path], base=load_directories([RUNNERS]).library)
    assert loaded.files == len(whole) == 3
    assert [str(defect) for defect in loaded.defects] == []


def test_the_documentation_shows_files_that_could_be_in_use() -> None:
    fields = PROVIDER_KEYS | INTERFACE_KEYS | {"redefines", "global_namespace", "remappings"}
    fields |= {"energy", "configuration_parameters", "input", "output"}
    blocks = [yaml.safe_load(block) for block in yaml_blocks()]
    assert {block.get("spec_type") for block in blocks} == {
        *("interface", "provider", "semantic_interface", None)
    }
    for block in blocks:
        assert set(block) <= fields
        for kind, allowed in (
            ("configuration_parameters", PARAMETER_KEYS),
            ("input", INPUT_KEYS),
            ("output", OUTPUT_KEYS),
        ):
            for entry in block.get(kind, ()):
                assert set(entry) <= allowed
    (own,) = (block for block in blocks if block.get("spec_type") == "provider")
    for parameter in parameters(own):
        assert f" {parameter}='${parameter}'" in own["definition"]["command"]


def test_the_documentation_lists_the_library_as_it_is() -> None:
    rows = []
    for name, data in providers().items():
        needs = {word for word, entry in inputs(data).items() if entry.get("required")}
        needs |= {
            word
            for word, entry in parameters(data).items()
            if not entry.get("optional") and word not in inputs(data)
        }
        handed = [
            f"`{word}`{' (s)' if entry.get('status') else ''}"
            for word, entry in outputs(data).items()
        ]
        written = ", ".join(f"`{word}`" for word in sorted(needs))
        rows.append(f"| {name} | {written} | {', '.join(handed)} |")
    text = DOCS.read_text(encoding="utf-8")
    assert f"files for [{len(rows)} interfaces]" in text
    listed = [line for line in text.splitlines() if re.match(r"\| \w+/\w+Runner \|", line)]
    assert [line.rpartition(" | ")[0] + " |" for line in listed] == rows
    held = {
        line.split(" | ")[0].removeprefix("| "): line.rpartition(" | ")[2].removesuffix(" |")
        for line in listed
    }
    assert held == {
        name: ", ".join(data.get("resources", ())) for name, data in providers().items()
    }
