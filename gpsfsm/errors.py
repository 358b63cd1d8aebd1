"""The exceptions of gpsfsm.

Problems of a plan are never exceptions but findings. Exceptions are for misuse and for input that
cannot be read at all::

    GpsfsmError
    ├── UsageError        a call or option that makes no sense        exit code 2
    │   ├── ConfigError       a configuration file that does not fit
    │   └── AssumptionError   an --assume text that does not parse or select
    ├── InputError        a file that cannot be read                  exit code 2
    └── InternalError     gpsfsm contradicts itself: please report    exit code 2
"""

from __future__ import annotations

__all__ = [
    "DEBUG_VARIABLE",
    "AssumptionError",
    "ConfigError",
    "GpsfsmError",
    "InputError",
    "InternalError",
    "UsageError",
    "is_out_of_memory",
]


DEBUG_VARIABLE = "GPSFSM_DEBUG"
"""With this variable in the environment, unexpected errors are raised on: they show their place."""


class GpsfsmError(Exception):
    """Base of all errors that gpsfsm raises on purpose; its text is made for people."""


class UsageError(GpsfsmError):
    """A call or an option that makes no sense."""


class ConfigError(UsageError):
    """A configuration file that cannot be read or does not fit; names the file and the key."""


class AssumptionError(UsageError):
    """An assumption that does not parse, or that selects nothing it must select.

    ``str`` shows the place in several lines. ``summary`` says in one line what is wrong with which
    assumption, ``hint`` what to write instead ("" if nothing is to be said).
    """

    def __init__(self, text: str, *, summary: str = "", hint: str = "") -> None:
        super().__init__(text)
        self.summary = summary or text
        self.hint = hint


class InputError(GpsfsmError):
    """An input that cannot be read: missing, no permission, not a regular file."""


class InternalError(GpsfsmError):
    """Gpsfsm contradicts itself, so that no verdict can be trusted. Please report it."""


def is_out_of_memory(error: BaseException) -> bool:
    """Whether an error says that there was too little memory, which is no defect.

    z3 has no kind of errors for that, and none at all for a library that does not fit into memory:
    then it says that there is no library.
    """
    if isinstance(error, MemoryError):
        return True
    if type(error).__name__ != "Z3Exception" or not type(error).__module__.startswith("z3"):
        return False
    text = str(error)
    return any(each in text for each in ("memory", "bad_alloc", "libz3"))
