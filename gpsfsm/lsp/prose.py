"""What an editor shows in a box: a few paragraphs, as Markdown or plain.

Text from plans and capability files is never markup in it: a plan must not put links or pictures
into an editor.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from lsprotocol.types import MarkupContent, MarkupKind

from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = ["Prose"]

_LONGEST = 4_000
_MARKUP = re.compile(
    r"(?P<always>[\\`*\[\]<>&|~@]|:(?=//)|(?<=www)\.|(?<!\w)_|_(?!\w))"
    r"|^(?P<first>[#+\-=]|\d++[.)])",
    re.IGNORECASE,
)
"""What could be read as markup: not more, since some editors show the backslashes."""


@dataclass(slots=True)
class Prose:
    """Paragraphs; ``markdown`` says whether the editor can show Markdown."""

    markdown: bool = True
    _parts: list[str] = field(default_factory=list)

    def title(self, text: str, note: str = "") -> Prose:
        """A name, and a few words on it."""
        shown = f"**{self._safe(text)}**" if self.markdown else clip(text, _LONGEST)
        self._parts.append(f"{shown} {self._safe(note)}".rstrip())
        return self

    def text(self, text: str) -> Prose:
        """A paragraph."""
        if text.strip():
            self._parts.append(self._safe(" ".join(text.split())))
        return self

    def items(self, texts: Iterable[str], *, numbered: bool = False) -> Prose:
        """A list."""
        lines = [
            f"{f'{number}.' if numbered else '-'} {self._safe(' '.join(text.split()))}"
            for number, text in enumerate(texts, start=1)
        ]
        if lines:
            self._parts.append("\n".join(lines))
        return self

    def code(self, text: str) -> Prose:
        """A line of a plan."""
        shown = clip(" ".join(text.split()), _LONGEST)
        if not self.markdown:
            self._parts.append(shown)
            return self
        longest = max((len(run) for run in re.findall("`+", shown)), default=0)
        fence = "`" * max(3, longest + 1)
        self._parts.append(f"{fence}xml\n{shown}\n{fence}")
        return self

    def rule(self) -> Prose:
        """A line between two subjects."""
        self._parts.append("---")
        return self

    def join(self, other: Prose) -> Prose:
        """Another text behind this one."""
        self._parts += other._parts
        return self

    def __bool__(self) -> bool:
        return bool(self._parts)

    def written(self) -> MarkupContent:
        """For the protocol."""
        kind = MarkupKind.Markdown if self.markdown else MarkupKind.PlainText
        return MarkupContent(kind, "\n\n".join(self._parts))

    def _safe(self, text: str) -> str:
        shown = clip(text, _LONGEST)
        return _MARKUP.sub(_escaped, shown) if self.markdown else shown


def _escaped(found: re.Match[str]) -> str:
    """With a backslash before it; of ``1.`` before the full stop."""
    return f"{found[0][:-1]}\\{found[0][-1]}"
