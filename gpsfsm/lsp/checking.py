"""The check of documents: under which settings, in which process, and when.

A check on the command line reads the configuration and the capability files each time. So a look
at their times (``Settings``) tells, before each check, whether anything has to be read again.

The check runs in a process of its own (``Apart`` is how the server sees it, ``Work`` what happens
in it), which is ended when a text takes too long, so no plan can keep an editor waiting.
``Checking`` has documents checked soon after an edit, one at a time, and always the newest version;
the result of a check whose text has changed meanwhile is dropped.
"""

from __future__ import annotations

import asyncio
import itertools
import os
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, cast

from gpsfsm.capabilities.files import find_files, find_manifests
from gpsfsm.capabilities.library import Library, builtin_capabilities
from gpsfsm.checking import CheckOptions, check_text, failed, undecided
from gpsfsm.checking.config import (
    Config,
    config_names,
    find_config,
    load_user_config,
    searched_folders,
    user_config_file,
)
from gpsfsm.checking.selection import Baseline, apply_suppressions, load_baseline
from gpsfsm.compile.plan_text import read_plan
from gpsfsm.errors import GpsfsmError
from gpsfsm.model.report import Report
from gpsfsm.workers import Lost
from gpsfsm.workers.codec import decode, encode
from gpsfsm.workers.parent_link import WARM_PLAN
from gpsfsm.workers.pool_worker import KeptWorker

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from gpsfsm.fixing.suggest import Mended
    from gpsfsm.lsp.texts import Text, Texts
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.report import PlanReport
    from gpsfsm.workers.pool_worker import Worker

DELAY_S = 0.1
"""How long the keyboard has to be still before a check begins."""
TIMEOUT_S = 60.0
"""What a check may take."""
_STALE_S = 2.0
_PATIENCE_S = 5.0
_HINT = "check it on the command line, where --time-limit sets the time that it may take"
_MOST_FOLDERS = 100
_MEMORY_MB = 2_048
_MOST_JOBS = 5_000
"""After so many jobs the process is replaced, whatever may have gathered in it."""
_PACKED = tuple[CheckOptions, Baseline | None]
_Stamp = tuple[tuple[str, int, int], ...]


@dataclass(frozen=True, slots=True)
class Setting:
    """The settings of a folder's documents.

    ``number`` tells one setting from another. ``folder`` is where a check would be run: paths in
    reports are relative to it. ``error`` says why the configuration cannot be used, "" if it can;
    ``options`` are the defaults then, and nothing is checked with them. ``depends_on`` are the
    paths of what else was read.
    """

    number: int
    options: CheckOptions
    folder: Path
    file: str = ""
    error: str = ""
    depends_on: tuple[str, ...] = ()
    baseline: Baseline | None = None

    @property
    def library(self) -> Library:
        """The capabilities in force."""
        return self.options.described.library


@dataclass(slots=True)
class Settings:
    """The settings of all folders. ``options_of`` makes options of the values of a file.

    May be called from several threads.
    """

    options_of: Callable[[Mapping[str, Any]], CheckOptions]
    root: Path | None = None
    _read_settings: dict[Path, tuple[_Stamp, Setting]] = field(default_factory=dict)
    _numbers: itertools.count[int] = field(default_factory=lambda: itertools.count(1))
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def of(self, file: Path | None) -> Setting:
        """The setting of a document, with what the files say now; never raises."""
        folder = self.folder_of(file)
        with self._lock:
            stamp, setting = self._read_settings.get(folder, ((), None))
            if setting is None or _stamp(folder, setting) != stamp:
                setting = self._read(folder)
                if len(self._read_settings) >= _MOST_FOLDERS:
                    self._read_settings.clear()
                self._read_settings[folder] = _stamp(folder, setting), setting
            return setting

    def folder_of(self, file: Path | None) -> Path:
        """The folder from which on upwards the configuration for a document is looked for."""
        return (file.parent if file is not None else self.root) or Path("/")

    def _read(self, folder: Path) -> Setting:
        number = next(self._numbers)
        config = Config()
        values: Mapping[str, Any] = {}
        try:
            config, own = find_config(folder), load_user_config()
            values = {**own.values, **config.values}
            options, error, baseline = _small(self.options_of(values)), "", _baseline(values)
        except GpsfsmError as unusable:
            options, error, baseline = CheckOptions(), str(unusable), None
        paths = (*values.get("capabilities", ()), *filter(None, [values.get("baseline")]))
        place = Path(config.file).parent if config.file else folder
        return Setting(number, options, place, config.file, error, tuple(paths), baseline)


def _small(options: CheckOptions) -> CheckOptions:
    """The same without the built-in library, which the processes that check have already."""
    if options.capabilities is builtin_capabilities():
        return replace(options, capabilities=None)
    return options


def _baseline(values: Mapping[str, Any]) -> Baseline | None:
    file = values.get("baseline")
    return None if file is None else load_baseline(file)


def _stamp(folder: Path, setting: Setting) -> _Stamp:
    """The times and sizes of all files that a setting depends on, also of those not there yet."""
    files: list[str] = []
    for above in searched_folders(folder):
        files += (str(above / name) for name in config_names())
    if own := user_config_file():
        files.append(str(own))
    for path in setting.depends_on:
        try:
            files += [*find_files(path), *find_manifests(path)]
        except GpsfsmError:  # it is reported when it is read
            files.append(path)
    return tuple(_looked_at(files))


def _looked_at(files: Iterable[str]) -> Iterable[tuple[str, int, int]]:
    for file in files:
        try:
            entry = os.stat(file)  # noqa: PTH116  (thousands of them, before each check)
        except (OSError, ValueError):
            continue
        yield file, entry.st_mtime_ns, entry.st_size


