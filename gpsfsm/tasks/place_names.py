"""Which places of a task a text names, however it writes them: ``BayA``, ``go_to_bay_a``."""

from __future__ import annotations

import re
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.tasks.task import Pattern, Task

__all__ = ["PlaceNames", "plain_name"]

_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|[0-9]+|[^\W_]+")
_BEFORE = r"(?:(?<![A-Za-z0-9])|(?<=[a-z])(?=[A-Z]))"
_AFTER = r"(?:(?![A-Za-z0-9])|(?=[A-Z][a-z])|(?<=[a-z0-9])(?=[A-Z]))"
_ONE_OF = re.compile(r"\[([^!\]])[^\]]*\]")
_WILD = re.compile(r"[*?\[\]]+")
_MAX_TEXT = 2_000


class PlaceNames:
    """The places that the steps of a task, what it allows and its rules speak of.

    >>> from gpsfsm.tasks.load import read_task
    >>> task = read_task(b"{places: {BayA: {}, BayB: {}}, steps: [{do: BayA, else: BayB}]}")
    >>> PlaceNames(task).named("go_to_bay_a; {BayB} bayer")
    ('BayA', 'BayB')
    """

    def __init__(self, task: Task) -> None:
        self.patterns: dict[str, Pattern] = {}
        self.nodes = tuple(node.name for node in task.nodes)
        self.interfaces: list[str] = []
        for pattern in _patterns(task):
            self.interfaces += [one for one in map(plain_name, pattern.interfaces) if one]
            if pattern.place is not None:
                self.patterns.setdefault(pattern.place.name, pattern)
        longest = sorted(self.patterns, key=lambda name: (-len(name), name))
        self._names = {_key(name): name for name in longest}
        words = (r"[\s_-]*".join(map(re.escape, _WORD.findall(name))) for name in longest)
        found = "|".join(f"(?i:{word})" for word in words if word)
        self._any = re.compile(f"{_BEFORE}(?:{found}){_AFTER}") if found else None

    def named(self, text: str) -> tuple[str, ...]:
        """The places that a text names, in its order; one named twice in a row counts once."""
        found: list[str] = []
        for match in self._any.finditer(text[:_MAX_TEXT]) if self._any else ():
            name = self._names.get(_key(match[0]))
            if name is not None and found[-1:] != [name]:
                found.append(name)
        return tuple(found)

    def at(self, x: float, y: float) -> str:
        """The place with these coordinates, "" if there is none."""
        for name, pattern in self.patterns.items():
            assert pattern.place is not None
            values = dict(pattern.place.parameters)
            if set(values) == {"x", "y"} and all(
                isinstance(value, int | float) and abs(value - given) <= pattern.tolerance
                for value, given in ((values["x"], x), (values["y"], y))
            ):
                return name
        return ""

    def interface(self, place: str) -> str:
        """An interface that the task accepts for a drive to this place: a node, if there is one."""
        pattern = self.patterns.get(place)
        globs = pattern.interfaces if pattern is not None else ()
        node = next((one for one in self.nodes for glob in globs if fnmatchcase(one, glob)), "")
        plain = plain_name(globs[0] if globs else "")
        return node or plain or next(iter((*self.nodes, *self.interfaces)), "Drive")


def _patterns(task: Task) -> Iterator[Pattern]:
    for step in task.steps:
        yield from step.attempts
    yield from task.allowed
    yield from task.patterns


def plain_name(glob: str) -> str:
    """A name that the glob fits, but for one such as ``[!a]``."""
    return _WILD.sub("x", _ONE_OF.sub(r"\1", glob))


def _key(name: str) -> str:
    return re.sub(r"[\W_]+", "", name).lower()
