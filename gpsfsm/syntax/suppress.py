"""Comments that suppress rules: ``<!-- gpsfsm: ignore GP302 because the dock is optional -->``."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gpsfsm.model.plan import Location

__all__ = ["Suppression", "read_suppression"]

_MARK = re.compile(r"\s*gpsfsm\s*:(.*)", re.DOTALL | re.IGNORECASE)
_IGNORE = re.compile(r"\s*ignore\b\s*(?:\[([^\]]*)\]\s*(.*)|(?!\[)(.*))", re.DOTALL | re.IGNORECASE)
_REASON = re.compile(r"(?:^|\s)because\s|:", re.IGNORECASE)
_RULE = re.compile(r"[A-Za-z][A-Za-z0-9]*(?:-[A-Za-z0-9]+)*")
_MAX_LENGTH = 2000


@dataclass(frozen=True, slots=True)
class Suppression:
    """A suppression comment.

    ``rules`` are codes, names or prefixes as they are written, empty where the comment cannot be
    understood. ``location`` is that of the comment; ``scope`` is the element path of the element
    that follows it, which it covers with everything inside, or "" where no element follows.
    """

    rules: tuple[str, ...]
    reason: str
    location: Location
    scope: str


def read_suppression(body: str) -> tuple[tuple[str, ...], str] | None:
    """The rules and the reason in the words of a comment; None if it is an ordinary comment.

    >>> read_suppression(" gpsfsm: ignore GP302, GP303 because the dock is optional ")
    (('GP302', 'GP303'), 'the dock is optional')
    >>> read_suppression("gpsfsm: ignore[stuck]")
    (('stuck',), '')
    """
    mark = _MARK.match(body[:_MAX_LENGTH])
    if mark is None:
        return None
    match = _IGNORE.match(mark[1])
    if match is None:
        return (), ""
    if match[1] is not None:
        words, reason = match[1], re.sub(r"^(?:because\s|:)", "", match[2].strip())
    else:
        words, _, reason = _split(match[3])
    rules = tuple(words.replace(",", " ").split())
    if not all(_RULE.fullmatch(word) for word in rules):
        return (), ""
    return rules, reason.strip()


def _split(text: str) -> tuple[str, str, str]:
    """The words before the reason, the separator, the reason."""
    found = _REASON.search(text)
    return (text[: found.start()], found[0], text[found.end() :]) if found else (text, "", "")