Result: TypeAlias = "PlanReport | tuple[Mended, ...] | str | bool"
"""The report of a check; the fixes of a finding; the text after all fixes; whether it is so."""


@dataclass(frozen=True, slots=True)
class Job:
    """A text and what is to be done with it.

    ``setting`` is the number of a setting, and ``packed`` what it holds, only where it is new.
    ``fix`` mends ``finding``, ``fix-all`` all that can be mended safely; ``allows`` tells whether a
    comment in the text allows ``finding``.
    """

    kind: Literal["warm", "check", "fix", "fix-all", "allows"]
    text: str = ""
    path: str = ""
    setting: int = 0
    packed: bytes = b""
    finding: Finding | None = None


class Apart:
    """A process that does one job at a time, and is ended if one takes more than ``timeout_s``.

    ``do`` belongs to one thread; ``stop`` may be called from another one meanwhile.
    """

    def __init__(self, timeout_s: float) -> None:
        self._kept: KeptWorker[Job, Result] = KeptWorker(Work(), timeout_s, memory_mb=_MEMORY_MB)
        self._worker: Worker[Job, Result] | None = None
        self._sent = self._jobs = 0

    def do(self, job: Job, setting: Setting | None = None) -> Result | Lost:
        """The answer. A process that has just begun warms up first, in a time of its own."""
        if self._jobs >= _MOST_JOBS:
            self._kept.end()
        if self._kept.current() is not self._worker:
            self._worker = self._kept.current()
            self._sent = self._jobs = 0
            if job.kind != "warm" and isinstance(lost := self._kept.do(Job("warm")), Lost):
                return lost
        if setting is not None:
            job = replace(job, setting=setting.number)
            if self._sent != setting.number:
                job = replace(job, packed=encode((setting.options, setting.baseline)))
                self._sent = setting.number
        self._jobs += 1
        return self._kept.do(job)

    def stop(self) -> None:
        """End the process; who waits for it gets Lost, and the next job a new one."""
        self._kept.kill()

    def close(self) -> None:
        """End the process for good."""
        self._kept.end()


@dataclass(slots=True)
class Work:
    """The work of the process; between its jobs it keeps the last setting."""

    settings: dict[int, tuple[CheckOptions, Baseline | None]] = field(default_factory=dict)

    def __call__(self, job: Job) -> Result:
        """Do a job. Never raises for what is in the text."""
        if job.kind == "warm":
            check_text(WARM_PLAN, "", CheckOptions())
            return True
        if job.packed:
            self.settings = {job.setting: decode(_PACKED, job.packed)}
        options, baseline = self.settings[job.setting]
        if job.kind == "check":
            report = check_text(job.text, job.path, options)
            return report if baseline is None else baseline.apply(Report((report,))).plans[0]
        if job.kind == "allows":
            return _allows(job, options)
        try:
            return _mend(job, options)
        except Exception:  # a defect of a fix: there is nothing to offer, and the check goes on
            return () if job.kind == "fix" else job.text


def _allows(job: Job, options: CheckOptions) -> bool:
    assert job.finding is not None
    read = read_plan(job.text, limits=options.limits, from_response=options.from_response)
    _, allowed, _ = apply_suppressions((job.finding,), read.suppressions)
    return bool(allowed)


def _mend(job: Job, options: CheckOptions) -> tuple[Mended, ...] | str:
    if job.kind == "fix-all":
        from gpsfsm.fixing import fix_text

        fixed = fix_text(job.text, options, path=job.path)
        return fixed.text if fixed.applied else job.text
    from gpsfsm.fixing.suggest import proved

    assert job.finding is not None
    analysis = replace(options.analysis, max_scenarios=0)
    return proved(job.text, job.path, job.finding, replace(options, analysis=analysis))


@dataclass(frozen=True, slots=True)
class Checked:
    """One version of a document with its report."""

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
        """The last result; it may be about an older version."""
        return self._latest.get(uri)

    async def current(self, uri: str) -> Checked | None:
        """The result for the document as it is now; None if that takes too long."""
        with suppress(TimeoutError):
            async with asyncio.timeout(_PATIENCE_S):
                while True:
                    checked = self._latest.get(uri)
                    if checked is not None and checked.text is self._texts.get(uri):
                        return checked
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
                checked = await self._do(self._check, text)
            finally:
                self._busy = None
            if isinstance(checked, Checked) and self._texts.get(uri) is text:
                self._latest[uri] = checked
                self._tell(checked)
            self._arrived.set()

    async def _do(self, work: Callable[..., object], *arguments: object) -> object:
        """In the one thread that talks to the process."""
        return await asyncio.get_running_loop().run_in_executor(self._thread, work, *arguments)

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
            report = self._report(path, self._apart.do(job, setting))
        except Exception as error:
            report = failed(path, f"the check of this plan failed ({type(error).__name__})")
        return Checked(text, setting, report)

    def _report(self, path: str, answer: object) -> PlanReport:
        if not isinstance(answer, Lost):
            return cast("PlanReport", answer)
        if answer.late:
            limit = f"the plan is undecided after {self._timeout_s:g} s (time limit)"
            return undecided(path, limit, hint=_HINT)
        return failed(path, f"the process that checked this plan {answer.how}", hint=_HINT)

    def close(self) -> None:
        """End the process, whatever it does."""
        if self._task is not None:
            self._task.cancel()
            self._task = None
        self._apart.stop()
        self._thread.shutdown(wait=True)
        self._apart.close()


def path_of(text: Text, setting: Setting) -> str:
    """The path of a document for a check that is run where the configuration is."""
    if text.file is None:
        return "<text>"
    try:
        return os.path.relpath(text.file, setting.folder)
    except ValueError:  # another drive
        return str(text.file)
