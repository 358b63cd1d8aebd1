"""Bounds of runs: how much they do by themselves, and what real runners may reach."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from gpsfsm.execution.chain import Policy
    from gpsfsm.execution.records import RunValue

MAX_PLANS = 20
"""The plans that one queue runs, if nothing else is said."""

MAX_VISITS = 1_000
"""The visits of a simulated run of a machine, if nothing else is said: it may go on for ever."""

REGENERATIONS, REGENERATE_FOR_S, ATTEMPTS = 3, 600.0, 3
"""The plans that a model writes behind one that gave up, its seconds, its attempts for each."""

MOST_REGENERATIONS, MOST_S, MOST_ATTEMPTS = 100, 1e6, 100


def max_plans_of(options: Mapping[str, RunValue]) -> int:
    """The number of plans that run, by the heading of a run."""
    most = options.get("max_plans")
    return most if isinstance(most, int) else MAX_PLANS


def attempts_of(options: Mapping[str, RunValue]) -> int:
    """The requests to a model for each plan, by the heading of a run."""
    attempts = options.get("attempts")
    return attempts if type(attempts) is int and 1 <= attempts <= MOST_ATTEMPTS else ATTEMPTS


def policy_of(options: Mapping[str, RunValue]) -> Policy | None:
    """The bounds of continuation, by the heading of a run; None for not at all.

    Never further than the options allow, whatever a journal says.
    """
    continuations, total_s = options.get("regenerations"), options.get("regenerate_for_s")
    if type(continuations) is not int:
        return None
    from gpsfsm.execution.chain import Policy  # few runs ask a model

    wished = total_s if isinstance(total_s, int | float) else MOST_S
    bounded = MOST_S if wished > MOST_S else float(wished)  # no number is left for Policy to refuse
    return Policy(min(continuations, MOST_REGENERATIONS), bounded)


# ---- Permissions: a journal records them and gives none ------------------------------------------

_MOST_SHOWN = 50


def permitted(option: str, texts: Iterable[str]) -> list[str]:
    """The values of a permission, as runners get them.

    Raises UsageError for one that would never allow anything, or something else than it seems to.
    """
    return [_CHECKS[option](text) for text in texts]


def not_permitted(options: Mapping[str, Any], allowed: Mapping[str, list[str]]) -> list[str]:
    """The permissions in the heading of a run that ``allowed`` lacks, as options are written.

    The file of a journal may come from anywhere: that a run was allowed something allows nothing.
    """
    missing = [
        f"--{name.replace('_', '-')} {shlex.quote(text)}"
        for name in PERMISSIONS
        for text in _texts(options.get(name))
        if text not in allowed.get(name, ())
    ]
    more = len(missing) - _MOST_SHOWN
    return [*missing[:_MOST_SHOWN], *([f"and {more} more"] if more > 0 else [])]


def _texts(value: object) -> list[str]:
    return [str(each) for each in value] if isinstance(value, list) else []


def _host(text: str) -> str:
    from gpsfsm.runners.generic.http import allowed_host, shown

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


_CHECKS: dict[str, Callable[[str], str]] = {
    "allow_host": _host,
    "allow_program": _program,
    "allow_function": _function,
    "allow_module": _module,
}
PERMISSIONS = tuple(_CHECKS)
"""The names of the options that headings keep."""
