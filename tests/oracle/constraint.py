"""Constraints between outcomes: callable on a scenario, and printable as an assumption."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from collections.abc import Mapping

_MEANING = {
    "succeeds": ("SUCCEEDED",),
    "fails": ("FAILED", "NO_START"),  # it emits FAILED
    "hangs": ("HANG",),
    "does not start": ("NO_START",),
}


@dataclass(frozen=True, slots=True)
class Says:
    """``/Plan/Runner[1] fails``."""

    path: str
    verb: Literal["succeeds", "fails", "hangs", "does not start"]

    def __call__(self, scenario: Mapping[str, str]) -> bool:
        return scenario[self.path] in _MEANING[self.verb]

    def __str__(self) -> str:
        return f"{self.path} {self.verb}"


@dataclass(frozen=True, slots=True)
class Not:
    part: Constraint

    def __call__(self, scenario: Mapping[str, str]) -> bool:
        return not self.part(scenario)

    def __str__(self) -> str:
        return f"not ({self.part})"


@dataclass(frozen=True, slots=True)
class Both:
    left: Constraint
    right: Constraint

    def __call__(self, scenario: Mapping[str, str]) -> bool:
        return self.left(scenario) and self.right(scenario)

    def __str__(self) -> str:
        return f"({self.left}) and ({self.right})"


@dataclass(frozen=True, slots=True)
class Either:
    left: Constraint
    right: Constraint

    def __call__(self, scenario: Mapping[str, str]) -> bool:
        return self.left(scenario) or self.right(scenario)

    def __str__(self) -> str:
        return f"({self.left}) or ({self.right})"


@dataclass(frozen=True, slots=True)
class Implies:
    left: Constraint
    right: Constraint

    def __call__(self, scenario: Mapping[str, str]) -> bool:
        return not self.left(scenario) or self.right(scenario)

    def __str__(self) -> str:
        return f"({self.left}) implies ({self.right})"


Constraint = Says | Not | Both | Either | Implies
