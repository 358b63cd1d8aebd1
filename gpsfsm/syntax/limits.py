"""Limits that keep hostile or broken input cheap."""

from __future__ import annotations

from dataclasses import dataclass, fields

from gpsfsm.errors import UsageError

__all__ = ["DEFAULT_LIMITS", "Limits"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What the front end reads at most; beyond it the plan is not read and GP103 says so.

    ``max_attributes`` counts per element, ``max_attribute_length`` is in code points of the
    source, ``max_problems`` is the number of problems that are listed per rule.

    >>> Limits(max_depth=5).max_elements
    250000
    """

    max_bytes: int = 64 * 1024 * 1024
    max_depth: int = 200
    max_elements: int = 250_000
    max_attributes: int = 200
    max_attribute_length: int = 65_536
    max_problems: int = 100

    def __post_init__(self) -> None:
        """Refuse limits that would refuse every plan."""
        for field in fields(self):
            if getattr(self, field.name) < 1:
                raise UsageError(f"the limit {field.name} must be at least 1")

    @property
    def max_markup(self) -> int:
        """The number of tags, comments and texts: bounds what the limit on elements does not."""
        return 4 * self.max_elements + 1000


DEFAULT_LIMITS = Limits()
