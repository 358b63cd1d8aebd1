"""From paths to plans: files, folders, standard input."""

from __future__ import annotations

import os
import stat
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from gpsfsm.checking import CheckOptions, check_text, unreadable
from gpsfsm.errors import InputError
from gpsfsm.files import read, read_from

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.model.report import PlanReport

__all__ = ["STDIN", "Input", "find_inputs", "read_bytes", "read_file", "read_input"]

STDIN = "<stdin>"
"""How standard input is called in reports."""

_SUFFIX = ".xml"
_NOT_REGULAR = "is not a regular file"


@dataclass(frozen=True, slots=True)
class Input:
    """One plan to check: a path, or why there is none; ``stdin`` is standard input."""

    path: str
    problem: str = ""
    stdin: bool = False


def find_inputs(paths: Sequence[str]) -> Iterator[Input]:
    """Every plan that the paths name, each once: files as they are, folders recursively.

    A folder stands for its ``*.xml`` files in the order of their paths; ``-`` is standard input.
    Links to folders are not followed, so that no plan comes twice and no walk goes in circles.
    """
    seen: set[tuple[str, bool]] = set()
    for path in paths:
        for found in _expand(path):
            key = (os.path.normpath(found.path), found.stdin)
            if key not in seen:
                seen.add(key)
                yield found


def read_bytes(found: Input, max_bytes: int) -> bytes:
    """The text of one input, at most one byte more than is allowed; raises InputError.

    The byte more tells the front end that the text is too long; the rest of a huge file is never
    read.
    """
    if found.problem:
        raise InputError(found.problem)
    if found.stdin:
        return _read_stdin(max_bytes)
    if _is_folder(found.path):
        raise InputError("is a folder")
    return read(found.path, max_bytes)


def read_input(found: Input, options: CheckOptions) -> PlanReport:
    """Read and check one plan; what cannot be read or checked is reported, never raised.

    Raises UsageError for options that make no sense.
    """
    try:
        text = read_bytes(found, options.limits.max_bytes)
    except InputError as error:
        return unreadable(found.path, str(error))
    return check_text(text, found.path, options)


def read_file(file: str | Path, max_bytes: int) -> bytes:
    """The whole of a file that is no plan: settings, a baseline; raises InputError."""
    content = read(file, max_bytes)
    if len(content) > max_bytes:
        raise InputError(f"is larger than {max_bytes} bytes")
    return content


def _expand(path: str) -> Iterator[Input]:
    if path == "-":
        yield Input(STDIN, stdin=True)
        return
    if not _is_folder(path):
        yield Input(path)
        return
    found = sorted(_walk(path), key=lambda each: each.path)
    yield from found
    if not found:
        yield Input(path, f"is a folder without any *{_SUFFIX} file")


def _is_folder(path: str) -> bool:
    try:
        return path != "" and stat.S_ISDIR(Path(path).stat().st_mode)
    except (OSError, ValueError):
        return False  # reading it tells why


def _walk(top: str) -> Iterator[Input]:
    """The plans of a folder, and what keeps it from being read; in no order.

    A loop and not os.walk, whose recursion a deep tree of folders exhausts.
    """
    folders = [str(Path(top))]
    while folders:
        folder = folders.pop()
        try:
            with os.scandir(folder) as entries:
                for entry in entries:
                    if entry.is_dir(follow_symlinks=False):
                        folders.append(entry.path)
                    elif entry.name.endswith(_SUFFIX):
                        yield from _entry(entry)
        except OSError as error:
            yield Input(folder, f"cannot be read: {error.strerror or error}")


def _entry(entry: os.DirEntry[str]) -> Iterator[Input]:
    """A file of a folder. Nobody named it, so a pipe must not make the check wait for ever."""
    # Path drops the leading "./" that scandir keeps.
    path = str(Path(entry.path))
    try:
        mode = entry.stat().st_mode
    except OSError as error:
        yield Input(path, f"cannot be read: {error.strerror or error}")
        return
    if stat.S_ISREG(mode):
        yield Input(path)
    elif not stat.S_ISDIR(mode):
        yield Input(path, _NOT_REGULAR)


def _read_stdin(max_bytes: int) -> bytes:
    if sys.stdin is None:  # the caller closed it; typeshed does not know
        raise InputError("cannot be read: standard input is closed")
    try:
        number = sys.stdin.fileno()
    except (OSError, ValueError, AttributeError):  # somebody has put something in its place
        return _read_substitute(max_bytes)
    return read_from(number, max_bytes)


def _read_substitute(max_bytes: int) -> bytes:
    try:
        return sys.stdin.buffer.read(max_bytes + 1)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}") from error
    except ValueError as error:  # it is closed
        raise InputError(f"cannot be read: {error}") from error
