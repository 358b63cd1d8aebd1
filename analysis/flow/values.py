"""What arrives at each runner instance, and what it needs (semantics, section 8.2).

Values travel along one connection, so this is read off the automaton; whether the connection is
ever used is for the deciders to say.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, NamedTuple

from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.capability import Source
from gpsfsm.model.event import Event

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from gpsfsm.compile import Compiled
    from gpsfsm.model.capability import Binding, Output, Provider
    from gpsfsm.model.plan import Value

__all__ = ["How", "Need", "Values", "knows", "needs"]

How = Literal["always", "sometimes"]


class Need(NamedTuple):
    """A value that an instance cannot do without.

    ``literal``: an attribute of the plan meets it; ``arriving``: a value from upstream does;
    ``fallback`` is the parameter whose attribute or default stands in for it ("": none).
    """

    name: str
    kind: Literal["parameter", "input"]
    arriving: bool
    literal: bool
    fallback: str


def needs(provider: Provider) -> tuple[Need, ...]:
    """The needs of a provider, parameters first, in the order of its file."""
    named = {found.name for found in provider.inputs}
    found = [
        Need(parameter.name, "parameter", arriving=True, literal=True, fallback="")
        for parameter in provider.configuration
        if parameter.required and parameter.default is None and parameter.name not in named
    ]
    for expected in provider.inputs:
        if not expected.required or expected.default is not None:
            continue
        allowed = expected.satisfiable_from
        configured = Source.CONFIGURATION in allowed
        found.append(
            Need(
                expected.name,
                "input",
                arriving=not allowed or Source.UPSTREAM in allowed,
                literal=configured or Source.EXTERNAL in allowed,
                fallback=(expected.fallback or expected.name) if configured else "",
            )
        )
    return tuple(found)


def knows(binding: Binding, name: str) -> bool:
    """Whether the instance reads a value of this name, if it arrives."""
    provider = binding.provider
    parameter = provider.parameter(name)
    return provider.input(name) is not None or (parameter is not None and parameter.name == name)


class Values:
    """What arrives at the instances of a compiled plan.

    ``arriving[number]`` are the outputs by name; None where an undescribed instance may hand over
    anything. ``source[number]`` is the number of the instance whose ``event[number]`` triggers the
    instance, -1 and None if a join or the start does. With STARTED a source hands over nothing.
    """

    def __init__(self, compiled: Compiled) -> None:
        self.bindings: Sequence[Binding | None] = compiled.bindings
        self._needs: dict[int, tuple[Need, ...]] = {}  # by the identity of the provider
        self._outputs: dict[tuple[int, Event], Mapping[str, Output]] = {}
        automaton = compiled.automaton
        self.arriving: list[Mapping[str, Output] | None] = []
        self.source: list[int] = []
        self.event: list[Event | None] = []
        for node in automaton.runners:
            source, event = -1, None
            outputs: Mapping[str, Output] | None = _NOTHING
            for signal in automaton.inputs[node.index]:
                if automaton.nodes[signal.node].kind is NodeKind.RUNNER:
                    source, event = automaton.runner_number(signal.node), signal.event
                    outputs = self._handed_over(source, event)
            self.source.append(source)
            self.event.append(event)
            self.arriving.append(outputs)

    def _handed_over(self, number: int, event: Event) -> Mapping[str, Output] | None:
        if event is Event.STARTED:
            return _NOTHING
        binding = self.bindings[number]
        if binding is None:
            return None
        key = id(binding.provider), event
        if key not in self._outputs:
            outputs = binding.provider.outputs
            self._outputs[key] = {found.name: found for found in outputs if found.event is event}
        return self._outputs[key]

    def needs(self, binding: Binding) -> tuple[Need, ...]:
        """The needs of an instance, whether or not they are met."""
        key = id(binding.provider)
        if key not in self._needs:
            self._needs[key] = needs(binding.provider)
        return self._needs[key]

    def unmet(self, number: int) -> Iterator[tuple[Need, How]]:
        """The needs of an instance that are missing in some run that triggers it."""
        binding, arriving = self.bindings[number], self.arriving[number]
        if binding is None:
            return
        for need in self.needs(binding):
            if need.literal and need.name in binding.given:
                continue
            if need.fallback and binding.value(need.fallback) is not None:
                continue
            if need.arriving and arriving is None:
                continue  # it may come from an undescribed instance
            output = arriving.get(need.name) if need.arriving and arriving else None
            if output is None:
                yield need, "always"
            elif output.optional:
                yield need, "sometimes"

    def known(self, number: int, name: str) -> Value | None:
        """The value that the instance works with, if it is the same in every run and known.

        None also where there is none.
        """
        binding = self.bindings[number]
        if binding is None or not binding.settled(name):
            return None
        return binding.worked_with(name)


_NOTHING: Mapping[str, Output] = {}
