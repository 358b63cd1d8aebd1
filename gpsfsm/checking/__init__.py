"""Checking plans: inputs and settings, the check of one plan and of many, and what is shown.

The names below are loaded when they are first used: they bring the analyses with them, which
readers of inputs do without.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gpsfsm.checking.check import (
        CheckOptions,
        check_graph,
        check_in_time,
        check_input,
        check_text,
        failed,
        undecided,
        unreadable,
    )

__all__ = [
    "CheckOptions",
    "check_graph",
    "check_in_time",
    "check_input",
    "check_text",
    "failed",
    "undecided",
    "unreadable",
]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'gpsfsm.checking' has no attribute '{name}'")
    return getattr(importlib.import_module("gpsfsm.checking.check"), name)
