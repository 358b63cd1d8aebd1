"""Knowledge about runners: interfaces, providers, their parameters, outputs and effects.

Frozen data, as capability files describe them (docs/capabilities.md); the names of the fields are
those of the files. ``Binding`` is what is known about one runner instance of a plan.
"""

from __future__ import annotations

import math
from dataclasses import field
from enum import StrEnum
from typing import TYPE_CHECKING, Final

from gpsfsm.late import dataclass
from gpsfsm.model.event import Event
from gpsfsm.model.plan import value_key
from gpsfsm.model.ros import RosCall, RosSettings

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.model.plan import Attribute, Value

MAX_AMOUNT = 1e12
"""The greatest amount of seconds or joules that is told from "unbounded": some 30,000 years."""


class ValueType(StrEnum):
    """The type of a parameter or an output. ANY: the file does not say."""

    ANY = ""
    STRING = "string"
    BOOL = "bool"
    INT = "int"
    DOUBLE = "double"
    STRINGS = "string[]"
    BOOLS = "bool[]"
    INTS = "int[]"
    DOUBLES = "double[]"


class Source(StrEnum):
    """The sources from which the value of an input may come (``satisfiable_from``)."""

    UPSTREAM = "upstream"
    CONFIGURATION = "configuration"
    EXTERNAL = "external"
    DEFAULT = "default"


class Permission(StrEnum):
    """The kinds of targets that need permission: the ``--allow-…`` of ``gpsfsm run``."""

    PROGRAM = "program"
    HOST = "host"
    FUNCTION = "function"


@dataclass(frozen=True, slots=True)
class Robot:
    """The robot that plans are for, as its profile describes it (docs/robot.md).

    ``engine`` "", ``tolerate`` and ``deadline_s`` None: the profile does not say. ``corners`` are
    those of the area in which it may drive; (): the bounds of x and y are all there is. ``ros``
    says where on the network it is.
    """

    name: str
    file: str = ""
    engine: str = ""
    tolerate: int | None = None
    deadline_s: float | None = None
    corners: tuple[tuple[float, float], ...] = ()
    ros: RosSettings = field(default_factory=RosSettings)


@dataclass(frozen=True, slots=True)
class Parameter:
    """A configuration parameter: what a plan may write as an attribute of the runner.

    ``required``: it must have a value and has no ``default``. ``aliases`` are other names under
    which a plan may give it. ``minimum`` and ``maximum`` bound numbers (inclusive), ``choices``
    are the only texts allowed (empty: any).
    """

    name: str
    type: ValueType = ValueType.ANY
    required: bool = False
    default: Value | None = None
    semantic_key: str = ""
    aliases: tuple[str, ...] = ()
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] = ()
    description: str = ""


@dataclass(frozen=True, slots=True)
class Input:
    """A run-time input: a value that is expected with the event that triggers the runner.

    ``satisfiable_from`` empty means upstream only. ``fallback`` names the configuration parameter
    that stands in for it ("": the one of the same name, if there is one). ``demanded``: the file
    says ``required: true``, which is all that fabric-v3 asks. ``type_word`` is the type as the file
    writes it, where that is not the name of ``type``: that engine compares the words.
    """

    name: str
    type: ValueType = ValueType.ANY
    required: bool = False
    default: Value | None = None
    semantic_key: str = ""
    aliases: tuple[str, ...] = ()
    satisfiable_from: tuple[Source, ...] = ()
    fallback: str = ""
    description: str = ""
    demanded: bool = False
    type_word: str = ""


@dataclass(frozen=True, slots=True)
class Output:
    """A value that the runner hands to its direct successor with ``event``.

    ``optional``: it may be missing. ``status``: it tells how the action went, and nobody need
    read it. ``type_word``: as that of an input.
    """

    name: str
    type: ValueType = ValueType.ANY
    event: Event = Event.SUCCEEDED
    optional: bool = False
    status: bool = False
    semantic_key: str = ""
    aliases: tuple[str, ...] = ()
    description: str = ""
    type_word: str = ""


