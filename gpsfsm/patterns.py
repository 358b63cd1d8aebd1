"""Regular expressions that are compiled at their first use: a plain check needs few of them."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, overload

if TYPE_CHECKING:

    @overload
    def pattern(text: str, flags: int = 0) -> re.Pattern[str]: ...
    @overload
    def pattern(text: bytes, flags: int = 0) -> re.Pattern[bytes]: ...
    def pattern(text: Any, flags: int = 0) -> Any:
        """``re.compile``, as late as possible."""
else:

    class pattern:  # noqa: N801  (it stands for a function)
        """``re.compile``, as late as possible; what has been asked for once is looked up directly.

        >>> pattern("[a-z]+").findall("one, two")
        ['one', 'two']
        """

        def __init__(self, text: str | bytes, flags: int = 0) -> None:
            self._arguments = (text, flags)

        def __getattr__(self, name: str) -> Any:
            if name.startswith("_"):  # copy, pickle and the like ask for what a pattern has not
                raise AttributeError(name)
            value = getattr(re.compile(*self._arguments), name)
            setattr(self, name, value)
            return value
