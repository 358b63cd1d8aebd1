"""How many random cases a test takes: one of four, or all of them with CASES=all.

A suite that everybody runs after every change has to be over in minutes. What compares thousands
of random plans with brute force, or random trees with the real engine, begins with the same cases
every time, and CI goes on to the last of them: make test CASES=all.
"""

from __future__ import annotations

import os

__all__ = ["ALL", "batches", "many"]

_CASES = os.environ.get("CASES") or "few"
if _CASES not in ("few", "all"):
    raise SystemExit(f"CASES={_CASES}: it is 'few' or 'all'")

ALL = _CASES == "all"
"""True if no test stops before its last case."""


def many(cases: int) -> int:
    """The number of random cases of a test that has so many in all: five at least."""
    return cases if ALL else max(min(cases, 5), cases // 4)


def batches(number: int) -> range:
    """The batches of random cases that are taken, of so many in all: one at least."""
    return range(number if ALL else max(1, number // 4))