@dataclass(frozen=True, slots=True)
class Span:
    """An amount between two bounds: a number, or the name of the parameter that holds it.

    Seconds for durations, joules for energy, up to MAX_AMOUNT. ``maximum`` None: unbounded.
    """

    minimum: float | str = 0.0
    maximum: float | str | None = None


@dataclass(frozen=True, slots=True)
class Outcomes:
    """Declared outcomes. ``unless`` names parameters and values: then never_fails does not hold.

    ``never_fails``: neither FAILED nor a missing start. ``may_hang``: it may never end.
    """

    never_fails: bool = False
    never_succeeds: bool = False
    may_hang: bool = False
    unless: tuple[tuple[str, Value], ...] = ()


@dataclass(frozen=True, slots=True)
class PromptBuffer:
    """The runner prompts a model: it fills the buffer ``uuid``, or flushes it if ``flush`` is true.

    ``uuid`` and ``flush`` name parameters; ``answer`` names the output that holds the answer, which
    is empty unless the buffer was flushed ("": none).
    """

    uuid: str
    flush: str
    answer: str = ""


@dataclass(frozen=True, slots=True)
class Effects:
    """The other effects of a runner. ``sets_plan`` names the input that becomes the next plan.

    ``answers`` names the output with an answer on which the outcome does not depend, ``question``
    the parameter that asks for it. ``checks`` names the parameter with a question that decides the
    outcome: the runner succeeds on yes and fails on no.
    """

    prompt_buffer: PromptBuffer | None = None
    sets_plan: str = ""
    answers: str = ""
    question: str = ""
    checks: str = ""


@dataclass(frozen=True, slots=True)
class Interface:
    """An interface, ``package/Name``.

    ``default_provider``: "" if none is declared and no rule gives one. ``deprecated``: why it
    should not be used any more, "" if it may. ``formerly``: names that other dialects use for it.
    ``origin`` is the file that describes it, as messages name it.
    """

    name: str
    description: str = ""
    version: str = ""
    default_provider: str = ""
    deprecated: str = ""
    formerly: tuple[str, ...] = ()
    origin: str = ""


@dataclass(frozen=True, slots=True)
class SemanticInterface:
    """An interface that is another one (``redefines``) with remapped names."""

    name: str
    redefines: str
    namespace: str = ""
    remappings: tuple[tuple[str, str, str], ...] = ()  # kind, from, to
    description: str = ""
    origin: str = ""


@dataclass(frozen=True, slots=True)
class Provider:
    """A runner that implements an interface.

    ``described``: the file says which parameters, inputs and outputs there are. Without that,
    nothing is known of them, which is not the same as "none". ``lent``: they are those of the
    library that this one extends; its own file says nothing of them. ``achieves``: its success is
    what somebody wants a plan for, such as to be at a place (semantics, 5.8).
    """

    name: str
    implements: str
    runner: str = ""
    description: str = ""
    version: str = ""
    command: str = ""
    described: bool = False
    configuration: tuple[Parameter, ...] = ()
    inputs: tuple[Input, ...] = ()
    outputs: tuple[Output, ...] = ()
    depends_on: tuple[tuple[str, str], ...] = ()  # interface, provider
    remappings: tuple[tuple[str, str, str], ...] = ()  # kind, from, to
    outcomes: Outcomes = field(default_factory=Outcomes)
    duration: Span | None = None
    energy: Span | None = None
    resources: tuple[str, ...] = ()
    effects: Effects = field(default_factory=Effects)
    reaches: tuple[tuple[Permission, str], ...] = ()  # what, and the parameter that names it
    achieves: bool = False
    ros: RosCall | None = None  # what it does on a robot
    deprecated: str = ""
    origin: str = ""
    lent: bool = False

    def parameter(self, name: str) -> Parameter | None:
        """The configuration parameter of this name or alias."""
        for each in self.configuration:
            if name == each.name or name in each.aliases:
                return each
        return None

    def names_handed_over(self, event: Event) -> frozenset[str]:
        """The names of the outputs that go with an event."""
        return frozenset(each.name for each in self.outputs if each.event is event)

    def input(self, name: str) -> Input | None:
        """The run-time input of this name."""
        for each in self.inputs:
            if name == each.name:
                return each
        return None


