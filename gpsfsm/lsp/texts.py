"""The documents that are open in the editor, as the editor has them."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from lsprotocol.types import TextDocumentContentChangePartial
from pygls.uris import to_fs_path

from gpsfsm.lsp.positions import Encoding, Places

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from lsprotocol.types import TextDocumentContentChangeEvent

__all__ = ["Text", "Texts"]


@dataclass(frozen=True)
class Text:
    """One version of a document. ``file`` is None for one that was never saved."""

    uri: str
    version: int
    content: str
    language: str = ""
    encoding: Encoding = "utf-16"

    @cached_property
    def places(self) -> Places:
        """From the editor's positions to offsets, and back."""
        return Places(self.content, self.encoding)

    @cached_property
    def file(self) -> Path | None:
        """Where it is saved."""
        path = to_fs_path(self.uri)
        return Path(path) if path and "\0" not in path else None

    @property
    def marked(self) -> bool:
        """Whether it begins with a byte order mark, which findings do not count."""
        return self.content.startswith("\ufeff")

    def changed(self, version: int, changes: Sequence[TextDocumentContentChangeEvent]) -> Text:
        """The version after the changes, which are made one after the other."""
        content, places = self.content, self.places
        for number, change in enumerate(changes):
            if not isinstance(change, TextDocumentContentChangePartial):
                content = change.text
            else:
                places = places if number == 0 else Places(content, self.encoding)
                start, end = places.offset(change.range.start), places.offset(change.range.end)
                content = content[:start] + change.text + content[max(start, end) :]
        return Text(self.uri, version, content, self.language, self.encoding)


@dataclass(slots=True)
class Texts:
    """The documents that are open, by address; ``encoding`` is what was agreed upon."""

    encoding: Encoding = "utf-16"
    _open: dict[str, Text] = field(default_factory=dict)

    def open(self, uri: str, version: int, content: str, language: str) -> Text:
        """A document has been opened."""
        found = self._open[uri] = Text(uri, version, content, language, self.encoding)
        return found

    def change(
        self, uri: str, version: int, changes: Sequence[TextDocumentContentChangeEvent]
    ) -> Text | None:
        """A document has been edited; None if it is not open."""
        found = self._open.get(uri)
        if found is None:
            return None
        self._open[uri] = found = found.changed(version, changes)
        return found

    def close(self, uri: str) -> None:
        """A document has been closed."""
        self._open.pop(uri, None)

    def get(self, uri: str) -> Text | None:
        """The document as it is now; None if it is not open."""
        return self._open.get(uri)

    def __iter__(self) -> Iterator[Text]:
        return iter(list(self._open.values()))
