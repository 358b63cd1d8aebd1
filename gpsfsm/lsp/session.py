"""What all features share: the documents, how they are checked, and what the editor can do."""

from __future__ import annotations

import asyncio
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from lsprotocol.types import ClientCapabilities, MarkupKind

from gpsfsm.lsp.apart import Apart, NoAnswer
from gpsfsm.lsp.pages import Pages
from gpsfsm.lsp.prose import Prose
from gpsfsm.lsp.recognising import is_plan, is_xml, matches

if TYPE_CHECKING:
    from gpsfsm.lsp.checking import Checking
    from gpsfsm.lsp.settings import Setting, Settings
    from gpsfsm.lsp.texts import Text, Texts
    from gpsfsm.lsp.work import Job

__all__ = ["LONGEST", "Session"]

LONGEST = 2_000_000
"""Characters of a document beyond which it is only checked: features look at all of a text."""
_FIX_S = 10.0


@dataclass(slots=True)
class Session:
    """One editor. ``patterns`` name files that are plans whatever they hold."""

    texts: Texts
    settings: Settings
    client: ClientCapabilities = field(default_factory=ClientCapabilities)
    root: Path | None = None
    patterns: tuple[str, ...] = ()
    pages: Pages = field(default_factory=Pages)
    plans: set[str] = field(default_factory=set)
    _checking: Checking | None = None
    _mender: Apart = field(default_factory=lambda: Apart(_FIX_S))
    _thread: ThreadPoolExecutor = field(
        default_factory=lambda: ThreadPoolExecutor(1, "gpsfsm-mend")
    )

    @property
    def checking(self) -> Checking:
        """What checks the documents; there from the moment on when the editor is ready."""
        assert self._checking is not None
        return self._checking

    @checking.setter
    def checking(self, checking: Checking) -> None:
        self._checking = checking

    def text(self, uri: str) -> Text | None:
        """An open document that is a plan and not too long to be looked at."""
        found = self.texts.get(uri)
        if found is None or not self.concerns(found) or len(found.content) > LONGEST:
            return None
        return found

    def concerns(self, text: Text) -> bool:
        """Whether a document is a plan. What once was one remains one while it is edited."""
        if text.uri not in self.plans and is_xml(text.language, text.uri):
            named = matches(text.file, self.root, self.patterns)
            if named or is_plan(text.content):
                self.plans.add(text.uri)
        return text.uri in self.plans

    async def setting(self, text: Text) -> Setting:
        """How it is checked."""
        return await asyncio.to_thread(self.settings.of, text.file)

    async def mend(self, job: Job, setting: Setting) -> object:
        """What a process makes of a job about fixes; None if it makes nothing of it in time."""
        loop = asyncio.get_running_loop()
        with suppress(NoAnswer):
            return await loop.run_in_executor(self._thread, self._mender.do, job, setting)
        return None

    def prose(self) -> Prose:
        """A text for a box of the editor."""
        hover = self.client.text_document and self.client.text_document.hover
        formats = (hover.content_format if hover else None) or []
        return Prose(MarkupKind.Markdown in formats)

    def documentation(self) -> Prose:
        """A text beside something that can be written."""
        completion = self.client.text_document and self.client.text_document.completion
        item = completion.completion_item if completion else None
        formats = (item.documentation_format if item else None) or []
        return Prose(MarkupKind.Markdown in formats)

    def close(self) -> None:
        """End all processes and remove all files."""
        if self._checking is not None:
            self._checking.close()
        self._mender.stop()
        self._thread.shutdown(wait=True)
        self._mender.close()
        self.pages.close()
