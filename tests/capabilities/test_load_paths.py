"""Folders of capability files: which are read, and which of several counts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from gpsfsm.capabilities.load import load_directories
from gpsfsm.errors import UsageError
from tests.capabilities.support import INTERFACE, PROVIDER, load, said, write

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.parametrize("make", [False, True])
def test_a_path_without_files_is_an_error(tmp_path: Path, make: bool) -> None:
    folder = tmp_path / "none"
    if make:
        write(folder, {"other.yaml": "a: 1\n"})
    with pytest.raises(UsageError) as caught:
        load_directories([folder])
    assert str(caught.value).startswith(f"{folder}: ")
    assert ("there is no capability file in it" if make else "No such file") in str(caught.value)


def test_no_paths_give_an_empty_library() -> None:
    assert load_directories([]).library.interfaces == ()


def test_a_later_path_wins_silently(tmp_path: Path) -> None:
    write(tmp_path / "one", {"arm/interfaces/Grasp.yaml": INTERFACE + "description: one\n"})
    write(tmp_path / "two", {"arm/interfaces/Grasp.yaml": INTERFACE + "description: two\n"})
    for order in (("one", "two"), ("two", "one")):
        loaded = load_directories([tmp_path / name for name in order])
        assert loaded.defects == ()
        assert [interface.description for interface in loaded.library.interfaces] == [order[1]]


@pytest.mark.parametrize(
    ("versions", "used", "why"),
    [
        (("1.1", "1.2"), "b", "it has the higher spec_version"),
        (("1.2", "1.1"), "a", "it has the higher spec_version"),
        (("1.2", "1.2"), "a", "it comes first"),
    ],
)
def test_of_two_files_of_one_folder_the_newer_form_counts(
    tmp_path: Path, versions: tuple[str, str], used: str, why: str
) -> None:
    for name, version in zip("ab", versions, strict=True):
        text = f"name: Grasp\nspec_type: interface\nspec_version: {version}\ndescription: {name}\n"
        write(tmp_path, {f"{name}/arm/interfaces/Grasp.yaml": text})
    loaded = load_directories([tmp_path])
    assert [interface.description for interface in loaded.library.interfaces] == [used]
    other = {"a": "b", "b": "a"}[used]
    assert said(loaded, tmp_path) == [
        f"{other}/arm/interfaces/Grasp.yaml:1:1: warning: 'arm/Grasp' is also described in "
        f"{used}/arm/interfaces/Grasp.yaml, which is used: {why}\n    remove one of the two files"
    ]


def test_a_broken_file_does_not_stop_the_others(tmp_path: Path) -> None:
    files: dict[str, str | bytes] = {
        "arm/interfaces/Broken.yaml": "name: [",
        "arm/interfaces/Grasp.yaml": INTERFACE,
        "arm/interfaces/Not.yaml": b"\xff\xfe",
    }
    loaded = load(tmp_path, files)
    assert [interface.name for interface in loaded.library.interfaces] == ["arm/Grasp"]
    assert [defect.severity for defect in loaded.defects] == ["error", "error"]


def test_what_the_known_library_has_may_be_named(tmp_path: Path) -> None:
    library = load(tmp_path / "a", {"arm/interfaces/Grasp.yaml": INTERFACE}).library
    files: dict[str, str | bytes] = {"arm/providers/Grasp.yaml": PROVIDER}
    assert load(tmp_path / "b", files, library).defects == ()
    assert len(load(tmp_path / "b", files).defects) == 1
