"""Makes the compiled table of a folder of capability files.

``python -m gpsfsm.capabilities.compile runners`` writes ``runners/library.json``; with ``--check``
it only tells whether that file is up to date.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from gpsfsm.capabilities.load import load_directories
from gpsfsm.capabilities.table import FILE, dump
from gpsfsm.errors import GpsfsmError
from gpsfsm.model.capability import Interface, Provider, SemanticInterface
from gpsfsm.streams import to_stderr

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.capabilities.library import Library

__all__ = ["main", "relative"]

_Entry = TypeVar("_Entry", Interface, Provider, SemanticInterface)


def relative(library: Library, folder: str | Path) -> Library:
    """The library with ``origin`` relative to the parent of ``folder``: the same everywhere."""
    parent = Path(folder).resolve().parent

    def shown(entry: _Entry) -> _Entry:
        return replace(entry, origin=Path(entry.origin).resolve().relative_to(parent).as_posix())

    return replace(
        library,
        interfaces=tuple(map(shown, library.interfaces)),
        providers=tuple(map(shown, library.providers)),
        semantic=tuple(map(shown, library.semantic)),
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Write or check the table; exit code 0 done, 1 defects or not up to date, 2 not possible."""
    parser = argparse.ArgumentParser(prog="python -m gpsfsm.capabilities.compile")
    parser.add_argument("folder", help="the folder with the capability files")
    parser.add_argument("--check", action="store_true", help=f"only compare with {FILE}")
    given = parser.parse_args(arguments)
    target = Path(given.folder) / FILE
    try:
        loaded = load_directories([given.folder])
    except GpsfsmError as error:
        to_stderr(f"{error}\n")
        return 2
    if loaded.defects:
        to_stderr("".join(f"{defect}\n" for defect in loaded.defects))
        return 1
    table = dump(relative(loaded.library, given.folder))
    if not given.check:
        target.write_text(table, encoding="utf-8", newline="\n")
        return 0
    if target.is_file() and target.read_text(encoding="utf-8") == table:
        return 0
    to_stderr(f"{target} is not up to date; run 'make docs' or this without --check\n")
    return 1


if __name__ == "__main__":
    sys.exit(main())
