"""Tasks: what a plan is asked to do (docs/tasks.md). Plain data; ``load`` reads it from files."""

from __future__ import annotations

from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

from gpsfsm.model.plan import value_key
from gpsfsm.tasks.acting import Acting

if TYPE_CHECKING:
    from collections.abc import Collection

    from gpsfsm.model.capability import Binding
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
    Their names may be aliases. An action is at ``place`` if its parameters are those of the place,
    where it has any, or if one of them is the place's name.
    """

    name: str
    interfaces: tuple[str, ...] = ()
    parameters: tuple[tuple[str, Value], ...] = ()
    place: Place | None = None
    tolerance: float = DEFAULT_TOLERANCE

    def matches(self, runner: Element, binding: Binding | None = None) -> bool:
        """Whether the action of a runner is one of these.

        ``binding``: what is known of it. It counts under the name that it has there as well, and
        with the values that it works with if nothing arrives: aliases and defaults count.
        """
        return self._means(Acting(runner, binding), ()) is True

    def depends_on(
        self, runner: Element, unknown: Collection[str], binding: Binding | None = None
    ) -> bool:
        """Whether values of these names, which only the run shows, decide if it is one of these.

        ``binding`` is as in ``matches``; the names are those of the provider, not aliases.
        """
        return self._means(Acting(runner, binding), unknown) is None

    def _means(self, acting: Acting, unknown: Collection[str]) -> bool | None:
        """Whether an action is one of these; None: values of these names decide it."""
        if not self.accepts(acting.interface) and not (
            acting.described and self.accepts(acting.described)
        ):
            return False
        answers = (
            self._agree(self.parameters, acting, unknown),
            self._is_there(acting, unknown),
        )
        return None if None in answers and False not in answers else all(answers)

    def _is_there(self, acting: Acting, unknown: Collection[str]) -> bool | None:
        """Whether an action is at the place."""
        if self.place is None:
            return True
        settled = (name for name in acting.names() if name not in unknown)
        if any(self.place.name == value for name in settled for value in acting.values(name)):
            return True
        parameters = self.place.parameters
        found = bool(parameters) and self._agree(parameters, acting, unknown)
        if found is False and any(name in unknown for name in acting.names()):
            return None  # the value may be the name of the place
        return found

    def accepts(self, interface: str) -> bool:
        """Whether actions of this interface can be meant."""
        return not self.interfaces or any(_fits(glob, interface) for glob in self.interfaces)

    def _agree(
        self, wanted: tuple[tuple[str, Value], ...], acting: Acting, unknown: Collection[str]
    ) -> bool | None:
        """Whether all values are as they are wanted; None: those that are unknown decide it."""
        named = [(acting.name_of(name), value) for name, value in wanted]
        rest = [(name, value) for name, value in named if name not in unknown]
        for name, value in rest:
            if not any(_same(value, found, self.tolerance) for found in acting.values(name)):
                return False
        return None if len(rest) < len(named) else True


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
