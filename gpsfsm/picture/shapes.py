"""Boxes, and how large nodes and captions are drawn."""

from __future__ import annotations

import math
import unicodedata
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.labels import control_label, node_label

if TYPE_CHECKING:
    from gpsfsm.model.automaton import Automaton, Node
    from gpsfsm.model.plan import Element

LINE = 15.0
"""The height of a line of a label."""
JOIN = 34.0
"""The diameter of a join."""
_WIDEST = 210.0
_WIDEST_CAPTION = 360.0
_STEP = 20.0
_LEAST_WIDTH = 100.0
_PADDING = 10.0
_BOLD = 1.13
_SMALL = 0.85
_PLAIN = 7.3
_NARROW = 4.2
_WIDE = 12.5
_BROAD = {"=": 10.1, "+": 10.1, "…": 12.0, "m": 11.7, "w": 9.9, "M": 10.4, "W": 11.9, "@": 12.0}
"""Characters of Latin text that are wider than most."""


class Box(NamedTuple):
    """A rectangle; ``y`` grows downwards."""

    x: float
    y: float
    width: float
    height: float

    @property
    def right(self) -> float:
        """The x of its right side."""
        return self.x + self.width

    @property
    def bottom(self) -> float:
        """The y of its lower side."""
        return self.y + self.height

    @property
    def middle(self) -> tuple[float, float]:
        """Its centre."""
        return self.x + self.width / 2, self.y + self.height / 2


@lru_cache(maxsize=4096)
def text_width(text: str) -> float:
    """About how wide a text is in 12 px; fonts differ, so that this is rather too much."""
    return sum(map(_width, text))


@lru_cache(maxsize=4096)
def _width(character: str) -> float:
    if character in "ijl.,:;'|!()[]/ tfrI":
        return _NARROW
    if character in _BROAD:
        return _BROAD[character]
    slim = character.isascii() or unicodedata.east_asian_width(character) not in ("W", "F")
    return _PLAIN if slim else _WIDE


def shorten(text: str, most: float) -> str:
    """The beginning of a text, at most so wide."""
    if text_width(text) <= most:
        return text
    width = _width("…")
    for place, character in enumerate(text):
        width += _width(character)
        if width > most:
            return text[:place].rstrip(" ,…") + "…"
    return text


def node_lines(automaton: Automaton, node: Node) -> tuple[str, ...]:
    """The lines that are written into a node."""
    return tuple(shorten(line, _WIDEST) for line in node_label(automaton, node))


def caption(element: Element) -> str:
    """The caption above a control."""
    return shorten(control_label(element), _WIDEST_CAPTION)


def node_size(automaton: Automaton, node: Node) -> tuple[float, float]:
    """Width and height of a node; widths come in steps, so that columns look even."""
    lines = node_lines(automaton, node)
    widest = max(map(text_width, lines))
    if node.kind is NodeKind.JOIN:
        side = max(JOIN, widest * _SMALL + 10, LINE * _SMALL * len(lines) + 18)
        return 2.0 * math.ceil(side / 2), 2.0 * math.ceil(side / 2)
    width = max(widest, text_width(lines[0]) * _BOLD) + 2 * _PADDING
    if node.kind is NodeKind.RUNNER:
        width = max(_LEAST_WIDTH, _STEP * -(-width // _STEP))
    return 2.0 * math.ceil(width / 2), LINE * len(lines) + _PADDING
