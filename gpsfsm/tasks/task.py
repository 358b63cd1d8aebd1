"""Tasks: what a plan is asked to do (docs/tasks.md). Plain data; ``load`` reads it from files."""

from __future__ import annotations

from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

from gpsfsm.model.plan import value_key

if TYPE_CHECKING:
    from collections.abc import Callable, Collection

    from gpsfsm.model.plan import Element, Plan, Value
    from gpsfsm.tasks.ltlf import Formula

__all__ = ["DEFAULT_TOLERANCE", "Example", "NodeForm", "Pattern", "Place", "Rule", "Step", "Task"]

DEFAULT_TOLERANCE = 1e-6
"""Numbers that differ by more are different, unless the task says otherwise."""


@dataclass(frozen=True, slots=True)
class Place:
    """A place by name; ``parameters`` say where it is, in what plans say: x and y."""

    name: str
    parameters: tuple[tuple[str, Value], ...]


@dataclass(frozen=True, slots=True)
class Pattern:
    """Which actions are meant; ``name`` is what messages call them.

    ``interfaces`` are globs ((): any interface); one without a slash speaks of the part after the
    last slash. ``parameters`` must be there with these values; numbers may differ by ``tolerance``.
    An action is at ``place`` if its parameters are those of the place, where it has any, or if one
    of them is the place's name.
    """

    name: str
    interfaces: tuple[str, ...] = ()
    parameters: tuple[tuple[str, Value], ...] = ()
    place: Place | None = None
    tolerance: float = DEFAULT_TOLERANCE

    def matches(self, runner: Element, also: str = "") -> bool:
        """Whether the action of a runner is one of these.

        ``also`` is the name of the interface that is described for it, if it is written otherwise:
        what is started counts under both.
        """
        if not self.means(runner.interface, also):
            return False
        given = runner.parameters
        if not self._agree(self.parameters, given):
            return False
        if self.place is None:
            return True
        if self.place.parameters and self._agree(self.place.parameters, given):
            return True
        return any(value == self.place.name for value in given.values() if isinstance(value, str))

    def depends_on(self, runner: Element, unknown: Collection[str], also: str = "") -> bool:
        """Whether values of these names, which only the run shows, decide if it is one of these.

        ``also`` is as in ``matches``.
        """
        if not self.means(runner.interface, also):
            return False
        given = {name: value for name, value in runner.parameters.items() if name not in unknown}
        written = _agreement(self.parameters, unknown, self._agree, given)
        place: bool | None = True
        if self.place is not None and self.place.name not in given.values():
            parameters = self.place.parameters
            place = bool(parameters) and _agreement(parameters, unknown, self._agree, given)
            if place is False and len(given) < len(runner.parameters):
                place = None  # the value may be the name of the place
        return False not in (written, place) and None in (written, place)

    def means(self, interface: str, also: str) -> bool:
        """Whether actions of an interface, as it is written or as it is described, can be meant."""
        return self.accepts(interface) or (also != "" and self.accepts(also))

    def accepts(self, interface: str) -> bool:
        """Whether actions of this interface can be meant."""
        return not self.interfaces or any(_fits(glob, interface) for glob in self.interfaces)

    def _agree(self, wanted: tuple[tuple[str, Value], ...], given: dict[str, Value]) -> bool:
        return all(
            name in given and _same(value, given[name], self.tolerance) for name, value in wanted
        )


def _agreement(
    wanted: tuple[tuple[str, Value], ...],
    unknown: Collection[str],
    agree: Callable[[tuple[tuple[str, Value], ...], dict[str, Value]], bool],
    given: dict[str, Value],
) -> bool | None:
    """Whether all values are as they are wanted; None: those that are unknown decide it."""
    rest = tuple(each for each in wanted if each[0] not in unknown)
    if not agree(rest, given):
        return False
    return None if len(rest) < len(wanted) else True


def _fits(glob: str, interface: str) -> bool:
    name = interface if "/" in glob else interface.rpartition("/")[2]
    return fnmatchcase(name, glob)


def _same(wanted: Value, found: Value, tolerance: float) -> bool:
    numbers = isinstance(wanted, int | float) and isinstance(found, int | float)
    if numbers and not isinstance(wanted, bool) and not isinstance(found, bool):
        assert not isinstance(wanted, str)
        assert not isinstance(found, str)
        try:
            return abs(float(wanted) - float(found)) <= tolerance
        except OverflowError:  # an integer that no float can hold
            return wanted == found
    return value_key(wanted) == value_key(found)


@dataclass(frozen=True, slots=True)
class Step:
    """A step: ``attempts[0]`` is what to do, each other what to do if the one before fails."""

    attempts: tuple[Pattern, ...]


@dataclass(frozen=True, slots=True)
class Rule:
    """A rule: ``formula`` must hold of every run. ``told`` is the rule as it is written.

    ``completed``: only runs that complete must obey it. ``line`` is its place in the task file.
    """

    name: str
    told: str
    formula: Formula
    completed: bool = False
    line: int = 0


@dataclass(frozen=True, slots=True)
class Example:
    """A plan that was shown in the prompt, and so is no answer; ``name`` is that of its file."""

    name: str
    plan: Plan


@dataclass(frozen=True, slots=True)
class NodeForm:
    """A node that behaviour trees may use besides the built-in ones; ``ports`` are its inputs.

    ``compact``: it is written ``<MoveTo …/>`` only, and not ``<Action ID="MoveTo" …/>`` too.
    """

    name: str
    ports: tuple[str, ...] = ()
    compact: bool = False


@dataclass(frozen=True, slots=True)
class Task:
    """What a plan is asked to do.

    ``text``: in words. ``allowed``: actions that may come besides the steps, at any time;
    ``others``: all other actions may. ``patterns``: what rules speak of, by name. ``not_answers``:
    plans that are no answer, such as the example of a prompt. ``nodes``: the nodes that behaviour
    trees may use; (): any.
    """

    text: str = ""
    steps: tuple[Step, ...] = ()
    rules: tuple[Rule, ...] = ()
    allowed: tuple[Pattern, ...] = ()
    others: bool = False
    patterns: tuple[Pattern, ...] = ()
    not_answers: tuple[Example, ...] = field(default=())
    nodes: tuple[NodeForm, ...] = ()
    file: str = "<task>"
