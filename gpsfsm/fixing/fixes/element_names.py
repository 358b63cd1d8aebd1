"""GP101, GP104, GP105: names of elements that are misspelt or have a prefix."""

from __future__ import annotations

from difflib import get_close_matches
from typing import TYPE_CHECKING

from gpsfsm.fixing.fixer import Fix, Fixer
from gpsfsm.fixing.layout import rename, without_attribute
from gpsfsm.syntax.text import is_namespace_declaration

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft, Node

_NAMES = {"plan": "Plan", "control": "Control", "runner": "Runner"}


def propose(draft: Draft) -> Iterator[Fix]:
    """One fix per element."""
    for node in draft.outline.nodes.values():
        meant = _meant(draft, node)
        edits = list(rename(node, meant)) if meant else []
        if (meant or node.name) in _NAMES.values():
            edits += (
                without_attribute(draft, raw)
                for raw in node.tag.attributes
                if is_namespace_declaration(raw.name)
            )
        if not edits:
            continue
        rule = "GP105"
        if node.parent is None and node.name != "Plan" and draft.wants("GP104"):
            rule = "GP104"
        elif ":" in node.name or not draft.wants("GP105"):
            rule = "GP101"
        title = f"<{node.name[:40]}> written <{meant}>" if meant else "namespace removed"
        yield Fix(rule, title, node.start, tuple(edits))


def _meant(draft: Draft, node: Node) -> str:
    """The name that an element should have; "" if it has it, or nobody can tell."""
    name = node.name.rpartition(":")[2].lower()[:40]
    if node.name in _NAMES.values():
        return ""
    meant = _NAMES.get(name)
    if meant is None:
        close = get_close_matches(name, _NAMES, n=2, cutoff=0.8)
        # A name that is like two of them means neither for sure.
        meant = _NAMES[close[0]] if len(close) == 1 else None
    if meant == "Runner" and not node.attribute("interface") and not node.attribute("provider"):
        return ""
    if meant == "Plan" and node.parent is not None and draft.plan is not None:
        return ""
    return meant or ""


FIXER = Fixer(
    name="element-names",
    rules=("GP101", "GP104", "GP105"),
    propose=propose,
    safe=(
        "writes `<plan>`, `<Contrl>` or `<x:Runner>` as they are spelt, and removes XML "
        "namespaces: there are three elements, and no other is like these"
    ),
)
