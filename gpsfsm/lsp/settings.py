"""How a document is checked: with the configuration that holds in its folder.

A check on the command line reads the configuration and the capability files each time. So a look
at their times tells, before each check, whether anything has to be read again.
"""

from __future__ import annotations

import itertools
import os
import pickle
import threading
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gpsfsm.capabilities.files import find_files
from gpsfsm.capabilities.library import Library, builtin_capabilities
from gpsfsm.checking import CheckOptions
from gpsfsm.config import (
    Config,
    config_names,
    find_config,
    load_user_config,
    searched_folders,
    user_config_file,
)
from gpsfsm.errors import GpsfsmError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from gpsfsm.baseline import Baseline

__all__ = ["Setting", "Settings"]

_MOST_FOLDERS = 100

_Stamp = tuple[tuple[str, int, int], ...]


@dataclass(frozen=True, slots=True)
class Setting:
    """How the documents of a folder are checked.

    ``number`` tells one setting from another. ``folder`` is where a check would be run: paths in
    reports are relative to it. ``error`` says why the configuration cannot be used, "" if it can;
    ``options`` are the defaults then, and nothing is checked with them. ``depends_on`` are the
    paths of what else was read. ``packed`` holds the options and the baseline for another process:
    a library fills its tables while it is used, so it could not be packed in the meantime.
    """

    number: int
    options: CheckOptions
    folder: Path
    file: str = ""
    error: str = ""
    depends_on: tuple[str, ...] = ()
    packed: bytes = b""

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
    _known: dict[Path, tuple[_Stamp, Setting]] = field(default_factory=dict)
    _numbers: itertools.count[int] = field(default_factory=lambda: itertools.count(1))
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def of(self, file: Path | None) -> Setting:
        """How a document is checked, with what the files say now; never raises."""
        folder = self.folder_of(file)
        with self._lock:
            stamp, found = self._known.get(folder, ((), None))
            if found is None or _stamp(folder, found) != stamp:
                found = self._read(folder)
                if len(self._known) >= _MOST_FOLDERS:
                    self._known.clear()
                self._known[folder] = _stamp(folder, found), found
            return found

    def folder_of(self, file: Path | None) -> Path:
        """Where the configuration for a document is looked for, from there on upwards."""
        return (file.parent if file is not None else self.root) or Path("/")

    def _read(self, folder: Path) -> Setting:
        number = next(self._numbers)
        config = Config()
        values: Mapping[str, Any] = {}
        try:
            config, own = find_config(folder), load_user_config()
            values = {**own.values, **config.values}
            options, error, known = _small(self.options_of(values)), "", _known(values)
        except GpsfsmError as found:
            options, error, known = CheckOptions(), str(found), None
        paths = (*values.get("capabilities", ()), *filter(None, [values.get("baseline")]))
        place = Path(config.file).parent if config.file else folder
        packed = pickle.dumps((options, known))
        return Setting(number, options, place, config.file, error, tuple(paths), packed)


def _small(options: CheckOptions) -> CheckOptions:
    """The same without the built-in library, which the processes that check have already."""
    if options.capabilities is builtin_capabilities():
        return replace(options, capabilities=None)
    return options


def _known(values: Mapping[str, Any]) -> Baseline | None:
    file = values.get("baseline")
    if file is None:
        return None
    from gpsfsm.baseline import load_baseline  # noqa: PLC0415  (few use one)

    return load_baseline(file)


def _stamp(folder: Path, setting: Setting) -> _Stamp:
    """The times and sizes of all files that a setting depends on, also of those not there yet."""
    files: list[str] = []
    for above in searched_folders(folder):
        files += (str(above / name) for name in config_names())
    if own := user_config_file():
        files.append(str(own))
    for path in setting.depends_on:
        try:
            files += find_files(path)
        except GpsfsmError:  # it is told when it is read
            files.append(path)
    return tuple(_looked_at(files))


def _looked_at(files: Iterable[str]) -> Iterable[tuple[str, int, int]]:
    for file in files:
        try:
            found = os.stat(file)  # noqa: PTH116  (thousands of them, before each check)
        except (OSError, ValueError):
            continue
        yield file, found.st_mtime_ns, found.st_size
