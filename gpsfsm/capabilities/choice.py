"""Which library a check uses: the built-in one, folders of capability files, or both."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from gpsfsm.capabilities.library import EMPTY, Capabilities, builtin_capabilities

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

__all__ = ["choose_capabilities"]


def choose_capabilities(paths: Sequence[str | Path], *, builtin: bool = True) -> Capabilities:
    """The built-in library, extended by the capability files below ``paths``, or those alone.

    Alone they are taken to be all there is. Raises UsageError for a path that cannot be read or
    holds no capability file; a defective file is among the defects.
    """
    base = builtin_capabilities() if builtin else EMPTY
    if not paths:
        return base
    from gpsfsm.capabilities.load import load_directories  # noqa: PLC0415  (YAML and pydantic)

    loaded = load_directories(paths, known=base.library)
    errors = tuple(defect.told for defect in loaded.defects if defect.severity == "error")
    library = base.library.extended(loaded.library)
    return Capabilities(replace(library, complete=not builtin), errors)
