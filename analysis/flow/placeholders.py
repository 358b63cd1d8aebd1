"""Placeholders in the text of attributes: ``$name``, ``${a.b}``, ``{name}``, ``&name``, ``<name>``.

Nothing is ever put in their place. What they name tells which value the author hoped for.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

__all__ = ["Placeholder", "placeholder"]

# Every quantifier is possessive or bounded: no text makes these slower than linear.
_WORD = r"[^\W\d]\w*+"
_PATH = rf"{_WORD}(?:(?:::|[./:-])\w++|\[\w*+\])*+"
_BRACED = rf"\$\{{\s*+(?P<braced>{_PATH})\s*+\}}"
_CURLY = rf"\{{\{{?+\s*+(?P<curly>{_PATH})\s*+\}}\}}?+"

_WHOLE = re.compile(
    rf"\$(?P<dollar>{_PATH})|&(?P<reference>{_PATH})|{_BRACED}|{_CURLY}"
    rf"|<(?P<angle>{_PATH}(?:[ ]{_PATH}){{0,5}}+)>"
)
_SURE = re.compile(rf"{_BRACED}(?!\$(?!\{{))")
# In longer text $name and {name} may be something else, above all a formula.
_DOLLAR = re.compile(rf"(?<![\w$\\])\$(?P<dollar>{_WORD}(?:[./]\w++)*+)")
_CURLY_INSIDE = re.compile(rf"(?<![{{}}$^\])])(?<!\b[^\W\d]_){_CURLY}(?![{{}}])")
_FORMULA = re.compile(r"\$(?=[^\s$])[^$]{1,200}+(?<=\S)\$(?![\w{])")
_SEPARATOR = re.compile(r"[./:\-]|\[\w*\]")
_MAX_NAMES = 20


@dataclass(frozen=True, slots=True)
class Placeholder:
    """A placeholder: ``text`` as it is written (the first one), ``whole`` if it is all there is.

    ``names`` are the values that all placeholders of the text ask for: the last part of each path.
    ``certain`` is false where the text might mean something else: ``$name`` and ``{name}`` inside
    longer text.
    """

    text: str
    whole: bool
    names: tuple[str, ...]
    certain: bool


def placeholder(text: str) -> Placeholder | None:
    """The placeholder in the text of an attribute, None if there is none.

    >>> placeholder("${prompt_capabilities/PromptSpeechRunner.text}").names
    ('text',)
    >>> placeholder("It costs $5.") is placeholder('{"a": 1}') is None
    True
    """
    if not any(mark in text for mark in "${&<"):
        return None
    found = _WHOLE.fullmatch(text.strip())
    if found is not None:
        return Placeholder(found[0], True, _names([found]), True)
    sure = list(_SURE.finditer(text))
    guessed = list(_guessed(text))
    if not sure and not guessed:
        return None
    every = sorted([*sure, *guessed], key=re.Match.start)
    first = sure[0] if sure else every[0]
    return Placeholder(first[0], False, _names(every), bool(sure))


def _guessed(text: str) -> Iterator[re.Match[str]]:
    """What looks like a placeholder in longer text."""
    if "$" in text and _FORMULA.search(text) is None:
        yield from _DOLLAR.finditer(text)
    if "{" in text and "\\" not in text and "^{" not in text:
        yield from _CURLY_INSIDE.finditer(text)


def _names(found: Iterable[re.Match[str]]) -> tuple[str, ...]:
    """The last part of each path, each once, in order; what is no identifier names nothing."""
    names: dict[str, None] = {}
    for match in found:
        parts = [part for part in _SEPARATOR.split(match[match.lastgroup or 0]) if part]
        if parts and parts[-1].isidentifier():
            names[parts[-1]] = None
        if len(names) >= _MAX_NAMES:
            break
    return tuple(names)
