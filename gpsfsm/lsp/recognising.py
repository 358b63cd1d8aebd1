"""Which documents are plans: an editor opens XML of all kinds, and most of it is none of ours."""

from __future__ import annotations

import fnmatch
import re
from typing import TYPE_CHECKING

from gpsfsm.reading import holds_trees
from gpsfsm.syntax.chars import NAME_PATTERN

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

__all__ = ["is_plan", "is_xml", "matches", "outermost"]

_FIRST = re.compile(
    r"(?:[^<]++|<\?.*?(?:\?>|\Z)|<!--.*?(?:-->|\Z)|<!(?!--)[^<>]*+>|<(?![/A-Za-z_:]))*+"
    rf"<(?P<name>{NAME_PATTERN})",
    re.DOTALL,
)
"""What has no end ends with the text; else it would be looked for at each place again."""
_NAMES = frozenset({"plan", "control", "runner"})


def is_xml(language: str, uri: str) -> bool:
    """Whether the editor takes a document for XML. Emacs calls it by the name of its mode."""
    return language in ("xml", "nxml") or uri.lower().endswith(".xml")


def is_plan(text: str) -> bool:
    """Whether the outermost element is one of a plan, or that of behaviour trees.

    >>> is_plan("<!-- go --><plan>"), is_plan("<robot name='r2'/>"), is_plan("no markup at all")
    (True, False, False)
    """
    found = _FIRST.match(text)
    if found is None:
        return False
    return found["name"].lower() in _NAMES or holds_trees(text)


def outermost(text: str) -> int | None:
    """Where the name of the outermost element stands; None if there is none."""
    found = _FIRST.match(text)
    return None if found is None else found.start("name")


def matches(file: Path | None, root: Path | None, patterns: Sequence[str]) -> bool:
    """Whether a file is among those that are plans whatever they hold.

    A ``*`` stands for any characters, slashes too. Patterns are relative to the folder that is
    open in the editor.
    """
    if file is None:
        return False
    names = [str(file)]
    if root is not None and file.is_relative_to(root):
        names.append(file.relative_to(root).as_posix())
    return any(fnmatch.fnmatchcase(name, pattern) for name in names for pattern in patterns)
