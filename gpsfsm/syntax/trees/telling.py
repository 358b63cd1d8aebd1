"""One way to report what is wrong with an element of a tree."""

from __future__ import annotations

from difflib import get_close_matches
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

    from gpsfsm.model.plan import Attribute
    from gpsfsm.model.tree import TreeNode
    from gpsfsm.syntax.collector import Collector

__all__ = ["nearest", "tell"]

_LONGEST = 60


def tell(
    collector: Collector,
    rule: str,
    node: TreeNode,
    *,
    message: str,
    hint: str = "",
    at: Attribute | None = None,
) -> None:
    """Report a problem at an element, or at one of its attributes."""
    start, length = node.start, 1 + len(node.tag)
    if at is not None:
        start, length = collector.lines.offset(at.line, at.column), len(at.name)
    collector.add(rule, start, length, message=message, hint=hint, element=node.path)


def nearest(name: str, known: Iterable[str]) -> str:
    """The known name that is most like ``name``, "" if none is like it."""
    short = [each for each in known if len(each) <= _LONGEST]
    if not name or len(name) > _LONGEST:
        return ""
    exact = [each for each in short if each.lower() == name.lower()]
    return (exact or get_close_matches(name, sorted(short), 1, 0.75) or [""])[0]
