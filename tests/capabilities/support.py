"""Writes capability files into a folder and reads them."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from gpsfsm.capabilities.load import Loaded, load_directories
from gpsfsm.model.finding import Severity

if TYPE_CHECKING:
    from collections.abc import Iterable

    from gpsfsm.capabilities.describe import LeastFile
    from gpsfsm.capabilities.library import Library

__all__ = ["INTERFACE", "PROVIDER", "describe", "load", "provider", "said", "write"]

INTERFACE = "name: Grasp\nspec_type: interface\nspec_version: 1.2\n"
PROVIDER = "name: Grasp\nspec_type: provider\nspec_version: 1.2\nimplements: arm/Grasp\n"


def write(folder: Path, files: dict[str, str | bytes]) -> None:
    for name, content in files.items():
        file = folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content.encode() if isinstance(content, str) else content)


def load(folder: Path, files: dict[str, str | bytes], library: Library | None = None) -> Loaded:
    write(folder, files)
    return load_directories([folder], base=library)


def provider(folder: Path, body: str) -> tuple[Loaded, list[str]]:
    """An interface and a provider with ``body`` from line 5 on; what is said of the provider."""
    files: dict[str, str | bytes] = {
        "arm/interfaces/Grasp.yaml": INTERFACE,
        "arm/providers/Grasp.yaml": PROVIDER + body,
    }
    loaded = load(folder, files)
    return loaded, said(loaded, folder)


def said(loaded: Loaded, folder: Path) -> list[str]:
    """The defects without the folder and the name of the provider's file."""
    texts = [str(defect).replace(f"{folder}/", "") for defect in loaded.defects]
    return [text.removeprefix("arm/providers/Grasp.yaml:") for text in texts]


def describe(library: Library, files: Iterable[LeastFile], provider: str) -> Library:
    """The library after somebody has written these files, or added to them, as they were told to.

    All of them lie below one folder, from where they are read without an error.
    """
    with tempfile.TemporaryDirectory() as folder:
        for each in files:
            lines, file = each.lines, Path(folder, each.path)
            if each.exists:  # what it holds already
                own = library.provider(provider)
                assert own is not None
                head = (f"name: {own.name}", "spec_type: provider", f"implements: {own.implements}")
                lines, file = (*head, *lines), Path(folder, "there", "providers", "a.yaml")
            assert file.resolve().is_relative_to(Path(folder).resolve())
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text("\n".join(lines), encoding="utf-8")
        loaded = load_directories([folder], base=library)
    assert [each for each in loaded.defects if each.severity is Severity.ERROR] == []
    return library.extended(loaded.library)
