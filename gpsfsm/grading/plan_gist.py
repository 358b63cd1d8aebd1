"""The gist of an answer that is no plan as it stands: where it is to drive (docs/tasks.md)."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from gpsfsm.grading.gist import (
    GAP,
    LABELS,
    NUMBER,
    Element,
    Kind,
    Part,
    Reader,
    elements_of,
    plain_name,
    plan_lines,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from gpsfsm.tasks.task import Task

_ASKS = re.compile(r"(?i:check|condition)|^(?i:is|has|can)[A-Z_]")
_TELLS = re.compile(r"^(?i:say|speak|log|print|report|notify|announce|set|unset|wait)(?![a-z])")
_FALLBACK = re.compile(r"(?i:(?:reactive|async)?fallback|selector|fallbackstar)")
_DRIVE = "nav2_capabilities/WaypointRunner"
_CONTROLS = {kind.value: kind for kind in (Kind.RECOVERY, Kind.ANY, Kind.ALL)}


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
    start = max(text.rfind("<Plan"), 0)
    whole = elements_of(text[start:], misspelt_ends=True)
    if not whole.children or not whole.children[0].tag.startswith("Plan"):
        return ""
    root = whole.children[0]
    lines = plan_lines(_PlanReader(root, drive).children(root, 0))
    return "".join(f"{line}\n" for line, _ in lines)


class _PlanReader(Reader):
    """Reads elements; ``keys`` is what is said to stand below the keys of a blackboard."""

    def __init__(self, root: Element, drive: str) -> None:
        self.drive = drive
        self.keys: dict[str, str] = {}
        for each in root.descendants():
            if each.tag == "SetBlackboard":
                attributes = each.attributes
                key = attributes.get("output_key") or attributes.get("key") or ""
                self.keys[key] = attributes.get("value", "")

    def part(self, element: Element, depth: int) -> tuple[Part, ...]:
        """A leaf that says where, and neither asks nor tells, is a drive; others are left out."""
        if not element.children:
            return self._leaf(element)
        if _FALLBACK.fullmatch(element.tag):
            return self.alternatives(element, Kind.GUARD, depth)
        kind = _CONTROLS.get(element.attributes.get("type", ""), Kind.SEQUENCE)
        inner = self.children(element, depth + 1)
        return (Part(kind, inner),) if inner else ()

    def _leaf(self, element: Element) -> tuple[Part, ...]:
        if _ASKS.search(element.tag) or _TELLS.match(element.tag):
            return ()
        if "" in element.attributes:  # where its errors are is not known
            return ()
        values = {name: self._value(value) for name, value in element.attributes.items()}
        position = position_of(values, element.text)
        if position is None:
            return ()
        x, y = position
        attributes = (("interface", self.drive), ("x", x), ("y", y))
        return (Part(Kind.DRIVE, attributes=attributes, line=element.line),)

    def _value(self, text: str) -> str:
        """A text, or what stands below the key that it names."""
        return self.keys.get(text.strip().removeprefix("$").strip("{}"), text)


_CALLED = r"(?:[A-Za-z]{1,9}+\s*+[=:]\s*+)?+"
_TWO = rf"{_CALLED}({NUMBER}){GAP}{_CALLED}({NUMBER})"
_MORE = rf"(?:{GAP}{_CALLED}{NUMBER}){{1,6}}+"
_OPEN, _CLOSE = r"[\s(\[{]*+", r"(?:\s*+[;,])?+[\s)\]}]*+"
_PAIR = re.compile(_OPEN + _TWO + _CLOSE)
_LONGER = re.compile(_OPEN + _TWO + _MORE + _CLOSE)
_IN_BRACKETS = re.compile(rf"[(\[{{]\s*+{_TWO}(?:{_MORE})?\s*+[)\]}}]")
_MAX_TEXT = 300

_Position = tuple[str, str]


def position_of(values: Mapping[str, str], text: str = "") -> _Position | None:
    """The two numbers that the attributes of an element say, or else its text, or its labels.

    The numbers are attributes whose names end in x and y; or the whole of one attribute or of the
    text, where more numbers may follow, or stand in brackets in a label. None: there is not exactly
    one such position.

    >>> position_of({"goal_x": "2.0", "goal_y": "-0.5"})
    ('2.0', '-0.5')
    >>> position_of({"goal": "x=2.0, y=-0.5, yaw=0"})
    ('2.0', '-0.5')
    >>> position_of({"ID": "move to (2.0, -0.5)"})
    ('2.0', '-0.5')
    """
    said = {name: value for name, value in values.items() if name not in LABELS}
    labels = [value for name, value in values.items() if name in LABELS]
    for positions_said in (
        _named(said),
        _whole(_PAIR, said.values()),
        _whole(_LONGER, said.values()),
        _whole(_PAIR, [text]),
        _whole(_LONGER, [text]),
    ):
        if positions_said:
            return positions_said[0] if len(positions_said) == 1 else None
    inside = [one.groups() for each in labels for one in _IN_BRACKETS.finditer(each[:_MAX_TEXT])]
    positions = [(x, y) for x, y in dict.fromkeys(inside)]
    return positions[0] if len(positions) == 1 else None


def _named(values: Mapping[str, str]) -> list[_Position]:
    """The values of x and y, of goal_x and goal_y, and so on."""
    positions = []
    for name, value in values.items():
        other = values.get(name[:-1] + {"x": "y", "X": "Y"}.get(name[-1:], "?"))
        if other is not None and _is_number(value) and _is_number(other):
            positions.append((value.strip(), other.strip()))
    return positions


def _is_number(text: str) -> bool:
    return re.fullmatch(NUMBER, text.strip()) is not None


def _whole(kind: re.Pattern[str], texts: Iterable[str]) -> list[_Position]:
    matches = (kind.fullmatch(each) for each in texts if len(each) <= _MAX_TEXT)
    return [(match[1], match[2]) for match in matches if match is not None]
