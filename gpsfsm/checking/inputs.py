"""From paths to plans: files, folders, standard input."""

from __future__ import annotations

import os
import stat
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from gpsfsm.errors import GpsfsmError, InputError, misused
from gpsfsm.files import read, read_from
from gpsfsm.late import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.syntax import Limits, Parsed

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
        for item in _expand(path):
            key = (os.path.normpath(item.path), item.stdin)
            if key not in seen:
                seen.add(key)
                yield item


def read_bytes(item: Input, max_bytes: int) -> bytes:
    """The text of one input, at most one byte more than is allowed; raises InputError.

    The byte more tells the front end that the text is too long; the rest of a huge file is never
    read.
    """
    if item.problem:
        raise InputError(item.problem)
    if item.stdin:
        return _read_stdin(max_bytes)
    if _is_folder(item.path):
        raise InputError("is a folder")
    return read(item.path, max_bytes)


def read_named(path: str, max_bytes: int) -> tuple[str, bytes]:
    """The name of a file, or of standard input for ``-``, and its content. Raises GpsfsmError."""
    stdin = path == "-"
    name = STDIN if stdin else path
    try:
        return name, read_bytes(Input(name, stdin=stdin), max_bytes)
    except GpsfsmError as error:
        raise GpsfsmError(f"{name}: {error}") from error


def parse_named(path: str, limits: Limits, *, from_response: bool = False) -> Parsed:
    """The plan, tree or machine in a file, or in standard input for ``-``. Raises GpsfsmError."""
    from gpsfsm.compile.plan_text import read_plan_or_machine  # (loads the front end)

    name, text = read_named(path, limits.max_bytes)
    return read_plan_or_machine(text, file=name, limits=limits, from_response=from_response)


def is_text(value: str, *, from_response: bool = False) -> bool:
    """True if a ``str`` is the text of a plan, not a path.

    What holds a ``<`` or a line break, or nothing, is a text, and so is a machine in JSON. A
    model's answer may be any text: it is a path only if such a file exists.
    """
    if not value or "<" in value or "\n" in value:
        return True
    if value.startswith("{") and '"nodes"' in value:
        return True
    return from_response and value != "-" and not os.path.exists(value)  # noqa: PTH110  (too long)


def text_of(
    value: object, function: str, max_bytes: int, *, from_response: bool = False
) -> tuple[str, str | bytes]:
    """The name and the content of a text that is given itself, or by the path of its file.

    Raises UsageError for what is neither, InputError for a file that cannot be read.
    """
    if isinstance(value, bytes):
        return "<text>", value
    if isinstance(value, str) and is_text(value, from_response=from_response):
        return "<text>", value
    if not isinstance(value, str | Path):
        raise misused(function, "the text of a plan or the path of a file", value)
    try:
        return str(value), read_bytes(Input(str(value)), max_bytes)
    except InputError as error:
        raise InputError(f"{value}: {error}") from error


def _expand(path: str) -> Iterator[Input]:
    if path == "-":
        yield Input(STDIN, stdin=True)
        return
    if not _is_folder(path):
        yield Input(path)
        return
    items = sorted(_walk(path), key=lambda each: each.path)
    yield from items
    if not items:
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
