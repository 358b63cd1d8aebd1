"""What real runners may reach: the options ``--allow-…``, looked over."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.cli._options import words
from gpsfsm.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

__all__ = ["ALLOW", "allowed"]


def allowed(option: str, texts: Iterable[str]) -> list[str]:
    """The values of one of these options, as runners get them.

    Raises UsageError for what would never allow anything, or something else than it seems to.
    """
    return [ALLOW[option](text) for text in words(texts)]


def _host(text: str) -> str:
    from gpsfsm.runners.generic.hosts import allowed_host, shown  # noqa: PLC0415  (for --real only)

    try:
        return allowed_host(text)
    except ValueError as error:
        raise UsageError(f"--allow-host {shown(text, 100)!r}: {error}") from None


def _program(text: str) -> str:
    if not text.strip() or "\0" in text:
        raise UsageError(
            f"--allow-program {text[:100]!r}: it names no program; write it as plans do, as in "
            "echo or /usr/bin/echo"
        )
    return text


def _function(text: str) -> str:
    module, _, name = text.partition(":")
    if not (_is_module(module) and name.isidentifier()):
        raise UsageError(
            f"--allow-function {text[:100]!r}: it names no function; write module:name, as in "
            "my_robot.tools:look"
        )
    return text


def _module(text: str) -> str:
    if not _is_module(text):
        raise UsageError(
            f"--allow-module {text[:100]!r}: it names no module; write its name as in an import, "
            "as in my_robot or my_robot.arm"
        )
    return text


def _is_module(text: str) -> bool:
    return all(part.isidentifier() for part in text.split("."))


ALLOW: dict[str, Callable[[str], str]] = {
    "allow_host": _host,
    "allow_program": _program,
    "allow_function": _function,
    "allow_module": _module,
}
"""How a value of each option is looked over."""
