"""How long to wait before a request is sent again."""

from __future__ import annotations

import hashlib
import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["asked_to_wait_s", "pause_s"]

_FIRST_S = 0.5
_LONGEST_S = 30.0


def asked_to_wait_s(headers: Mapping[str, str], now_s: float) -> float | None:
    """How long the server asks to wait, in seconds or until a date; None if it does not say.

    ``now_s`` is the time of day in seconds since 1970. What makes no sense counts as not said.
    """
    for name, unit_s in (("retry-after-ms", 0.001), ("retry-after", 1.0)):
        text = headers.get(name, "").strip()[:100]
        if not text:
            continue
        try:
            found = float(text) * unit_s
        except ValueError:
            found = _until(text, now_s) if unit_s == 1.0 else math.nan
        if math.isfinite(found) and found >= 0:
            return found
    return None


def pause_s(attempt: int, *, asked_s: float | None, longest_s: float, seed: bytes) -> float:
    """How long to wait after a number of attempts, from 1.

    What the server asks for counts, up to ``longest_s``. Otherwise the pause doubles each time,
    less up to a half that ``seed`` decides: so many robots do not come back at the same moment, and
    the same request waits as long each time.
    """
    if asked_s is not None:
        return min(asked_s, longest_s)
    digest = hashlib.sha256(seed + attempt.to_bytes(4, "big")).digest()
    part = 0.5 + int.from_bytes(digest[:4], "big") / 2**33
    full = min(_FIRST_S * 2.0 ** min(attempt, 30), _LONGEST_S)
    return min(full * part, longest_s)


def _until(text: str, now_s: float) -> float:
    """Seconds up to an HTTP date, 0 for one that is over; NaN for what is no date."""
    from email.utils import parsedate_to_datetime  # noqa: PLC0415  (hardly ever needed)

    try:
        return max(0.0, parsedate_to_datetime(text).timestamp() - now_s)
    except (ValueError, OverflowError, OSError, TypeError):
        return math.nan
