"""Functions of Python that the user allows; what one prints becomes lines of its runner.

``sys.stdout`` and ``sys.stderr`` belong to the whole process. While functions are being called,
they are replaced by streams that look who writes: the thread of a function, or somebody else. So
all other threads print as ever.
"""

from __future__ import annotations

import codecs
import importlib
import inspect
import io
import json
import sys
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from gpsfsm.execution.lane import in_thread
from gpsfsm.execution.runner import LoadContext, RunContext, Runner, RunnerError
from gpsfsm.runners.generic import text

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from gpsfsm.execution.records import RunValue

_HANDED_OVER = ("text", "response_body", "stdout", "result")
_MAX_RESULT = 900_000  # characters
_LONGEST = 10_000  # characters of a line: more are not kept
_MOST = 1_001  # lines: the journal takes a thousand, and says once that there were more
_NAMES = ("stdout", "stderr")
_current = threading.local()
_lock = threading.Lock()
_replaced: dict[str, tuple[Any, _ByThread]] = {}
_users: list[int] = []


class PythonRunner(Runner):
    """Calls a function, in a thread of its own.

    The service ``allow_functions`` holds the functions that may be called, as ``module:name``. A
    function gets ``argument`` first, if it takes any, and by name what the step before hands over
    as text, response_body, stdout or result, as far as it takes these. What it prints are lines
    in the journal. A function cannot be stopped: when its instance is, it is left alone.
    """

    def __init__(self) -> None:
        self._functions: frozenset[str] = frozenset()

    async def start(self, context: LoadContext) -> None:
        """Get ready."""
        self._functions = frozenset(context.services.get("allow_functions", ()))

    async def run(
        self,
        parameters: Mapping[str, RunValue],
        context: RunContext,
    ) -> Mapping[str, RunValue]:
        """Call the function."""
        named = text(parameters, "function")
        if named not in self._functions:
            raise RunnerError(f"the function {named[:200]!r} is not allowed")
        printed = Printed(context.log)
        try:
            result = await in_thread(_call, named, dict(parameters), printed)
        finally:
            printed.close()
        if len(result) > _MAX_RESULT:
            raise RunnerError(f"{named} returns more than {_MAX_RESULT:,} characters")
        return {"result": result}


def _call(named: str, parameters: Mapping[str, RunValue], printed: Printed) -> str:
    """Import and call; what that raises is the failure, what it prints is kept."""
    with printed.taking():
        return _written(_called(named, parameters))


def _called(named: str, parameters: Mapping[str, RunValue]) -> Any:
    module, _, name = named.partition(":")
    try:
        function = getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError, ValueError) as error:
        raise RunnerError(f"there is no function {named}: {error}") from error
    if not callable(function) or inspect.iscoroutinefunction(function):
        raise RunnerError(f"{named} is not a function that can be called directly")
    positional, by_name = _arguments(function, parameters)
    return function(*positional, **by_name)


def _arguments(
    function: Callable[..., Any], parameters: Mapping[str, RunValue]
) -> tuple[list[RunValue], dict[str, RunValue]]:
    """The parameters that a function takes."""
    try:
        taken = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):  # some functions that are written in C do not say
        return [parameters.get("argument", "")], {}
    keyword_only = inspect.Parameter.KEYWORD_ONLY
    by_position = [
        each
        for each in taken
        if each.kind not in (keyword_only, inspect.Parameter.VAR_KEYWORD)
        and (each.name not in _HANDED_OVER or each.kind is inspect.Parameter.POSITIONAL_ONLY)
    ]
    everything = any(each.kind is inspect.Parameter.VAR_KEYWORD for each in taken)
    names = {each.name for each in taken}
    by_name = {
        name: parameters[name]
        for name in _HANDED_OVER
        if name in parameters and (everything or name in names)
    }
    return ([parameters.get("argument", "")] if by_position else []), by_name


def _written(result: object) -> str:
    """A result as text: a text as it is, nothing as the empty text, everything else as JSON."""
    if result is None:
        return ""
    if isinstance(result, str):
        return result
    try:
        return json.dumps(result, ensure_ascii=False)
    except (TypeError, ValueError, RecursionError):
        return str(result)


