"""Reading parameters: what a plan writes may be of another type than a runner needs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from gpsfsm.execution.runner import RunnerError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.execution.records import RunValue

__all__ = ["number", "text"]


def text(parameters: Mapping[str, RunValue], name: str, default: str | None = None) -> str:
    """A text; a number or a Boolean as a plan writes it. Raises RunnerError if it is missing."""
    value = parameters.get(name, default)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str | int | float):
        return str(value)
    raise RunnerError(f"{name!r} is missing" if value is None else f"{name!r} is no text")


def number(parameters: Mapping[str, RunValue], name: str, default: float | None = None) -> float:
    """A finite number. Raises RunnerError if it is missing or none."""
    value = parameters.get(name, default)
    if value is None:
        raise RunnerError(f"{name!r} is missing")
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise RunnerError(f"{name!r} is {value!r:.80} and has to be a number")
    return float(value)