@dataclass(frozen=True, slots=True)
class Filling:
    """A parameter of a runner, and where a leaf of a behaviour tree has its value.

    It is what is written in ``port``, or without one in ``text``. ``parts``: of a text with so many
    parts between semicolons it is this one, counted from 1; 0 stands for any number of parts. Where
    a port or its part is missing, ``text`` is the value. A number is multiplied by ``factor``;
    ``unsigned``: without its sign.
    """

    parameter: str
    port: str = ""
    text: str | None = None
    parts: tuple[tuple[int, int], ...] = ()
    factor: float = 1.0
    unsigned: bool = False


@dataclass(frozen=True, slots=True)
class Leaf:
    """The runner that a leaf of behaviour trees stands for in a simulation.

    ``words`` are texts of its ports, and what they mean: ``kitchen``, ``4;1``.
    """

    name: str
    runner: str
    fillings: tuple[Filling, ...] = ()
    words: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Binding:
    """The knowledge about one runner instance.

    ``written`` holds the attributes of the plan, by the name of the parameter (not by an
    alias); attributes that the provider does not know are under their own name. ``arriving`` are
    the names under which something arrives, always or sometimes; None: anything may. It is empty
    until the plan is compiled, which shows what leads to the instance. ``semantic`` is the semantic
    interface that the plan names, "" if it names ``interface`` itself.
    """

    interface: Interface
    provider: Provider
    written: Mapping[str, Attribute]
    arriving: frozenset[str] | None = frozenset()
    semantic: str = ""

    def value(self, name: str) -> Value | None:
        """The value that the plan writes for a parameter, else its default; None without either."""
        attribute = self.written.get(name)
        if attribute is not None:
            return attribute.value
        parameter = self.provider.parameter(name)
        return None if parameter is None else parameter.default

    def settled(self, name: str) -> bool:
        """True if the value of this name is the same in every run: nothing may arrive."""
        return self.arriving is not None and name not in self.arriving

    def readings(self, name: str) -> tuple[Value, ...]:
        """The value of this name if nothing arrives (semantics, 8.2); () if there is none.

        A run has the first. Of a text that no type tells how to read, the other reading follows.
        """
        expected = self.provider.input(name)
        if expected is None:
            return self._configured(name)
        attribute, stand_in = self.written.get(name), expected.fallback
        values: tuple[Value, ...]
        if attribute is not None:
            values = _read(attribute, expected.type)
        elif stand_in in self.written:
            values = self._configured(stand_in)
        elif expected.default is not None:
            values = (expected.default,)
        else:
            values = self._configured(name) or self._configured(stand_in)
        return tuple(fitting(value, expected.type) for value in values)

    def _configured(self, name: str) -> tuple[Value, ...]:
        """The readings of what the plan writes for a parameter, else its default."""
        attribute, parameter = self.written.get(name), self.provider.parameter(name)
        wanted = ValueType.ANY if parameter is None else parameter.type
        if attribute is not None:
            values = _read(attribute, wanted)
            untyped = parameter is not None and wanted is ValueType.ANY
            return values[::-1] if untyped else values  # a run hands it over as it is written
        default = None if parameter is None else parameter.default
        return () if default is None else (fitting(default, wanted),)

    def worked_with(self, name: str) -> Value | None:
        """The value of this name in a run if nothing arrives; None if there is none."""
        return next(iter(self.readings(name)), None)

    @property
    def never_fails(self) -> bool:
        """True if this instance is declared never to fail, whatever arrives."""
        outcomes = self.provider.outcomes
        return outcomes.never_fails and not any(
            not self.settled(name)
            or any(value_key(reading) == value_key(value) for reading in self.readings(name))
            for name, value in outcomes.unless
        )

    @property
    def duration(self) -> tuple[float, float] | None:
        """The least and the greatest duration in seconds; None if none is declared.

        The least is at most MAX_AMOUNT; a greatest of MAX_AMOUNT or more counts as unbounded.
        """
        return self._span(self.provider.duration)

    @property
    def energy(self) -> tuple[float, float] | None:
        """The least and the greatest energy in joules, as for durations."""
        return self._span(self.provider.energy)

    def _span(self, span: Span | None) -> tuple[float, float] | None:
        if span is None:
            return None
        least = min(self._number(span.minimum, 0.0), MAX_AMOUNT)
        greatest = math.inf if span.maximum is None else self._number(span.maximum, math.inf)
        greatest = max(least, greatest)
        return least, greatest if greatest < MAX_AMOUNT else math.inf

    def _number(self, amount: float | str, unknown: float) -> float:
        """An amount; ``unknown`` where the parameter has no usable number in every run."""
        value: Value | None
        if isinstance(amount, str):
            value = self.worked_with(amount) if self.settled(amount) else None
        else:
            value = amount
        if isinstance(value, bool) or not isinstance(value, int | float):
            return unknown
        return float(value) if 0 <= value < math.inf else unknown


