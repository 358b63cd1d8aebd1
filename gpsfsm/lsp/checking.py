"""When documents are checked: soon after an edit, one at a time, and always the newest version.

The check runs in a process of its own, so the server answers meanwhile. A check that nobody wants
any more, because its text has changed, is ended if it takes long; else its result is dropped.
"""

from __future__ import annotations

import asyncio
import os
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

from gpsfsm.checking import failed, undecided
from gpsfsm.lsp.apart import Apart, NoAnswer
from gpsfsm.lsp.work import Job

if TYPE_CHECKING:
    from collections.abc import Callable

    from gpsfsm.lsp.settings import Setting, Settings
    from gpsfsm.lsp.texts import Text, Texts
    from gpsfsm.model.report import PlanReport

__all__ = ["Checked", "Checking"]

DELAY_S = 0.1
"""How long the keyboard has to be still before a check begins."""
TIMEOUT_S = 60.0
"""What a check may take."""
_STALE_S = 2.0
_PATIENCE_S = 5.0
_HINT = "check it on the command line, where there is no time limit unless you set one"


@dataclass(frozen=True, slots=True)
class Checked:
    """What is known of one version of a document."""

    text: Text
    setting: Setting
    report: PlanReport


class Checking:
    """Checks the documents that are wanted. Lives on one event loop."""

    def __init__(
        self,
        texts: Texts,
        settings: Settings,
        tell: Callable[[Checked], None],
        *,
        timeout_s: float = TIMEOUT_S,
    ) -> None:
        self._texts, self._settings, self._tell = texts, settings, tell
        self._apart = Apart(timeout_s)
        self._timeout_s = timeout_s
        self._thread = ThreadPoolExecutor(1, "gpsfsm-check")
        self._wanted: dict[str, float] = {}  # the document edited last comes last
        self._latest: dict[str, Checked] = {}
        self._news = asyncio.Event()
        self._arrived = asyncio.Event()
        self._busy: tuple[Text, float] | None = None
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Begin to check."""
        self._task = asyncio.get_running_loop().create_task(self._run())

    def want(self, uri: str, *, delay_s: float = DELAY_S) -> None:
        """Check a document, once no further edit has come for a while."""
        now = time.monotonic()
        self._wanted.pop(uri, None)
        self._wanted[uri] = now + delay_s
        self._news.set()
        busy = self._busy
        if busy is not None and busy[0] is not self._texts.get(busy[0].uri):  # it is of no use
            left = max(0.0, busy[1] + _STALE_S - now)
            asyncio.get_running_loop().call_later(left, self._end_stale, busy)

    def _end_stale(self, busy: tuple[Text, float]) -> None:
        if self._busy is busy:
            self._apart.stop()

    def forget(self, uri: str) -> None:
        """A document has been closed."""
        self._wanted.pop(uri, None)
        self._latest.pop(uri, None)

    def latest(self, uri: str) -> Checked | None:
        """What was found last; it may be about an older version."""
        return self._latest.get(uri)

    async def current(self, uri: str) -> Checked | None:
        """What is found in the document as it is now; None if that takes too long."""
        with suppress(TimeoutError):
            async with asyncio.timeout(_PATIENCE_S):
                while True:
                    found = self._latest.get(uri)
                    if found is not None and found.text is self._texts.get(uri):
                        return found
                    if uri not in self._wanted and (self._busy is None or self._busy[0].uri != uri):
                        return None
                    self._arrived.clear()
                    await self._arrived.wait()
        return None

    async def _run(self) -> None:
        await self._do(self._apart.do, Job("warm"))
        while self._task is not None:
            uri = await self._next()
            text = self._texts.get(uri)
            if text is None:
                continue
            self._busy = text, time.monotonic()
            try:
                found = await self._do(self._check, text)
            finally:
                self._busy = None
            if isinstance(found, Checked) and self._texts.get(uri) is text:
                self._latest[uri] = found
                self._tell(found)
            self._arrived.set()

    async def _do(self, work: Callable[..., object], *given: object) -> object:
        """In the one thread that talks to the process."""
        loop = asyncio.get_running_loop()
        with suppress(NoAnswer):
            return await loop.run_in_executor(self._thread, work, *given)
        return None

    async def _next(self) -> str:
        """The document that is to be checked next, once it is time."""
        while True:
            if not self._wanted:
                self._news.clear()
                await self._news.wait()
            now = time.monotonic()
            due = [uri for uri, when in self._wanted.items() if when <= now]
            if due:
                del self._wanted[due[-1]]
                return due[-1]
            await asyncio.sleep(min(self._wanted.values()) - now)

    def _check(self, text: Text) -> Checked:
        """In the thread: raises nothing."""
        setting = self._settings.of(text.file)
        path = path_of(text, setting)
        try:
            job = Job("check", text.content, path)
            report = cast("PlanReport", self._apart.do(job, setting))
        except NoAnswer as why:
            if why.late:
                limit = f"it was not decided within {self._timeout_s:g} s (time limit)"
                report = undecided(path, limit, hint=_HINT)
            else:
                report = failed(path, f"the process that checked this plan {why}", hint=_HINT)
        except Exception as error:
            report = failed(path, f"the check of this plan failed ({type(error).__name__})")
        return Checked(text, setting, report)

    def close(self) -> None:
        """End the process, whatever it does."""
        if self._task is not None:
            self._task.cancel()
            self._task = None
        self._apart.stop()
        self._thread.shutdown(wait=True)
        self._apart.close()


def path_of(text: Text, setting: Setting) -> str:
    """How a check that is run where the configuration is would call the document."""
    if text.file is None:
        return "<text>"
    try:
        return os.path.relpath(text.file, setting.folder)
    except ValueError:  # another drive
        return str(text.file)
