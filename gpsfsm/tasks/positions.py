"""Where an element of an answer says to drive, however it writes two numbers (docs/tasks.md)."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

__all__ = ["position_of"]

_NUMBER = r"[-+]?+(?:[0-9]++\.?+[0-9]*+|\.[0-9]++)"
_GAP = r"(?:\s*+[;,]\s*+|\s++)"  # possessive, as the rest: linear on any text
_CALLED = r"(?:[A-Za-z]{1,9}+\s*+[=:]\s*+)?+"
_TWO = rf"{_CALLED}({_NUMBER}){_GAP}{_CALLED}({_NUMBER})"
_MORE = rf"(?:{_GAP}{_CALLED}{_NUMBER}){{1,6}}+"
_OPEN, _CLOSE = r"[\s(\[{]*+", r"(?:\s*+[;,])?+[\s)\]}]*+"
_PAIR = re.compile(_OPEN + _TWO + _CLOSE)
_LONGER = re.compile(_OPEN + _TWO + _MORE + _CLOSE)
_IN_BRACKETS = re.compile(rf"[(\[{{]\s*+{_TWO}(?:{_MORE})?\s*+[)\]}}]")
_LABELS = ("name", "ID")
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
    said = {name: value for name, value in values.items() if name not in _LABELS}
    labels = [value for name, value in values.items() if name in _LABELS]
    for found in (
        _named(said),
        _whole(_PAIR, said.values()),
        _whole(_LONGER, said.values()),
        _whole(_PAIR, [text]),
        _whole(_LONGER, [text]),
    ):
        if found:
            return found[0] if len(found) == 1 else None
    inside = [one.groups() for each in labels for one in _IN_BRACKETS.finditer(each[:_MAX_TEXT])]
    positions = [(x, y) for x, y in dict.fromkeys(inside)]
    return positions[0] if len(positions) == 1 else None


def _named(values: Mapping[str, str]) -> list[_Position]:
    """The values of x and y, of goal_x and goal_y, and so on."""
    found = []
    for name, value in values.items():
        other = values.get(name[:-1] + {"x": "y", "X": "Y"}.get(name[-1:], "?"))
        if other is not None and _is_number(value) and _is_number(other):
            found.append((value.strip(), other.strip()))
    return found


def _is_number(text: str) -> bool:
    return re.fullmatch(_NUMBER, text.strip()) is not None


def _whole(kind: re.Pattern[str], texts: Iterable[str]) -> list[_Position]:
    matches = (kind.fullmatch(each) for each in texts if len(each) <= _MAX_TEXT)
    return [(match[1], match[2]) for match in matches if match is not None]
