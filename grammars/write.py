"""Writes the grammars of the built-in library.

``python -m gpsfsm.grammars.write`` writes them beside this module; with ``--check`` it only tells
which are not up to date.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from gpsfsm.capabilities.library import builtin_capabilities
from gpsfsm.grammars.emit import find_format, format_names
from gpsfsm.grammars.rules import DEPTH
from gpsfsm.grammars.writable import alphabet
from gpsfsm.streams import to_stderr

if TYPE_CHECKING:
    from collections.abc import Sequence

_FOLDER = Path(__file__).parent


def texts() -> dict[str, str]:
    """The grammars by the names of their files."""
    words = alphabet(builtin_capabilities().library)
    formats = map(find_format, format_names())
    return {each.file: each.emit(words, DEPTH) for each in formats if each.emit is not None}


def main(arguments: Sequence[str] | None = None) -> int:
    """Write or check the files; exit code 1 if one is not up to date."""
    parser = argparse.ArgumentParser(prog="python -m gpsfsm.grammars.write")
    parser.add_argument("--check", action="store_true", help="only compare")
    check = parser.parse_args(arguments).check
    code = 0
    for name, text in texts().items():
        file = _FOLDER / name
        if not check:
            file.write_text(text, encoding="ascii", newline="\n")
        elif not file.is_file() or file.read_bytes() != text.encode("ascii"):
            to_stderr(f"grammars/{name} is not up to date; run 'make docs'\n")
            code = 1
    return code


if __name__ == "__main__":
    sys.exit(main())
