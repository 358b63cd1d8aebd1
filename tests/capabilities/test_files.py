"""Folders with links, long names, and descriptions of the same things."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from gpsfsm.capabilities.load import load_directories
from tests.capabilities.support import INTERFACE, load, said, write

if TYPE_CHECKING:
    from pathlib import Path


def test_a_link_to_itself_is_a_defect_of_that_link(tmp_path: Path) -> None:
    write(tmp_path, {"arm/interfaces/Grasp.yaml": INTERFACE})
    link = tmp_path / "arm/interfaces/Self.yaml"
    link.symlink_to(link)
    loaded = load(tmp_path, {})
    (defect,) = loaded.defects
    assert (defect.file, defect.severity) == (str(link), "error")
    assert defect.message.startswith("the file cannot be read: ")
    assert len(loaded.library.interfaces) == 1


def test_a_folder_that_is_described_again_is_told_once(tmp_path: Path) -> None:
    for name in ("Grasp", "Lift", "Put"):
        for version, place in (("1.1", "arm"), ("1.2", "v2/arm")):
            text = f"name: {name}\nspec_type: interface\nspec_version: {version}\n"
            write(tmp_path, {f"{place}/interfaces/{name}.yaml": text})
    loaded = load_directories([tmp_path])
    assert {interface.version for interface in loaded.library.interfaces} == {"1.2"}
    assert said(loaded, tmp_path) == [
        "arm/interfaces/Grasp.yaml:1:1: warning: 'arm/Grasp' is also described in "
        "v2/arm/interfaces/Grasp.yaml, which is used: it has the higher spec_version (2 more of "
        "this folder likewise)\n    remove one of the two files, or one of the two folders"
    ]


def test_files_of_one_folder_are_told_one_by_one(tmp_path: Path) -> None:
    for name in ("Grasp", "Lift"):
        for part in ("", "@old"):
            text = f"name: {name}\nspec_type: interface\n"
            write(tmp_path, {f"arm__interfaces__{name}{part}.yaml": text})
    assert len(load_directories([tmp_path]).defects) == 2


@pytest.mark.parametrize(("length", "sound"), [(200, True), (201, False)])
def test_names_are_bounded(tmp_path: Path, length: int, sound: bool) -> None:
    name = "G" * (length - len("arm/"))
    files: dict[str, str | bytes] = {
        "arm/interfaces/Grasp.yaml": INTERFACE.replace("Grasp", name),
        "arm/interfaces/Lift.yaml": INTERFACE.replace("Grasp", "Lift"),
    }
    loaded = load(tmp_path, files)
    assert len(loaded.library.interfaces) == 1 + sound
    errors = [defect for defect in loaded.defects if defect.severity == "error"]
    assert [defect.message for defect in errors] == (
        [] if sound else ["the name has 201 characters; at most 200 are allowed"]
    )
