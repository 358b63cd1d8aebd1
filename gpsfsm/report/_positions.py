"""Where the elements of a plan text are: scenarios name elements by path, viewers want lines."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gpsfsm.model.finding import Finding

__all__ = ["element_lines"]

_TAG = re.compile(
    r"<!--.*?-->"
    r"|<(?P<end>/?)(?P<name>Plan|Control|Runner)(?![\w.:-])"
    r"(?:[^<>\"']|\"[^\"]*\"|'[^']*')*?(?P<empty>/?)>",
    re.DOTALL,
)


def element_lines(source: str, findings: tuple[Finding, ...]) -> dict[str, int]:
    """Element path → line of its start tag, for the last plan in ``source``.

    Findings say where some elements are. If the text disagrees with one of them it is not read
    as the front end reads it, and then nothing is better than a wrong line: the answer is empty.
    """
    lines = _scan(source)
    for finding in findings:
        known = finding.location
        # Front end findings may point into a tag that spans several lines; those of analyses not.
        if known.line < lines.get(known.element, 0):
            return {}
    return lines


def _scan(source: str) -> dict[str, int]:
    lines: dict[str, int] = {}
    stack: list[tuple[str, dict[str, int]]] = []  # path and children counted by name
    line, counted_to = 1, 0
    for tag in _TAG.finditer(source):
        name = tag["name"]
        if name is None:
            continue
        if tag["end"]:
            if stack:
                stack.pop()
            continue
        line += _line_ends(source, counted_to, tag.start())
        counted_to = tag.start()
        if name == "Plan":
            lines, stack = {}, []
            path = "/Plan"
        elif stack:
            parent, counts = stack[-1]
            counts[name] = counts.get(name, 0) + 1
            path = f"{parent}/{name}[{counts[name]}]"
        else:
            continue
        lines[path] = line
        if not tag["empty"]:
            stack.append((path, {}))
    return lines


def _line_ends(source: str, start: int, end: int) -> int:
    r"""Line ends between two offsets: ``\n``, ``\r\n`` or ``\r``."""
    feeds = source.count("\n", start, end)
    returns = source.count("\r", start, end)
    return feeds + returns - source.count("\r\n", start, end)
