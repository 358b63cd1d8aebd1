"""How the answers of an experiment are called."""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["Cell", "Key", "model_name"]


class Cell(NamedTuple):
    """What the answers of a cell of the table have in common; keys are ordered by it."""

    system: str
    model: str
    prompt: str
    task: int


class Key(NamedTuple):
    """Which answer it is."""

    cell: Cell
    iteration: int


def model_name(model: str, version: str) -> str:
    """One name for a model and its version, as the folders of answers have it."""
    return f"{model}-{version}" if version not in ("", "n/a") else model
