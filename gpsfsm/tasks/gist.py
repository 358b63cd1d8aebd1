"""The gist of an answer that is no plan as it stands: where it wants to drive (docs/tasks.md).

Only grades rest on it, and only where the syntax is wrong already. The elements are read as far as
an XML parser can recover them, by what their shape says.
"""

from __future__ import annotations

import re
from copy import copy
from typing import TYPE_CHECKING, cast
from xml.sax.saxutils import quoteattr

from gpsfsm.tasks.place_names import plain_name
from gpsfsm.tasks.positions import position_of

if TYPE_CHECKING:
    from lxml import etree

    from gpsfsm.tasks.task import Task

__all__ = ["drive_of", "gist_of"]

_MAX_CHARACTERS = 200_000
_MAX_DEPTH = 60
_ASKS = re.compile(r"(?i:check|condition)|^(?i:is|has|can)[A-Z_]")
_TELLS = re.compile(r"^(?i:say|speak|log|print|report|notify|announce|set|unset|wait)(?![a-z])")
_FALLBACK = re.compile(r"(?i:(?:reactive|async)?fallback|selector|fallbackstar)")
_DRIVE = "nav2_capabilities/WaypointRunner"


def drive_of(task: Task) -> str:
    """The interface that drives have in a gist: one that the steps of the task accept."""
    attempts = [pattern for step in task.steps for pattern in step.attempts]
    if not attempts or any(pattern.accepts(_DRIVE) for pattern in attempts):
        return _DRIVE
    return plain_name(attempts[0].interfaces[0])


def gist_of(text: str, drive: str = _DRIVE) -> str:
    """The last plan of the text in the words of plans; "" if it wants to drive nowhere.

    ``drive`` is the interface of its runners.

    >>> print(gist_of('<Plan><Go to="1;2"/><IsThere/></Plan>').splitlines()[1].strip())
    <Runner interface="nav2_capabilities/WaypointRunner" x="1" y="2" />
    """
    start = text.rfind("<Plan")
    if start < 0 or len(text) - start > _MAX_CHARACTERS:
        return ""
    from lxml import etree  # noqa: PLC0415  (only for answers that nothing else can read)

    parser = etree.XMLParser(recover=True, resolve_entities=False, no_network=True)
    try:
        found = etree.fromstring(text[start:].encode("utf-8", "replace"), parser)
    except etree.XMLSyntaxError:
        return ""
    root = cast("etree._Element | None", found)  # the parser may recover nothing
    lines = [] if root is None else _Reader(root, drive).children(root, 0)
    return "\n".join(["<Plan>", *lines, "</Plan>", ""]) if lines else ""


class _Reader:
    """Reads elements; ``keys`` is what is said to stand below the keys of a blackboard."""

    def __init__(self, root: etree._Element, drive: str) -> None:
        self.drive = quoteattr(drive)
        self.keys: dict[str, str] = {}
        for each in root.iter("SetBlackboard"):
            self.keys[each.get("output_key") or each.get("key") or ""] = each.get("value", "")

    def children(self, element: etree._Element, depth: int) -> list[str]:
        """What the children come to, in order; a recovery stays one."""
        if depth > _MAX_DEPTH:
            return []
        lines: list[str] = []
        for child in element:
            if not isinstance(cast("object", child.tag), str):  # a comment
                continue
            if len(child):
                lines += self._control(child, depth)
            else:
                lines += self._drive(child)
        return lines

    def _control(self, element: etree._Element, depth: int) -> list[str]:
        if _FALLBACK.fullmatch(str(element.tag)):
            held = (self.children(_only(element, child), depth + 1) for child in element)
            parts = [found for found in held if found]
            return _guard(parts) if parts else []
        kind = element.get("type") or ""
        known = kind if kind in ("recovery", "parallel_any", "parallel_all") else "sequential"
        return _wrapped(known, self.children(element, depth + 1))

    def _drive(self, element: etree._Element) -> list[str]:
        """A leaf that says where, and neither asks nor tells, is a drive; others are left out."""
        tag = str(element.tag)
        if _ASKS.search(tag) or _TELLS.match(tag):
            return []
        values = {str(name): self._value(str(value)) for name, value in element.items()}
        found = position_of(values, element.text or "")
        if found is None:
            return []
        x, y = found
        return [f'    <Runner interface={self.drive} x="{x}" y="{y}" />']

    def _value(self, text: str) -> str:
        """A text, or what stands below the key that it names."""
        return self.keys.get(text.strip().removeprefix("$").strip("{}"), text)


def _only(parent: etree._Element, child: etree._Element) -> etree._Element:
    """A control that holds this child alone."""
    alone: etree._Element = parent.makeelement("Sequence")
    alone.append(copy(child))
    return alone


def _guard(parts: list[list[str]]) -> list[str]:
    """The first part, and each other one where the one before fails."""
    first, *rest = (_wrapped("sequential", part) for part in parts)
    return [*first, *(line for part in rest for line in _wrapped("recovery", part))]


def _wrapped(kind: str, lines: list[str]) -> list[str]:
    return [f'<Control type="{kind}">', *lines, "</Control>"] if lines else []
