"""Writes capability files into a folder and reads them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.capabilities.load import Loaded, load_directories

if TYPE_CHECKING:
    from pathlib import Path

    from gpsfsm.capabilities.library import Library

__all__ = ["INTERFACE", "PROVIDER", "load", "provider", "said", "write"]

INTERFACE = "name: Grasp\nspec_type: interface\nspec_version: 1.2\n"
PROVIDER = "name: Grasp\nspec_type: provider\nspec_version: 1.2\nimplements: arm/Grasp\n"


def write(folder: Path, files: dict[str, str | bytes]) -> None:
    for name, content in files.items():
        file = folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content.encode() if isinstance(content, str) else content)


def load(folder: Path, files: dict[str, str | bytes], known: Library | None = None) -> Loaded:
    write(folder, files)
    return load_directories([folder], known=known)


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