def _read(attribute: Attribute, wanted: ValueType) -> tuple[Value, ...]:
    """The text as it is written or its typed value, as the type asks for; without a type both."""
    if wanted is ValueType.STRING:
        return (attribute.text,)
    value = fitting(attribute.value, wanted)
    if wanted is not ValueType.ANY or value == attribute.text:
        return (value,)
    return value, attribute.text


def fitting(value: Value, wanted: ValueType) -> Value:
    """A whole number where a double is wanted is one; everything else stays as it is."""
    if wanted is ValueType.DOUBLE and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    return value


# --- choices and moments: the two runners that machines have of their own ------------------------

CHOICE: Final = "gpsfsm/ChoiceRunner"
"""The interface, and the provider, of a choice; its parameter ``of`` says what is chosen.

A runner has two outcomes. What other tools say with more, or with what a machine does not know (a
value on a blackboard, a clock), becomes a *choice*: it holds (SUCCEEDED) or it does not (FAILED),
and nobody knows which. Of n outcomes, n - 1 choices in a row choose one:

    NAV  SUCCEEDED → target of "arrived";  FAILED → choice "NAV: blocked"
    choice "NAV: blocked"  SUCCEEDED → target of "blocked";  FAILED → target of "lost"
"""

TICK: Final = "gpsfsm/TickRunner"
"""The interface, and the provider, of a *tick*, a moment that passes: it always succeeds.

A loop in which nothing acts has one, since a loop passes through an outcome (semantics, 9.1).
"""


def _described(
    name: str,
    description: str,
    outcomes: Outcomes,
    duration: Span,
    configuration: tuple[Parameter, ...] = (),
) -> tuple[Interface, Provider]:
    interface = Interface(name, description, "1", name)
    provider = Provider(
        name,
        name,
        description=description,
        version="1",
        described=True,
        configuration=configuration,
        outcomes=outcomes,
        duration=duration,
    )
    return interface, provider


_OF = Parameter("of", ValueType.STRING, required=True, description="What is chosen.")

OWN: Final[Mapping[str, tuple[Interface, Provider]]] = {
    CHOICE: _described(
        CHOICE, "Holds or does not; nothing says which.", Outcomes(), Span(0.0, None), (_OF,)
    ),
    TICK: _described(TICK, "A moment that passes.", Outcomes(never_fails=True), Span(0.0, 0.0)),
}
"""Both by their names, described. No file describes them, and no model is offered them.

A choice may be one about a value, made at once, or a clock: it takes any time.
"""
