"""Tasks: what a plan is asked to do (docs/tasks.md). Plain data; ``load`` reads it from files."""

from __future__ import annotations

from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from functools import cached_property
from typing import TYPE_CHECKING

from gpsfsm.model.plan import NOT_PARAMETERS, value_key

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

    from gpsfsm.compile.units import MachinePlan, TreeMachine, TreePlan
    from gpsfsm.model.capability import Binding, Provider
    from gpsfsm.model.plan import Attribute, Element, Plan, Value
    from gpsfsm.tasks.ltlf import Formula

DEFAULT_TOLERANCE = 1e-6
"""Numbers that differ by more are different, unless the task says otherwise."""


@dataclass(frozen=True, slots=True)
class Place:
    """A place by name; ``parameters`` say where it is, in what plans say: x and y."""

    name: str
    parameters: tuple[tuple[str, Value], ...]


@dataclass(frozen=True, slots=True)
class Pattern:
    """A pattern of actions; ``name`` is what messages call them.

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
        """True if the action of a runner is one of these.

        ``binding``: what is known of it. It counts under the name that it has there as well, and
        with the values that it works with if nothing arrives: aliases and defaults count.
        """
        return self.means(Acting(runner, binding))

    def means(self, acting: Acting) -> bool:
        """The same of an action whose parameters are known."""
        return self._means(acting, ()) is True

    def depends_on(
        self, runner: Element, unknown: Collection[str], binding: Binding | None = None
    ) -> bool:
        """True if values of these names, which only the run shows, decide if it is one of these.

        ``binding`` is as in ``matches``; the names are those of the provider, not aliases.
        """
        return self._means(Acting(runner, binding), unknown) is None

    def _means(self, acting: Acting, unknown: Collection[str]) -> bool | None:
        """True if an action is one of these; None: values of these names decide it."""
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
        """True if an action is at the place."""
        if self.place is None:
            return True
        if self.place.name in (acting.texts_but(unknown) if unknown else acting.texts):
            return True
        parameters = self.place.parameters
        agrees = bool(parameters) and self._agree(parameters, acting, unknown)
        if agrees is False and any(name in unknown for name in acting.names()):
            return None  # the value may be the name of the place
        return agrees

    def accepts(self, interface: str) -> bool:
        """True if actions of this interface can be meant."""
        return not self.interfaces or any(_fits(glob, interface) for glob in self.interfaces)

    def _agree(
        self, wanted: tuple[tuple[str, Value], ...], acting: Acting, unknown: Collection[str]
    ) -> bool | None:
        """True if all values are as they are wanted; None: those that are unknown decide it."""
        named = [(acting.name_of(name), value) for name, value in wanted]
        rest = [(name, value) for name, value in named if name not in unknown]
        for name, value in rest:
            if not any(_same(value, actual, self.tolerance) for actual in acting.values(name)):
                return False
        return None if len(rest) < len(named) else True


def _fits(glob: str, interface: str) -> bool:
    name = interface if "/" in glob else interface.rpartition("/")[2]
    return fnmatchcase(name, glob)


def _same(wanted: Value, actual: Value, tolerance: float) -> bool:
    numbers = isinstance(wanted, int | float) and isinstance(actual, int | float)
    if numbers and not isinstance(wanted, bool) and not isinstance(actual, bool):
        assert not isinstance(wanted, str)
        assert not isinstance(actual, str)
        try:
            return abs(float(wanted) - float(actual)) <= tolerance
        except OverflowError:  # an integer that no float can hold
            return wanted == actual
    return value_key(wanted) == value_key(actual)


@dataclass(frozen=True, slots=True)
class Step:
    """A step: ``attempts[0]`` is what to do, each other what to do if the one before fails."""

    attempts: tuple[Pattern, ...]


@dataclass(frozen=True, slots=True)
class Rule:
    """A rule: ``formula`` must hold of every run. ``phrase`` is the rule as it is written.

    ``completed``: only runs that complete must obey it. ``line`` is its place in the task file.
    """

    name: str
    phrase: str
    formula: Formula
    completed: bool = False
    line: int = 0


@dataclass(frozen=True, slots=True)
class Example:
    """A plan that was shown in the prompt, and so is no answer; ``name`` is that of its file."""

    name: str
    plan: Plan | TreePlan | MachinePlan | TreeMachine


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
    """A task: everything that a plan has to do.

    - ``text``: the task in words.
    - ``allowed``: actions that are permitted at any time besides the steps; ``others``: all actions
      are.
    - ``patterns``: the actions that rules refer to, by name.
    - ``not_answers``: plans that do not count as an answer, such as the example in a prompt.
    - ``nodes``: the nodes that behaviour trees may use; (): any.
    - ``sha256``: the digest of the file in hexadecimal; "" without a file.
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
    sha256: str = ""


class Acting:
    """The parameters of an instance by the names of its provider.

    Without a binding nothing is said of the runner: its attributes are all that it has.
    """

    def __init__(self, runner: Element, binding: Binding | None = None) -> None:
        self._binding = binding
        self._written: dict[str, Attribute] = {
            self.name_of(each.name): each
            for each in runner.attributes
            if each.name not in NOT_PARAMETERS
        }
        if binding is not None:
            self._written.update(binding.written)
        self.interface = runner.interface
        self.described = "" if binding is None else binding.interface.name

    def name_of(self, name: str) -> str:
        """The name of the parameter that goes by this name, which may be an alias."""
        parameter = None if self._binding is None else self._binding.provider.parameter(name)
        return name if parameter is None else parameter.name

    def values(self, name: str) -> Iterator[Value]:
        """The value that it works with, also as it looks where that is a text (8.2)."""
        attribute = self._written.get(name)
        if attribute is not None:
            yield attribute.value
        if self._binding is not None:
            yield from self._binding.readings(name)

    @cached_property
    def texts(self) -> frozenset[str]:
        """All values that are texts."""
        return self.texts_but(())

    def texts_but(self, unknown: Collection[str]) -> frozenset[str]:
        """The values that are texts, but for those of some names."""
        settled = (name for name in self.names() if name not in unknown)
        values = (value for name in settled for value in self.values(name))
        return frozenset(value for value in values if isinstance(value, str))

    def names(self) -> Iterator[str]:
        """The names of all that it may have a value for."""
        yield from self._written
        if self._binding is not None:
            yield from _names(self._binding.provider)


def _names(provider: Provider) -> Iterator[str]:
    for parameter in provider.configuration:
        yield parameter.name
    for expected in provider.inputs:
        yield expected.name
