"""Whether two instances of one runner that act at once disturb each other: for the test kit."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Protocol

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.execution.records import RunValue

__all__ = ["Attempt", "End", "breach", "changed"]


class End(NamedTuple):
    """How an instance has ended: ``what`` it has returned, or why it has failed, in words."""

    succeeded: bool
    what: str


class Attempt(Protocol):
    """Lets two instances act at once, with these parameters; None for one that does nothing."""

    def __call__(self, *each: Mapping[str, RunValue] | None) -> Mapping[int, End]:
        """How they have ended, by their numbers."""


def breach(
    attempt: Attempt,
    given: tuple[Mapping[str, RunValue], Mapping[str, RunValue]],
    *,
    exact: bool,
    exclusive: bool,
) -> str:
    """What one does otherwise than alone, in words; "" for nothing.

    Not ``exact``: only whether it succeeds counts, not with what. ``exclusive``: one may fail
    because of the other.
    """
    first, second = given
    alone = [attempt(first, None).get(0), attempt(None, second).get(1)]
    if alone[1] is None:  # with what was made from the first ones it has no end
        second, alone[1] = first, attempt(None, first).get(1)
    both = attempt(first, second)
    for number, parameters in enumerate((first, second)):
        expected, found = alone[number], both.get(number)
        if found == expected:
            continue
        if found is None:
            return "one never ends"
        if exclusive and not found.succeeded:
            continue
        same = expected is not None and found.succeeded == expected.succeeded
        if same and not (exact and found.succeeded):
            continue
        return (
            f"the one with {dict(parameters)} ends otherwise than alone: it {_told(found)}, alone "
            f"it {_told(expected)}. What belongs to one step must not be kept in self; a runner "
            "that can do one thing at a time waits, or its provider names a resource"
        )
    return ""


def changed(parameters: Mapping[str, RunValue]) -> dict[str, RunValue]:
    """Other parameters of the same types.

    >>> changed({"x": 1, "names": ["a"], "fast": True})
    {'x': 2, 'names': ['a 2'], 'fast': True}
    """
    return {name: _changed(value) for name, value in parameters.items()}


def _changed(value: RunValue) -> RunValue:
    if isinstance(value, list):
        return [_changed(item) for item in value]
    if isinstance(value, str):
        return f"{value} 2"
    return value if isinstance(value, bool) else value + 1


def _told(end: End | None) -> str:
    if end is None:
        return "has no end"
    return f"returns {end.what}" if end.succeeded else f"fails: {end.what}"
