"""The session of an editor: its documents, which of them are plans, and how they are checked.

An editor opens XML of all kinds, and most of it is no plan.
"""

from __future__ import annotations

import asyncio
import fnmatch
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from lsprotocol.types import ClientCapabilities, MarkupKind

from gpsfsm.compile.plan_text import holds_trees
from gpsfsm.lsp.checking import Apart
from gpsfsm.lsp.diagnostics import Pages
from gpsfsm.lsp.words import Prose
from gpsfsm.syntax.text import OUTERMOST, root_name
from gpsfsm.workers import Lost

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.lsp.checking import Checking, Job, Setting, Settings
    from gpsfsm.lsp.texts import Text, Texts

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
        """The check of the documents; there from the moment on when the editor is ready."""
        assert self._checking is not None
        return self._checking

    @checking.setter
    def checking(self, checking: Checking) -> None:
        self._checking = checking

    def text(self, uri: str) -> Text | None:
        """An open document that is a plan and not too long to be looked at."""
        document = self.texts.get(uri)
        if document is None or not self.concerns(document) or len(document.content) > LONGEST:
            return None
        return document

    def concerns(self, text: Text) -> bool:
        """True if a document is a plan. What once was one remains one while it is edited."""
        if text.uri not in self.plans and is_xml(text.language, text.uri):
            named = matches(text.file, self.root, self.patterns)
            if named or is_plan(text.content):
                self.plans.add(text.uri)
        return text.uri in self.plans

    async def setting(self, text: Text) -> Setting:
        """The setting under which it is checked."""
        return await asyncio.to_thread(self.settings.of, text.file)

    async def mend(self, job: Job, setting: Setting) -> object:
        """The answer of a process to a job about fixes; None if there is none in time."""
        loop = asyncio.get_running_loop()
        answer = await loop.run_in_executor(self._thread, self._mender.do, job, setting)
        return None if isinstance(answer, Lost) else answer

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


_NAMES = frozenset({"plan", "control", "runner"})


def is_xml(language: str, uri: str) -> bool:
    """True if the editor takes a document for XML. Emacs calls it by the name of its mode."""
    return language in ("xml", "nxml") or uri.lower().endswith(".xml")


def is_plan(text: str) -> bool:
    """True if the outermost element is one of a plan, or that of behaviour trees.

    >>> is_plan("<!-- go --><plan>"), is_plan("<robot name='r2'/>"), is_plan("no markup at all")
    (True, False, False)
    """
    return root_name(text).lower() in _NAMES or holds_trees(text)


def outermost(text: str) -> int | None:
    """The offset of the outermost element's name; None if there is none."""
    first = OUTERMOST.match(text)
    return None if first is None else first.start("name")


def matches(file: Path | None, root: Path | None, patterns: Sequence[str]) -> bool:
    """True if a file is among those that are plans whatever they hold.

    A ``*`` stands for any characters, slashes too. Patterns are relative to the folder that is
    open in the editor.
    """
    if file is None:
        return False
    names = [str(file)]
    if root is not None and file.is_relative_to(root):
        names.append(file.relative_to(root).as_posix())
    return any(fnmatch.fnmatchcase(name, pattern) for name in names for pattern in patterns)
