"""What a model thinks aloud is no part of its answer."""

from __future__ import annotations

import re

__all__ = ["without_thoughts"]

_OPEN = re.compile(r"\s*<(think|thinking|reasoning)>", re.IGNORECASE)
_CLOSE = re.compile(r"</(?:think|thinking|reasoning)>", re.IGNORECASE)
_PLAN = re.compile(r"<\s*Plan\b", re.IGNORECASE)


def without_thoughts(text: str) -> str:
    """The answer without what was thought aloud before it.

    Some templates open the thoughts in the prompt, so that the answer has only their end.

    >>> without_thoughts("<think>A plan with <Plan>?</think><Plan/>")
    '<Plan/>'
    >>> without_thoughts("First I go.</think> <Plan/>")
    '<Plan/>'
    """
    start = 0
    while opened := _OPEN.match(text, start):
        closed = re.compile(f"</{opened[1]}>", re.IGNORECASE).search(text, opened.end())
        if closed is None:
            return ""
        start = closed.end()
    stray = _CLOSE.search(text, start)
    plan = _PLAN.search(text, start)
    if stray is not None and (plan is None or stray.start() < plan.start()):
        start = stray.end()
    return text[start:].lstrip() if start else text
