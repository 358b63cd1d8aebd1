"""What is known about runners (semantics, section 8), and the runs of a plan under it.

``Described`` says neutrally what a capability file says about one provider of one interface.
``World`` is a plan with such descriptions under scenario options; the modules ``values``,
``buffers``, ``orders`` and ``clocks`` answer the questions of section 8 about a world.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, cast

from .model import R, _typed, place
from .runs import FAILED, HANG, NO_START, SUCCEEDED, Predicate, Run, System

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from .graph import RunnerNode
    from .model import P

Value = bool | int | float | str
UPSTREAM, CONFIGURATION, EXTERNAL = "upstream", "configuration", "external"
ALWAYS, SOMETIMES, NEVER = "always", "sometimes", "never"


class _Brief:
    """Data whose representation leaves out what is as ever, for the reports of Hypothesis."""

    __slots__ = ()

    def __repr__(self) -> str:
        said = [
            f"{one.name}={getattr(self, one.name)!r}"
            for one in fields(cast("Any", self))
            if getattr(self, one.name) != one.default
        ]
        return f"{type(self).__name__}({', '.join(said)})"


@dataclass(frozen=True, slots=True, repr=False)
class Parameter(_Brief):
    """A configuration parameter; a ``required`` one has no default. ``type`` "": it has none."""

    name: str
    required: bool = False
    default: Value | None = None
    type: str = ""


@dataclass(frozen=True, slots=True, repr=False)
class Input(_Brief):
    """A run-time input; ``sources`` is what ``satisfiable_from`` holds."""

    name: str
    required: bool = False
    default: Value | None = None
    sources: tuple[str, ...] = ()
    fallback: str = ""
    type: str = ""


@dataclass(frozen=True, slots=True, repr=False)
class Output(_Brief):
    """A value that is handed over with ``event``, SUCCEEDED or FAILED."""

    name: str
    event: str = SUCCEEDED
    optional: bool = False
    status: bool = False
    type: str = ""


@dataclass(frozen=True, slots=True, repr=False)
class Prompt(_Brief):
    """The names of the parameters and of the output of a runner that prompts a model."""

    uuid: str = "uuid"
    flush: str = "flush"
    answer: str = ""


Amount = float | str  # a number, or the name of the parameter that holds it
Bounds = tuple[Amount, Amount | None]


@dataclass(frozen=True, slots=True, repr=False)
class Described(_Brief):
    """What a capability file says about one provider of one interface."""

    interface: str
    provider: str = "demo_runners/Demo"
    parameters: tuple[Parameter, ...] = ()
    inputs: tuple[Input, ...] = ()
    outputs: tuple[Output, ...] = ()
    prompt: Prompt | None = None
    sets_plan: str = ""
    resources: tuple[str, ...] = ()
    duration: Bounds | None = None
    energy: Bounds | None = None
    never_fails: bool = False
    unless: tuple[tuple[str, Value], ...] = ()
    never_succeeds: bool = False
    may_hang: bool = False
    achieves: bool = False

    def parameter(self, name: str) -> Parameter | None:
        return next((parameter for parameter in self.parameters if parameter.name == name), None)

    def input(self, name: str) -> Input | None:
        return next((each for each in self.inputs if each.name == name), None)

    def knows(self, name: str) -> bool:
        return self.parameter(name) is not None or self.input(name) is not None


@dataclass(frozen=True, slots=True)
class Instance:
    """One runner instance: its node, what is known about it, what the plan writes.

    ``arrives`` tells how often which names arrive; None if nobody knows.
    """

    node: RunnerNode
    runner: R
    described: Described | None
    written: Mapping[str, str]
    arrives: Mapping[str, str] | None

    @property
    def path(self) -> str:
        return self.node.path

    def configured(self, name: str) -> Value | None:
        """The attribute of this name, else the default of the parameter; None: neither."""
        if name in self.written:
            return read(self.written[name])
        parameter = self.described.parameter(name) if self.described else None
        return parameter.default if parameter else None

    def unknown(self, name: str) -> bool:
        """The value of this name arrives, always or sometimes, or may arrive (8.2)."""
        return self.arrives is None or name in self.arrives

    def readings(self, name: str) -> tuple[Value, ...]:
        """The values that this name counts with (8.2) where nothing arrives; a run has the first.

        Two where what the plan writes has no type.
        """
        entry = self.described.input(name) if self.described else None
        if name in self.written:
            return self._read_as(name, self.written[name], entry)
        if entry is not None:
            if entry.fallback in self.written:
                return self._read_as(entry.fallback, self.written[entry.fallback], None)
            if entry.default is not None:
                return (entry.default,)
        default = self.configured(name)
        if default is None and entry is not None and entry.fallback:
            default = self.configured(entry.fallback)
        return () if default is None else (default,)

    def _read_as(self, name: str, text: str, entry: Input | None) -> tuple[Value, ...]:
        parameter = self.described.parameter(name) if self.described else None
        one = entry or parameter
        if one is not None and one.type:
            return (text,) if one.type == "string" else (read(text),)
        return (text, read(text)) if one is parameter and one is not None else (read(text), text)

    def works_with(self, name: str) -> Value | None:
        """The value of this name that a run has where nothing arrives; None: there is none."""
        return next(iter(self.readings(name)), None)

    def bounds(self, declared: Bounds | None) -> tuple[float, float]:
        """The bounds of a duration or an energy of this instance, ``inf`` for unbounded."""
        if declared is None:
            return 0.0, float("inf")
        least, greatest = declared
        most = None if greatest is None else self._amount(greatest)
        return self._amount(least) or 0.0, float("inf") if most is None else most

    def _amount(self, amount: Amount) -> float | None:
        if isinstance(amount, str):
            value = None if self.unknown(amount) else self.works_with(amount)
        else:
            value = amount
        return None if isinstance(value, bool | str | None) else float(value)

    def outcomes(self) -> set[str]:
        """The outcomes that section 8.1 leaves, apart from what the fault models allow."""
        left = {SUCCEEDED, FAILED, NO_START, HANG}
        described = self.described
        if described is None:
            return left
        broken = any(
            self.unknown(name) or any(same(reading, value) for reading in self.readings(name))
            for name, value in described.unless
        )
        if described.never_fails and not broken:
            left -= {FAILED, NO_START}
        if described.never_succeeds:
            left -= {SUCCEEDED}
        return left


def arrives_at(
    node: RunnerNode, runners: Iterable[RunnerNode], entries: Mapping[str, Described | None]
) -> Mapping[str, str] | None:
    """How often which names arrive at an instance that is triggered; None if nobody knows."""
    for other in runners:
        for event, signal in ((SUCCEEDED, other.succeeded), (FAILED, other.failed)):
            if node.trigger == signal:
                giver = entries[other.path]
                if giver is None:
                    return None
                return {
                    output.name: SOMETIMES if output.optional else ALWAYS
                    for output in giver.outputs
                    if output.event == event
                }
    return {}


def read(text: str) -> Value:
    """The typed value of an attribute (section 1)."""
    value = _typed(text)[1]
    assert isinstance(value, bool | int | float | str)
    return value


def same(one: Value | None, other: Value | None) -> bool:
    """Equal as values: a Boolean never equals a number."""
    if isinstance(one, bool) != isinstance(other, bool):
        return False
    return one == other


class World:
    """A plan, what is known about its runners, and the runs that the options allow.

    ``runs`` holds one run for each set of signals that occurs: runs with the same signals differ
    in outcomes that are never asked for. It is empty if the options contradict each other.
    """

    def __init__(
        self,
        whole: P,
        library: Iterable[Described],
        *,
        faults: frozenset[str] = frozenset(),
        consistent: bool = False,
        constraint: Predicate | None = None,
    ) -> None:
        described = {
            (capabilities.interface, capabilities.provider): capabilities
            for capabilities in library
        }
        runners = {at.path: at.node for at in place(whole).walk() if isinstance(at.node, R)}
        values = {
            path: described.get((runner.interface, runner.provider))
            for path, runner in runners.items()
        }
        may_hang = any(one is not None and one.may_hang for one in values.values())
        #: the fault models with which the oracle of section 5 plays the same scenarios
        self.faults = faults | {"hang"} if may_hang else faults
        self.system = System(whole, self.faults)
        self.instances = tuple(
            Instance(
                node,
                runners[node.path],
                values[node.path],
                dict(runners[node.path].parameters),
                arrives_at(node, self.system.graph.runners, values),
            )
            for node in self.system.graph.runners
        )
        self._hang = "hang" in faults
        self._constraint = constraint
        allowed = self.system.allowed(consistent=consistent, constraint=self.allows)
        self.runs: tuple[Run, ...] = tuple({run.fired: run for run in allowed}.values())

    def allows(self, scenario: Mapping[str, str]) -> bool:
        """Whether declared outcomes and the constraint allow the scenario."""
        for instance in self.instances:
            outcome = scenario[instance.path]
            if outcome not in instance.outcomes():
                return False
            hangs = instance.described is not None and instance.described.may_hang
            if outcome == HANG and not self._hang and not hangs:
                return False
        return self._constraint is None or self._constraint(scenario)

    @property
    def reachable(self) -> tuple[Instance, ...]:
        """The instances that some run triggers."""
        return tuple(
            instance
            for instance in self.instances
            if any(run.fired & instance.node.trigger for run in self.runs)
        )

    def instance(self, path: str) -> Instance:
        return self.instances[self.system.index[path]]