class Printed:
    """Takes what one function prints; ``log`` gets the lines, each with the name of its stream."""

    def __init__(self, log: Callable[[str], None]) -> None:
        self._log = log
        self._lines = 0
        self._pending = dict.fromkeys(_NAMES, "")
        self._decoders = {name: codecs.getincrementaldecoder("utf-8")("replace") for name in _NAMES}
        self._closed = False
        self._lock = threading.RLock()  # what is freed meanwhile may print too

    def write(self, name: str, text: str) -> None:
        """Take a piece of text."""
        with self._lock:
            first, *others = text.split("\n")
            self._extend(name, first)
            for other in others:
                self._end_line(name)
                if self._lines > _MOST:
                    return
                self._extend(name, other)

    def write_bytes(self, name: str, piece: bytes) -> None:
        """Take a piece of what is written past the encoding."""
        self.write(name, self._decoders[name].decode(piece))

    def _extend(self, name: str, text: str) -> None:
        held = self._pending[name]
        self._pending[name] = held + text[: max(0, _LONGEST - len(held))]

    def _end_line(self, name: str) -> None:
        line, self._pending[name] = self._pending[name], ""
        self._lines += 1
        if not self._closed and self._lines <= _MOST:
            self._log(f"{name}: {line}")

    def close(self) -> None:
        """Hand on lines that are not ended; what comes after that is thrown away."""
        with self._lock:
            for name in _NAMES:
                if self._pending[name]:
                    self._end_line(name)
            self._closed = True

    @contextmanager
    def taking(self) -> Iterator[None]:
        """Take what the current thread prints."""
        _install()
        _current.printed = self
        try:
            yield
        finally:
            _current.printed = None
            _uninstall()


class _ByThread(io.TextIOBase):
    """A stream of text that is a function's in its thread, and ``usual`` in all others."""

    def __init__(self, name: str, usual: Any) -> None:
        self._name = name
        self._usual = usual

    def write(self, text: str, /) -> int:
        printed = getattr(_current, "printed", None)
        if printed is None:
            return int(self._usual.write(text) or 0)
        if not isinstance(text, str):
            raise TypeError(f"write() argument must be str, not {type(text).__name__}")
        printed.write(self._name, text)
        return len(text)

    @property
    def buffer(self) -> Any:
        """The same for bytes."""
        printed = getattr(_current, "printed", None)
        return self._usual.buffer if printed is None else _Bytes(self._name, printed)

    def flush(self) -> None:
        if getattr(_current, "printed", None) is None:
            self._usual.flush()

    def writable(self) -> bool:
        return True

    def isatty(self) -> bool:
        return getattr(_current, "printed", None) is None and bool(self._usual.isatty())

    def fileno(self) -> int:
        if getattr(_current, "printed", None) is None:
            return int(self._usual.fileno())
        raise io.UnsupportedOperation("fileno")  # as of other streams that are no files

    def close(self) -> None:
        """Stay open: it is not the function's to close."""

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """As usual."""
        return str(getattr(self._usual, "encoding", None) or "utf-8")

    @property
    def errors(self) -> str | None:  # type: ignore[override]
        """As usual."""
        return getattr(self._usual, "errors", None)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._usual, name)


class _Bytes(io.RawIOBase):
    """The ``sys.stdout.buffer`` of a function."""

    def __init__(self, name: str, printed: Printed) -> None:
        self._name = name
        self._printed = printed

    def write(self, piece: Any, /) -> int:
        content = bytes(piece)
        self._printed.write_bytes(self._name, content)
        return len(content)

    def writable(self) -> bool:
        return True


def _install() -> None:
    with _lock:
        _users.append(threading.get_ident())
        for name in _NAMES:
            usual = getattr(sys, name)
            if usual is not None and not isinstance(usual, _ByThread):
                stream = _ByThread(name, usual)
                _replaced[name] = usual, stream
                setattr(sys, name, stream)


def _uninstall() -> None:
    """Put back what was there, unless somebody else has put something there since."""
    with _lock:
        _users.remove(threading.get_ident())
        if _users:
            return
        for name, (usual, stream) in _replaced.items():
            if getattr(sys, name) is stream:
                setattr(sys, name, usual)
        _replaced.clear()
