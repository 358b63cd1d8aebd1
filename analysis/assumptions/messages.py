"""What is said about a wrong assumption: what is wrong, where, and what to write instead."""

from __future__ import annotations

import re
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any, cast

from gpsfsm.errors import AssumptionError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from lark.exceptions import UnexpectedInput

__all__ = ["Mistake", "empty", "error_at", "listed", "short", "syntax_error", "too_long"]

_EXAMPLE = "for example: line 7 fails implies line 9 succeeds"
_EXAMPLES = {
    "never": "for example: never fails: SpeechRunner",
    "always": "for example: always succeeds: line 7",
    "same": "for example: same: WaypointRunner(x=1, y=2)",
    "if": "for example: if line 7 fails then line 9 succeeds",
    "at": "for example: at most 1 of (line 7 fails, line 9 fails)",
    "exactly": "for example: exactly one of (line 7, line 9) fails",
}
# Terminals of the grammar → what to call them; the minor ones only if nothing else may come.
_EXPECTED = {
    "NOT": "a claim such as 'line 7 fails'",
    "LINE": "what to select, such as 'line 7', '/Plan/Runner[2]' or 'SpeechRunner'",
    "VERB": "what happens ('succeeds', 'fails', 'hangs' or 'does not start')",
    "_THEN": "'then'",
    "_IFF": "a word such as 'and' or 'implies'",
    "PLACE": "a line number such as 7 or 7:12",
    "NUMBER": "a number",
    "PARAMETER": "a parameter such as x=1.0",
    "VALUE": "a value",
    "EQUAL": "'='",
    "COMMA": "','",
    "RPAR": "')'",
    "$END": "the end",
}
_MINOR = {"COLON": "':'", "STRING": "a name"}
_WORDS = {
    "VERB": ("succeeds", "fails", "hangs", "starts", "succeed", "fail", "hang", "start"),
    "EVER": ("never", "always"),
    "AGREE": ("agree",),
    "_IMPLIES": ("implies",),
    "_IFF": ("iff",),
    "_AND": ("and",),
    "_THEN": ("then",),
}
_FOUND = re.compile(r"[\w*?./-]+|\S")


class Mistake(Exception):  # noqa: N818  (never leaves this package)
    """Something wrong at an offset of the text; ``hint`` says what to write instead."""

    def __init__(self, at: int, message: str, *, hint: str = "") -> None:
        super().__init__(message)
        self.at = at
        self.message = _shown(message)
        self.hint = _shown(hint)


def too_long(most: int) -> AssumptionError:
    """An assumption has more than ``most`` characters."""
    return AssumptionError(f"an assumption has at most {most} characters")


def empty() -> AssumptionError:
    """An assumption is blank."""
    message = "the assumption is empty"
    return AssumptionError(f"{message}\n{_EXAMPLE}", summary=message, hint=_EXAMPLE)


def error_at(text: str, mistake: Mistake) -> AssumptionError:
    """The error for a mistake in ``text``."""
    said = f"{mistake.message}; {mistake.hint}" if mistake.hint else mistake.message
    return AssumptionError(
        _excerpt(text, mistake.at, said),
        summary=_summary(text, mistake.at, mistake.message),
        hint=mistake.hint,
    )


def syntax_error(text: str, error: UnexpectedInput) -> AssumptionError:
    """The error for a text that violates the grammar."""
    at: int = cast("Any", error).pos_in_stream
    token = getattr(error, "token", None)
    if token is not None and token.type == "$END":
        at = len(text.rstrip())
    found = _FOUND.search(text, at)
    if found and found[0] in "\"'":
        return error_at(text, Mistake(at, "this quote is never closed"))
    expected: set[str] = cast("Any", error).interactive_parser.accepts()
    got = f"'{_shown(found[0][:40])}'" if found else "the end"
    message = f"expected {_expectation(expected)}, found {got}"
    words = [word for name, some in _WORDS.items() if name in expected for word in some]
    close = get_close_matches(found[0].lower(), words, n=1) if found else []
    first = text.split(maxsplit=1)[0].lower().rstrip(":")
    hints = [f"did you mean '{close[0]}'?"] if close else []
    hints.append(_EXAMPLES.get(first, _EXAMPLE))
    return AssumptionError(
        "\n".join([_excerpt(text, at, message), *hints]),
        summary=_summary(text, at, message),
        hint=" ".join(hints),
    )


def listed(words: Iterable[str]) -> str:
    """Return ``a, b, c`` of at most five words, then how many are left out."""
    found = list(words)
    more = f" and {len(found) - 5} more" if len(found) > 5 else ""
    return ", ".join(found[:5]) + more


def short(text: object) -> str:
    """``str`` of something, cut off where it is too long for a message."""
    shown = str(text)
    return shown if len(shown) <= 100 else shown[:99] + "…"


def _expectation(expected: set[str]) -> str:
    names = [name for terminal, name in _EXPECTED.items() if terminal in expected]
    if "NOT" in expected:
        names.remove(_EXPECTED["LINE"])
    names = names or [name for terminal, name in _MINOR.items() if terminal in expected]
    return ", or ".join(names)


def _summary(text: str, at: int, message: str) -> str:
    """What is wrong with which assumption, on one line."""
    return f"the assumption '{_around(text, at)[0].strip()}' cannot be used: {message}"


def _excerpt(text: str, at: int, message: str) -> str:
    """The message, the text around ``at`` on one line, and a caret under it."""
    shown, column = _around(text, at)
    return f"{message}\n    {shown}\n    {' ' * column}^"


def _around(text: str, at: int) -> tuple[str, int]:
    """The text around ``at`` on one line, and where ``at`` is in it."""
    first = max(0, at - 60)
    shown = ("…" if first else "") + _shown(text[first : first + 100])
    shown += "…" if first + 100 < len(text) else ""
    return shown.rstrip(), at - first + bool(first)


def _shown(text: str) -> str:
    return "".join(character if character.isprintable() else " " for character in text)
