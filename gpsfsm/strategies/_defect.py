"""What a defect of an answer is, and the way in which its modules list theirs."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from hypothesis.strategies import DrawFn

__all__ = ["Defect", "Stage", "listing"]


class Stage(IntEnum):
    """When a defect is put in: what is wrong with the plan comes first, what is around it last."""

    PLAN = 0
    MARKUP = 1
    AROUND = 2
    INSTEAD = 3


@dataclass(frozen=True, slots=True)
class Defect:
    """One defect: ``told`` says what it is; ``put`` puts it into a text.

    ``put`` gives the text unchanged if it has no place for this defect.
    """

    name: str
    told: str
    stage: Stage
    put: Callable[[DrawFn, str], str]


def listing(stage: Stage) -> tuple[list[Defect], Callable[[Callable[[DrawFn, str], str]], None]]:
    """A list, and a decorator that adds functions to it; names and docstrings say the rest."""
    found: list[Defect] = []

    def add(put: Callable[[DrawFn, str], str]) -> None:
        name = put.__name__.strip("_").replace("_", "-")
        found.append(Defect(name, (put.__doc__ or "").strip(), stage, put))

    return found, add
