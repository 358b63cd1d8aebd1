"""Runners that prompt a language model (docs/runners.md); without one they are refused."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gpsfsm.runners.prompting.real import (
        PromptCapabilityRunner,
        PromptOccupancyRunner,
        PromptPlanRunner,
        PromptPoseRunner,
        PromptSpeechRunner,
        PromptTextRunner,
    )

__all__ = [
    "PromptCapabilityRunner",
    "PromptOccupancyRunner",
    "PromptPlanRunner",
    "PromptPoseRunner",
    "PromptSpeechRunner",
    "PromptTextRunner",
]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.real"), name)
