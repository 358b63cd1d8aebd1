"""Cost classes: what a request may cost, by what can be seen of it before any work.

Small is what takes less than a second of a core, by a measure of plans of all shapes, and much less
where a gate request is to have its own workers. An estimate may be wrong: whoever works on a small
request has little time for it, and what takes longer is of the next class.
"""

from __future__ import annotations

import json
import math
from enum import StrEnum
from typing import Any

__all__ = ["GATE_MS", "SMALL_BYTES", "SMALL_MS", "TINY_MS", "Kind", "expected_ms", "kind_of"]

SMALL_BYTES = 24 * 1024
"""A longer body is large, and nobody looks into it."""
GATE_MS, SMALL_MS = 60.0, 1_000.0
"""What requests of these classes are expected to take at most, in milliseconds of a core."""
TINY_MS = 10.0
"""What is expected to take less than this is small whoever sends it."""

_BASE_MS, _ELEMENT_MS, _PAIR_MS = 1.0, 0.3, 0.015
_CHARACTERS_MS = 0.0005
_LONGEST_ASSUMPTIONS = 500
_FACTORS = {"view": 3.0, "fix": 4.0, "grade": 3.0}
"""By endpoint; one that is not here checks once."""
_ENGINE, _FAULTS, _Z3, _OTHERS = 40.0, 12.0, 6.0, 5.0
_PAPER = "paper"


class Kind(StrEnum):
    """A cost class: a small gate request, another small request, a large one."""

    GATE = "gate"
    SMALL = "small"
    LARGE = "large"


def kind_of(op: str, cost_ms: float, *, strictness: float = 1.0) -> Kind:
    """The class of a request that is expected to take so long; some clients are judged strictly."""
    if op == "gate" and cost_ms <= max(GATE_MS / strictness, TINY_MS):
        return Kind.GATE
    return Kind.SMALL if cost_ms <= max(SMALL_MS / strictness, TINY_MS) else Kind.LARGE


def expected_ms(op: str, body: bytes, *, raw: bool) -> float:
    """What a request is expected to take, infinity for what is not looked into.

    >>> expected_ms("gate", b"<Plan><Runner/></Plan>", raw=True) < TINY_MS
    True
    """
    if len(body) > SMALL_BYTES:
        return math.inf
    if raw:
        return _BASE_MS + _plan_ms(body.count(b"<"), len(body))
    try:
        request = json.loads(body)
    except (ValueError, RecursionError):
        return _BASE_MS  # a worker says what is wrong with it
    if not isinstance(request, dict):
        return _BASE_MS
    texts = [text for name in ("plan", "other") if isinstance(text := request.get(name), str)]
    alone = sum(_plan_ms(text.count("<"), len(text)) for text in texts)
    factor = _FACTORS.get(op, 1.0) * _factor(request)
    return _BASE_MS + alone * factor


def _plan_ms(elements: int, characters: int) -> float:
    """Measured: default options, twice as many runners take up to four times as long."""
    return elements * (_ELEMENT_MS + _PAIR_MS * elements) + characters * _CHARACTERS_MS


def _factor(request: dict[str, Any]) -> float:
    """How many times longer it takes with the options of this request."""
    options = request.get("options")
    if not isinstance(options, dict):
        options = {}
    factors = [1.0]
    if options.get("engine", _PAPER) != _PAPER:
        factors.append(_ENGINE)
    if options.get("faults"):
        factors.append(_FAULTS)
    if options.get("solver") == "z3":
        factors.append(_Z3)
    slow = ("consistent", "assume", "from_response", "deadline_s", "energy_limit_j")
    if any(options.get(name) for name in slow) or request.get("trees"):
        factors.append(_OTHERS)
    if len(str(options.get("assume", ""))) > _LONGEST_ASSUMPTIONS:
        factors.append(math.inf)
    task = request.get("task")
    if task:
        factors.append(_OTHERS + len(str(task)) / 200)
    return max(factors)
