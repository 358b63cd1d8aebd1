"""What a runner may hand over and say: values that JSON can hold, texts that can be written."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from gpsfsm.execution.records import Input, Kind
from gpsfsm.execution.runner import RunnerError

if TYPE_CHECKING:
    from gpsfsm.execution.records import RunValue

MAX_DEPTH = 4  # lists in lists
MAX_SIZE = 1_000_000  # of all outputs together: characters, and one for each value


def taken(outputs: object) -> dict[str, RunValue]:
    """A copy of the outputs of a runner, so that it cannot change them any more.

    Raises ValueError, which says what is wrong, if they are not outputs.
    """
    if outputs is None:
        return {}
    if not isinstance(outputs, dict):
        raise ValueError(f"it returned {type(outputs).__name__} and not outputs by name")
    try:
        return _taken(outputs)
    except ValueError:
        raise
    except Exception as error:  # a dictionary or text of the runner's own making
        raise ValueError(f"its outputs cannot be read ({type(error).__name__})") from None


def _taken(outputs: dict[object, object]) -> dict[str, RunValue]:
    left = MAX_SIZE
    found: dict[str, RunValue] = {}
    for name, value in outputs.items():
        if not isinstance(name, str) or _unwritable(name):
            raise ValueError(f"the name of its output {name!r:.80} is no text")
        copied, left = _copied(value, left - len(name))
        if copied is None:
            raise ValueError(f"its output {clean(name, 80)!r} is no value that can be handed over")
        if left < 0:
            raise ValueError("its outputs are too long")
        found[name] = copied
    return found


def invalid(outputs: object) -> str:
    """What is wrong with the outputs of a runner; "" if nothing."""
    try:
        taken(outputs)
    except ValueError as error:
        return str(error)
    return ""


def checked(outputs: object) -> dict[str, RunValue]:
    """The same as ``taken``, but what is wrong is raised as a failure of the runner."""
    try:
        return taken(outputs)
    except ValueError as error:
        raise RunnerError(str(error)) from None


def failure(number: int, error: BaseException) -> Input:
    """The failure of an instance that raised an exception."""
    if not isinstance(error, RunnerError):
        return Input(Kind.FAILED, number, message=said(error))
    outputs: dict[str, RunValue] = {}
    with suppress(ValueError, RuntimeError, AttributeError):  # rubbish, or changed meanwhile
        outputs = taken(error.outputs)
    message = said(error).removeprefix(f"{type(error).__name__}: ")
    return Input(Kind.FAILED, number, outputs=outputs, message=message)


def _copied(value: object, left: int, depth: int = 0) -> tuple[RunValue | None, int]:
    """A copy (None if it is no value) and how much may still come; stops when that is negative."""
    left -= 1
    if isinstance(value, bool):
        return value, left
    if isinstance(value, str):
        left -= len(value)
        return ("" if left < 0 else None if _unwritable(value) else str(value)), left
    if isinstance(value, float):
        finite = value == value and abs(value) != float("inf")  # noqa: PLR0124
        return (float(value) if finite else None), left
    if isinstance(value, int):
        return (int(value) if abs(value) < 2**63 else None), left
    if not isinstance(value, list) or depth == MAX_DEPTH:
        return None, left
    items: list[RunValue] = []
    for item in value:
        copied, left = _copied(item, left, depth + 1)
        if copied is None or left < 0:
            return copied, left
        items.append(copied)
    return items, left


def _unwritable(text: str) -> bool:
    """Whether a text holds half a character (a lone surrogate), which no file can hold."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return True
    return False


def clean(text: str, limit: int = 1000) -> str:
    """A text clipped and made writable."""
    return text[:limit].encode("utf-8", "backslashreplace").decode("utf-8")[:limit]


def said(error: BaseException) -> str:
    """An exception as a message; also one that cannot be put into words."""
    name = type(error).__name__
    try:
        text = str(error)
    except Exception:  # its own __str__ fails
        return clean(name)
    return clean(f"{name}: {text}" if text else name)
