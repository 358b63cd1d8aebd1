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

from collections.abc import Sequence
from math import inf

DEBUG_VARIABLE = "GPSFSM_DEBUG"
"""With this variable in the environment, unexpected errors are raised on: they show their place."""


class GpsfsmError(Exception):
    """The base class of all errors that gpsfsm raises on purpose; the messages are for people."""


class UsageError(GpsfsmError):
    """An invalid call or option."""


class ConfigError(UsageError):
    """A configuration file cannot be read or is invalid; the message names the file and the key."""


class AssumptionError(UsageError):
    """An assumption that cannot be parsed, or that selects nothing although it must.

    ``str()`` shows the place in several lines. ``summary`` says in one line what is wrong with
    which assumption, ``hint`` what to write instead ("": no suggestion).
    """

    def __init__(self, text: str, *, summary: str = "", hint: str = "") -> None:
        super().__init__(text)
        self.summary = summary or text
        self.hint = hint


class InputError(GpsfsmError):
    """An input cannot be read: it is missing, not accessible, or not a regular file."""


class InternalError(GpsfsmError):
    """Gpsfsm contradicts itself, so no verdict can be trusted. Please report it."""


def installing(extra: str) -> str:
    """The command that installs an extra of gpsfsm, for messages.

    >>> print(installing("mcap"))
    pip install 'gpsfsm[mcap]', or '.[mcap]' in a clone
    """
    return f"pip install 'gpsfsm[{extra}]', or '.[{extra}]' in a clone"


def misused(function: str, expected: str, value: object, hint: str = "") -> UsageError:
    """The error of a public function that was given a value of another type than it takes."""
    text = repr(value)
    shown = text if len(text) <= 40 else f"a value of type {type(value).__name__}"
    more = f"; {hint}" if hint else ""
    return UsageError(f"{function} takes {expected}, not {shown}{more}")


def require_list(function: str, name: str, value: object) -> None:
    """Raise UsageError for what is no list: a text would be taken letter by letter."""
    if isinstance(value, str | bytes) or not isinstance(value, Sequence):
        raise misused(function, f"a list as {name}", value)


def require_texts(function: str, name: str, value: object) -> None:
    """Raise UsageError for what is no list of texts."""
    require_list(function, name, value)
    assert isinstance(value, Sequence)
    for each in value:
        if not isinstance(each, str):
            raise misused(function, f"texts in {name}", each)


def require_flag(function: str, name: str, value: object) -> None:
    """Raise UsageError for what is neither True nor False."""
    if not isinstance(value, bool):
        raise misused(function, f"True or False as {name}", value)


def require_whole(function: str, name: str, value: object, *, least: int | None = None) -> None:
    """Raise UsageError for what is no whole number, or a smaller one than ``least``."""
    whole = value if isinstance(value, int) and not isinstance(value, bool) else None
    if whole is None or (least is not None and whole < least):
        kind = "a whole number" if least is None else f"a whole number of at least {least}"
        raise misused(function, f"{kind} as {name}", value)


def require_amount(function: str, name: str, value: object, *, most: float = inf) -> None:
    """Raise UsageError for what is no number, or not one from 0 to ``most``."""
    amount = not isinstance(value, bool) and isinstance(value, int | float) and 0 <= value <= most
    if not amount:
        kind = "a number from 0 on" if most == inf else f"a number from 0 to {most:g}"
        raise misused(function, f"{kind} as {name}", value)


def system_reason(error: OSError | ValueError) -> str:
    """The reason why a path or a command is of no use to the system, in the system's own words.

    Python finds some reasons itself and raises ValueError, with words that change with its version.
    """
    if isinstance(error, OSError):
        return error.strerror or str(error)
    if isinstance(error, UnicodeEncodeError):
        return f"U+{ord(error.object[error.start]):04X} cannot be encoded"
    return "a NUL character is not allowed"


def is_out_of_memory(error: BaseException) -> bool:
    """True if an error says that there was too little memory, which is no defect.

    z3 has no kind of errors for that, and none at all for a library that does not fit into memory:
    then it says that there is no library.
    """
    if isinstance(error, MemoryError):
        return True
    if type(error).__name__ != "Z3Exception" or not type(error).__module__.startswith("z3"):
        return False
    text = str(error)
    return any(each in text for each in ("memory", "bad_alloc", "libz3"))
