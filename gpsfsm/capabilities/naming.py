"""What the place of a capability file says: kind, package and name."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

__all__ = ["KINDS", "MAX_NAME", "Naming", "has_place", "is_name", "naming"]

KINDS = {
    "interfaces": "interface",
    "providers": "provider",
    "semantic_interfaces": "semantic_interface",
}
"""The names of folders, and the ``spec_type`` of the files in them."""

MAX_NAME = 200
"""Characters of the name of a capability."""

_MAX_PART = 255
"""Bytes of the name of a file or folder, on most systems."""
_ELSEWHERE = frozenset("\\:")


def is_name(text: str) -> bool:
    """Whether a capability can have this name: ``package/Name``, as ``load`` reads it."""
    package, _, bare = text.partition("/")
    odd = any(each.isspace() or not each.isprintable() for each in text)
    return bool(package and bare) and "/" not in bare and not odd and len(text) <= MAX_NAME


def has_place(name: str) -> bool:
    """Whether a file below any folder can hold what has this name, and is read there.

    Hidden folders are not. And the name may come from a plan, so it must lead out of no folder,
    whatever separates folders on a system.
    """
    package, _, bare = name.partition("/")
    parts = (package, f"{bare}.yaml")
    hidden = any(part.startswith(".") for part in parts)
    long = any(len(part.encode("utf-8", "replace")) > _MAX_PART for part in parts)
    return is_name(name) and not (hidden or long or _ELSEWHERE & set(name))


@dataclass(frozen=True, slots=True)
class Naming:
    """What a path says of the capability; "" where it says nothing."""

    kind: str
    package: str
    name: str


def naming(file: str) -> Naming:
    """Read ``package/interfaces/Name.yaml``, or flat ``package__interfaces__Name@….yaml``."""
    path = Path(os.path.abspath(file))  # noqa: PTH100  (must not follow links)
    stem = path.stem.partition("@")[0] or path.stem
    parts = stem.split("__")
    if len(parts) == 3 and parts[1] in KINDS and parts[0] and parts[2]:
        return Naming(KINDS[parts[1]], parts[0], parts[2])
    if path.parent.name in KINDS:
        return Naming(KINDS[path.parent.name], path.parent.parent.name, stem)
    return Naming("", "", stem)
