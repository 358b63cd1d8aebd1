"""Judges in several processes, each with a copy of the repository of its own."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

from tests.mutants.runner import Judge, copied

if TYPE_CHECKING:
    from tests.mutants.operators import Mutant

__all__ = ["judged", "start"]

_JUDGES: list[Judge] = []
"""The judge of this process."""


def start(folder: str) -> None:
    """Begin a process: make its copy below a folder."""
    _JUDGES.append(Judge(copied(Path(tempfile.mkdtemp(dir=folder)))))


def judged(code: str, mutant: Mutant, until: float) -> tuple[Mutant, str, float]:
    """A mutant, what became of it, and the seconds; nothing after the time ``until``."""
    began = time.time()
    result = _JUDGES[0].judge(mutant, code) if began < until else ""
    return mutant, result, time.time() - began
