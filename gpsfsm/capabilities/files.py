"""Which files of a folder are capability files."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import TYPE_CHECKING

from gpsfsm.capabilities.naming import naming
from gpsfsm.capabilities.reading import MAX_BYTES
from gpsfsm.errors import InputError, UsageError
from gpsfsm.files import read

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.capabilities.defects import Notes

__all__ = ["find_files", "may_be_capability", "read_bytes"]

_SUFFIXES = (".yaml", ".yml")
_MAX_FILES = 10_000


def find_files(path: str) -> list[str]:
    """The YAML files of a folder and below it, sorted; a file stands for itself.

    Links to folders and hidden folders are not followed. Raises UsageError for a path that cannot
    be read, or that holds no or too many such files.
    """
    try:
        mode = Path(path).stat().st_mode if path else 0
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise UsageError(f"{path}: cannot be read: {reason}") from error
    if not path:
        raise UsageError("a path of capability files is empty")
    if not stat.S_ISDIR(mode):
        return [path]
    found: list[str] = []
    for file in _walk(path):
        found.append(file)
        if len(found) > _MAX_FILES:
            raise UsageError(f"{path}: there are more than {_MAX_FILES} YAML files in it")
    return sorted(found)


def may_be_capability(file: str, content: bytes) -> bool:
    """Whether a file is to be read: other YAML files of a robot's folders are not ours."""
    return bool(naming(file).kind) or b"spec_type" in content


def read_bytes(file: str, notes: Notes) -> bytes | None:
    """At most a byte more than is allowed; None, with an error in ``notes``, if it cannot be."""
    try:
        return read(file, MAX_BYTES, pipes=False)
    except InputError as error:
        notes.error((1, 1), f"the file {error}")
        return None


def _walk(top: str) -> Iterator[str]:
    """In no order; a loop and not os.walk, whose recursion a deep tree of folders exhausts."""
    folders = [str(Path(top))]
    while folders:
        folder = folders.pop()
        try:
            with os.scandir(folder) as entries:
                for entry in entries:
                    if entry.is_dir(follow_symlinks=False):
                        if not entry.name.startswith("."):
                            folders.append(entry.path)
                    elif entry.name.lower().endswith(_SUFFIXES) and not _leads_to_folder(entry):
                        yield str(Path(entry.path))  # without the "./" that scandir keeps
        except OSError as error:
            raise UsageError(f"{folder}: cannot be read: {error.strerror or error}") from error


def _leads_to_folder(entry: os.DirEntry[str]) -> bool:
    """Whether a link leads to a folder. One that leads to itself is told when it is read."""
    try:
        return entry.is_dir()
    except OSError:
        return False
