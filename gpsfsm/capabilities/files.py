"""Capability files: their places, which say kind, package and name, and their bytes."""

from __future__ import annotations

import os
import stat
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from gpsfsm.errors import InputError, UsageError, system_reason
from gpsfsm.files import read

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from gpsfsm.capabilities.defects import Notes


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
    """True if a capability can have this name: ``package/Name``, as ``load`` reads it."""
    package, _, bare = text.partition("/")
    odd = any(each.isspace() or not each.isprintable() for each in text)
    return bool(package and bare) and "/" not in bare and not odd and len(text) <= MAX_NAME


def has_place(name: str) -> bool:
    """True if a file below any folder can hold what has this name, and is read there.

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
    """The kind, package and name in a path; "" where it says nothing.

    ``exported``: the package.xml of a package says so.
    """

    kind: str
    package: str
    name: str
    exported: bool = False


def absolute(path: str) -> Path:
    """A path without dots in it, of whose names links change none."""
    return Path(os.path.abspath(path))  # noqa: PTH100  (must not follow links)


def naming(file: str) -> Naming:
    """Read ``package/interfaces/Name.yaml``, or flat ``package__interfaces__Name@….yaml``."""
    path = absolute(file)
    stem = path.stem.partition("@")[0] or path.stem
    parts = stem.split("__")
    if len(parts) == 3 and parts[1] in KINDS and parts[0] and parts[2]:
        return Naming(KINDS[parts[1]], parts[0], parts[2])
    if path.parent.name in KINDS:
        return Naming(KINDS[path.parent.name], path.parent.parent.name, stem)
    return Naming("", "", stem)


_SUFFIXES = (".yaml", ".yml")
_MAX_FILES = 10_000
MAX_BYTES = 1 << 20
"""Bytes of a file of capabilities, a world or a task."""


def find_files(path: str) -> list[str]:
    """The YAML files of a folder and below it, sorted; a file stands for itself.

    Links to folders and hidden folders are not followed. Raises UsageError for a path that cannot
    be read, or that holds no or too many such files.
    """
    try:
        mode = Path(path).stat().st_mode if path else 0
    except (OSError, ValueError) as error:
        raise UsageError(f"{path}: cannot be read: {system_reason(error)}") from error
    if not path:
        raise UsageError("a path of capability files is empty")
    if not stat.S_ISDIR(mode):
        return [path]
    files: list[str] = []
    for file in _walk(path, lambda name: name.lower().endswith(_SUFFIXES)):
        files.append(file)
        if len(files) > _MAX_FILES:
            raise UsageError(f"{path}: there are more than {_MAX_FILES} YAML files in it")
    return sorted(files)


MANIFEST = "package.xml"
"""The name of the file that makes a folder a ROS package."""


def find_manifests(path: str) -> list[str]:
    """The files package.xml of a folder and below it, sorted; none for a path to a file."""
    if not Path(path).is_dir():
        return []
    manifests: list[str] = []
    for file in _walk(path, lambda name: name == MANIFEST):
        manifests.append(file)
        if len(manifests) > _MAX_FILES:
            raise UsageError(f"{path}: there are more than {_MAX_FILES} packages in it")
    return sorted(manifests)


def may_be_capability(file: str, content: bytes) -> bool:
    """True if a file is to be read: other YAML files of a robot's folders are not ours."""
    return bool(naming(file).kind) or b"spec_type" in content


def read_bytes(file: str, notes: Notes) -> bytes | None:
    """At most a byte more than is allowed; None, with an error in ``notes``, if it cannot be."""
    try:
        return read(file, MAX_BYTES, pipes=False)
    except InputError as error:
        notes.error((1, 1), f"the file {error}")
        return None


def _walk(top: str, wanted: Callable[[str], bool]) -> Iterator[str]:
    """The files with such names, in no order.

    A loop and not os.walk, whose recursion a deep tree of folders exhausts.
    """
    folders = [str(Path(top))]
    while folders:
        folder = folders.pop()
        try:
            with os.scandir(folder) as entries:
                for entry in entries:
                    if entry.is_dir(follow_symlinks=False):
                        if not entry.name.startswith("."):
                            folders.append(entry.path)
                    elif wanted(entry.name) and not _leads_to_folder(entry):
                        yield str(Path(entry.path))  # without the "./" that scandir keeps
        except OSError as error:
            raise UsageError(f"{folder}: cannot be read: {error.strerror or error}") from error


def _leads_to_folder(entry: os.DirEntry[str]) -> bool:
    """True if a link leads to a folder. One that leads to itself is told when it is read."""
    try:
        return entry.is_dir()
    except OSError:
        return False
