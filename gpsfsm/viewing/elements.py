"""The elements of a plan as rows of the view document."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.model.labels import parameters_label
from gpsfsm.model.plan import Kind
from gpsfsm.model.printable import clip
from gpsfsm.viewing.ends import last_lines

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from gpsfsm.model.plan import Element, Plan

__all__ = ["element_rows"]

_MAX_NAME = 120
_MAX_DETAIL = 160
_MAX_VALUE = 80
_MAX_PARAMETERS = 8


def element_rows(plan: Plan, text: str, unreachable: Collection[str]) -> list[dict[str, Any]]:
    """One row per element; ``unreachable`` are the element paths of runners that never run."""
    paths = [plan.path(element) for element in plan.elements]
    reached = _reached(plan.elements, [path not in unreachable for path in paths])
    ends = last_lines(plan.elements, text)
    return [
        _row(element, path, end, reached=reachable)
        for element, path, end, reachable in zip(plan.elements, paths, ends, reached, strict=True)
    ]


def _reached(elements: Sequence[Element], runs: list[bool]) -> list[bool]:
    """Whether a run gets there; of a control: whether any runner in it runs, if it has one."""
    holds_runner = [element.kind is Kind.RUNNER for element in elements]
    reached = [holds and run for holds, run in zip(holds_runner, runs, strict=True)]
    for element in reversed(elements):
        if element.parent >= 0:
            reached[element.parent] |= reached[element.index]
            holds_runner[element.parent] |= holds_runner[element.index]
    return [found or not holds for found, holds in zip(reached, holds_runner, strict=True)]


def _row(element: Element, path: str, end: int, *, reached: bool) -> dict[str, Any]:
    runner = element.kind is Kind.RUNNER
    return {
        "path": path,
        "kind": element.kind.value.lower(),
        "type": element.tag if runner else element.words,
        "label": _label(element),
        "name": clip(element.text("name") or "", _MAX_NAME),
        "detail": _detail(element) if runner else "",
        "line": element.line,
        "column": element.column,
        "endLine": end,
        "parent": element.parent,
        "reachable": reached,
    }


def _label(element: Element) -> str:
    if element.kind is Kind.RUNNER:
        name = element.interface.rpartition("/")[2] or element.interface
        if element.tag and not name:  # a node of a tree that could not be unfolded
            name = element.text("ID") or element.tag
        return clip(name, _MAX_NAME) or "(no interface)"
    if element.kind is Kind.PLAN:
        return clip(element.tag, _MAX_NAME) or "plan"
    return clip(element.words, _MAX_NAME) or "control"


def _detail(element: Element) -> str:
    """What the runner is given, as it is written."""
    return clip(", ".join(parameters_label(element, _MAX_VALUE, _MAX_PARAMETERS)), _MAX_DETAIL)
