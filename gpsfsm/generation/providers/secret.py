"""A key that is used and never shown."""

from __future__ import annotations

import hmac
from typing import Any, NoReturn

from gpsfsm.errors import UsageError

__all__ = ["Secret"]

_SHORTEST = 8  # shorter ones are no secrets but words such as EMPTY, which local servers are given
_HIDDEN = "***"


class Secret:
    """A key and where it came from; shows neither in ``str``, ``repr``, copies nor pickles.

    ``source`` is the name of the environment variable, or what else to call it in a message.
    """

    __slots__ = ("_value", "source")

    def __init__(self, value: str = "", source: str = "") -> None:
        """Raises UsageError, which does not hold the key, if no header could carry it."""
        self._value = value.strip()
        self.source = source
        if not (self._value.isascii() and self._value.isprintable()) or " " in self._value:
            raise UsageError(f"the key in {source} cannot be one: it has blanks or odd characters")

    def reveal(self) -> str:
        """The key itself. Never keep it in a variable: tracebacks may show those."""
        return self._value

    def hidden(self, text: str) -> str:
        """A text without the key, should a server have sent it back."""
        return text.replace(self._value, _HIDDEN) if len(self._value) >= _SHORTEST else text

    def __bool__(self) -> bool:
        return bool(self._value)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Secret):
            return NotImplemented
        return hmac.compare_digest(self._value, other._value)

    def __hash__(self) -> int:
        return hash((Secret, self._value))

    def __repr__(self) -> str:
        return f"Secret({_HIDDEN!r}, {self.source!r})" if self else "Secret()"

    def __str__(self) -> str:
        return _HIDDEN if self else ""

    def __copy__(self) -> Secret:
        return self

    def __deepcopy__(self, _: dict[int, Any]) -> Secret:
        return self

    def __reduce__(self) -> NoReturn:
        raise TypeError("a key is not written anywhere")
