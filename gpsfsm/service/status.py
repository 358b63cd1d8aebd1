"""How plans stand, in the words and numbers of the original server."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["ENDED", "UNKNOWN", "status_of"]

UNKNOWN = ("UNKNOWN", 0)
ENDED = frozenset(("COMPLETED", "CANCELLED", "REFUSED", "GAVE_UP", "STUCK", "HANG", "ABORT"))
"""Statuses of plans, in the words of gpsfsm, behind which nothing comes."""

_WORDS = {
    "QUEUED": ("QUEUED", 1),
    "RUNNING": ("RUNNING", 12),
    "STOPPING": ("RUNNING", 12),
    "COMPLETED": ("COMPLETED", 13),
    "CANCELLED": ("CANCELLED", 14),
}
_NO_PLAN = "GP1"


def status_of(status: str, findings: Sequence[str] = ()) -> tuple[str, int | None]:
    """The word and the number of the original server for a status of gpsfsm.

    There is no number for how a plan can end that the original leaves running for ever.

    >>> status_of("STUCK")
    ('STUCK', None)
    """
    if status == "REFUSED":
        syntax = any(each.startswith(_NO_PLAN) for each in findings)
        return ("PARSE_FAILED", 3) if syntax else ("VALIDATION_FAILED", 5)
    return _WORDS.get(status, (status, None))
