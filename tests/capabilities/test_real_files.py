"""The capability files of the original stack, which are not part of this repository."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from gpsfsm.capabilities.load import load_directories
from gpsfsm.capabilities.table import builtin, dump, load
from gpsfsm.model.capability import Parameter, Source, ValueType

if TYPE_CHECKING:
    from pathlib import Path


def test_everything_that_can_be_loaded_is_loaded(shared_corpus: Path) -> None:
    folder = shared_corpus / "capabilities"
    loaded = load_directories([folder])
    files = sorted(folder.rglob("*.yaml"))
    assert loaded.files == len(files)
    library = loaded.library
    names: set[tuple[str, str]] = set()
    for file in files:
        if file.name.startswith("prompt_capabilities__interfaces__PromptSpeechRunner@"):
            continue
        package, kind, _ = file.name.split("__")
        said = re.search(r"^name:\s*(\S+)", file.read_text(), re.MULTILINE)
        assert said is not None
        names.add((kind, f"{package}/{said[1]}"))
    assert {interface.name for interface in library.interfaces} == _of(names, "interfaces")
    assert {provider.name for provider in library.providers} == _of(names, "providers")
    assert {each.name for each in library.semantic} == _of(names, "semantic_interfaces")
    assert load(dump(library)) == library


def _of(names: set[tuple[str, str]], kind: str) -> set[str]:
    return {name for of, name in names if of == kind}


def test_the_defects_are_the_ones_that_people_found(shared_corpus: Path) -> None:
    folder = shared_corpus / "capabilities"
    loaded = load_directories([folder])
    errors = [defect for defect in loaded.defects if defect.severity == "error"]
    assert [(defect.file.removeprefix(f"{folder}/"), defect.line) for defect in errors] == [
        ("prompt_capabilities__interfaces__PromptSpeechRunner@d5b19a88_v1.2_UNPARSABLE.yaml", 12),
        ("v2/perception_capabilities__interfaces__SpeechRunner.yaml", 14),
    ]
    assert all("quotation mark" in defect.hint for defect in errors)
    others = [defect.message for defect in loaded.defects if defect not in errors]
    entries = ("is also described in", "which no file describes", "but the file is called")
    assert all(any(words in message for words in entries) for message in others)
    foreign = [message for message in others if entries[1] in message]
    assert len(foreign) == 4
    assert all("'fp_perception_capabilities/" in message for message in foreign)


def test_the_newest_form_counts(shared_corpus: Path) -> None:
    library = load_directories([shared_corpus / "capabilities"]).library
    provider = library.provider("prompt_capabilities/PromptTextRunner")
    assert provider is not None
    assert provider.version == "1.2"
    assert provider.described
    flush = Parameter("flush", ValueType.BOOL, False, False, "prompt.cache.flush")
    read = provider.parameter("flush")
    assert read is not None
    assert (read.type, read.required, read.default) == (flush.type, False, False)
    (text,) = provider.inputs
    assert text.required
    assert text.satisfiable_from == (Source.UPSTREAM, Source.CONFIGURATION)
    assert text.fallback == "text"
    pose = library.provider("prompt_capabilities/PromptPoseRunner")
    assert pose is not None
    assert all(each.required for each in (*pose.configuration, *pose.inputs))
    old = library.provider("capabilities2_runner_nav2/WaypointRunner")
    assert old is not None
    assert not old.described


def test_names_of_other_dialects_are_understood(shared_corpus: Path) -> None:
    old = load_directories([shared_corpus / "capabilities" / "v1"]).library
    library = builtin()
    described = {*library.interface_names}
    unknown = [
        interface.name
        for interface in old.interfaces
        if interface.name not in described and library.translation(interface.name) is None
    ]
    assert [name for name in unknown if "Launch" not in name] == []
