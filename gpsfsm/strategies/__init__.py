"""Hypothesis strategies, for property tests of your own (docs/fuzzing.md).

They need hypothesis (``pip install 'gpsfsm[fuzz]'``), which is imported when the first of them is
used. All of them shrink: to few runners, no controls, no faults, no defects.

>>> from hypothesis import find, settings
>>> from gpsfsm.strategies import plans
>>> smallest = find(plans(), lambda text: "<Control" not in text, settings=settings(database=None))
>>> smallest.count("<Runner ")
1
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import installing

if TYPE_CHECKING:
    from gpsfsm.strategies._answers import DEFECTS, Answer, answers
    from gpsfsm.strategies._plans import controls, forests, plans, runners
    from gpsfsm.strategies._runs import scenarios, worlds

__all__ = [
    "DEFECTS",
    "Answer",
    "answers",
    "controls",
    "forests",
    "plans",
    "runners",
    "scenarios",
    "worlds",
]

_PLACES = {
    "DEFECTS": "_answers",
    "Answer": "_answers",
    "answers": "_answers",
    "controls": "_plans",
    "forests": "_plans",
    "plans": "_plans",
    "runners": "_plans",
    "scenarios": "_runs",
    "worlds": "_runs",
}


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    try:
        return getattr(importlib.import_module(f"{__name__}.{_PLACES[name]}"), name)
    except ModuleNotFoundError as error:
        if error.name != "hypothesis":
            raise
        raise ImportError(
            f"{__name__}.{name} needs hypothesis, which is not installed: {installing('fuzz')}"
        ) from error


def __dir__() -> list[str]:
    return sorted(__all__)
