"""Finding strings without ever searching the same text in vain twice."""

from __future__ import annotations

__all__ = ["Finder"]


class Finder:
    """``str.find`` with a memory: what is absent from some offset on is not searched again.

    Without it a text of a million unclosed quotes would be searched to its end a million times.
    """

    def __init__(self, text: str) -> None:
        self._text = text
        self._absent: dict[str, int] = {}

    def find(self, needle: str, start: int) -> int:
        """The first offset of ``needle`` from ``start`` on, or -1."""
        absent = self._absent.get(needle)
        if absent is not None and start >= absent:
            return -1
        found = self._text.find(needle, start)
        if found < 0:
            self._absent[needle] = start
        return found
