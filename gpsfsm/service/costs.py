"""Cost classes: what a request may cost, by what can be seen of it before any work.

Small is what takes less than a second of a core, by a measure of plans of all shapes, and much less
where a gate request is to have its own workers. Behaviour trees count as long as they are with
their SubTrees and loops written out, at most. An estimate may be wrong: whoever works on a small
request has little time for it, and what takes longer is of the next class.
"""

from __future__ import annotations

import json
import math
import re
from enum import StrEnum
from typing import Any

SMALL_BYTES = 24 * 1024
"""A longer body is large, and nobody looks into it."""
GATE_MS, SMALL_MS = 60.0, 1_000.0
"""What requests of these classes are expected to take at most, in milliseconds of a core."""

_BASE_MS, _ELEMENT_MS, _PAIR_MS = 1.0, 0.3, 0.015
_CHARACTERS_MS = 0.0005
_WRITTEN_OUT_MS = 0.1
_LONGEST_ASSUMPTIONS = 500
_FACTORS = {"view": 3.0, "fix": 4.0, "grade": 3.0}
"""By endpoint; one that is not here checks once."""
_ENGINE, _FAULTS, _Z3, _OTHERS = 40.0, 12.0, 6.0, 5.0
_PAPER = "paper"
_ROUNDS = re.compile(r"""num_(?:attempts|cycles)(?:\s*=\s*["']\s*([0-9]{1,6})\s*["'])?""")
"""How often a loop runs what is in it; an empty group is no plain number."""
_MOST_SUBTREES = 99


class Kind(StrEnum):
    """A cost class: a small gate request, another small request, a large one."""

    GATE = "gate"
    SMALL = "small"
    LARGE = "large"


def kind_of(op: str, cost_ms: float, *, strictness: float = 1.0) -> Kind:
    """The class of a request that is expected to take so long; some clients are judged strictly.

    Not in what is cheap enough for the gate: many honest clients may share the name of a bad one,
    and what such a request may take is bound anyway.
    """
    if op == "gate" and cost_ms <= GATE_MS:
        return Kind.GATE
    return Kind.SMALL if cost_ms <= max(SMALL_MS / strictness, GATE_MS) else Kind.LARGE


def expected_ms(op: str, body: bytes, *, raw: bool) -> float:
    """The milliseconds that a request is expected to take, infinity for what is not looked into.

    >>> expected_ms("gate", b"<Plan><Runner/></Plan>", raw=True) < GATE_MS
    True
    """
    if len(body) > SMALL_BYTES:
        return math.inf
    if raw:
        plan = body.decode("latin-1").replace("\0", "")  # also of UTF-16
        return _BASE_MS + _plan_ms(plan, trees=op != "gate")
    try:
        request = json.loads(body)
    except (ValueError, RecursionError):
        return _BASE_MS  # a worker says what is wrong with it
    if not isinstance(request, dict):
        return _BASE_MS
    texts = [text for name in ("plan", "other") if isinstance(text := request.get(name), str)]
    trees = op != "gate" or bool(request.get("trees"))
    alone = sum(_plan_ms(text, trees=trees) for text in texts)
    factor = _FACTORS.get(op, 1.0) * _factor(request)
    return _BASE_MS + max(alone, _CHARACTERS_MS) * factor  # 0 * infinity is no number


def _plan_ms(text: str, *, trees: bool) -> float:
    """Measured: default options, twice as many runners take up to four times as long."""
    elements = text.count("<")
    further = max(1, elements) * (_times(text) - 1) if trees else 0.0
    own_ms = elements * (_ELEMENT_MS + _PAIR_MS * elements) + len(text) * _CHARACTERS_MS
    return own_ms + further * _WRITTEN_OUT_MS


def _times(text: str) -> float:
    """The greatest number of copies of an element of behaviour trees that are written out.

    However so many SubTrees are put into each other, that makes no more than 3 ** (count / 3) uses
    of one; loops multiply. A loop whose rounds are not written as a plain number may have any.
    """
    times: float = 3.0 ** (min(text.count("<SubTree"), _MOST_SUBTREES) / 3)
    rounds = _ROUNDS.findall(text)
    if rounds and ("" in rounds or "&#" in text):
        return math.inf
    for each in rounds:
        times *= max(1, int(each))
    return times


def _factor(request: dict[str, Any]) -> float:
    """The factor by which the options of this request make it take longer."""
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
