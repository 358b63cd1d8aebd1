"""The validation of fabric-v3: where the required inputs of runners come from, before a run.

Two plugins look at the connections of a plan, one after the other. CompatibilityValidation asks for
each runner whether its provider is one of its interface. ParameterValidation asks for each input
that its provider's file calls ``required: true`` whether something may give it:

- an output of a runner with a connection straight to this one, whatever the event;
- an attribute of the plan, where ``satisfiable_from`` has ``external`` or ``configuration``;
- the parameter that stands in for it, written or with a default, for ``configuration``;
- a default, where ``satisfiable_from`` has ``default``.

An output fits if the types are the same word (or one file does not say), and if one of its name,
semantic key and aliases is one of those of the input. At run time the engine goes by the names
alone, and hands over an output with its event alone: ``unreceived`` tells what is missing then.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.capabilities.library import Match
from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.capability import Source

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.capabilities.library import Library, Resolution
    from gpsfsm.compile.paper import Compiled
    from gpsfsm.model.automaton import Automaton
    from gpsfsm.model.capability import Input, Output, Provider
    from gpsfsm.model.event import Event
    from gpsfsm.model.plan import Element


class Unsatisfied(NamedTuple):
    """The first reason to refuse a plan.

    ``runner`` is the number of an instance; ``wanted`` None: its provider is none of its interface.
    ``giver`` and ``join`` are the instance that hands the input over through that join, whose node
    is meant; None where none does.
    """

    runner: int
    wanted: Input | None = None
    giver: int | None = None
    join: int | None = None


class Taken(NamedTuple):
    """An input that is satisfied by an output: of which instance, with which event."""

    runner: int
    wanted: Input
    giver: int
    output: Output
    event: Event


class Renamed(NamedTuple):
    """An input that is satisfied by an attribute with one of its aliases as its name."""

    runner: int
    wanted: Input
    alias: str


class Validation:
    """The validation of one compiled plan, with what ``library`` says of its runners."""

    def __init__(self, compiled: Compiled, library: Library) -> None:
        self._automaton: Automaton = compiled.automaton
        self._runners = compiled.automaton.plan.runners
        self._library = library
        self._resolutions: dict[tuple[str, str], Resolution] = {}

    def refusal(self) -> Unsatisfied | None:
        """The reason for which the engine does not run the plan; None if it does."""
        for number, runner in enumerate(self._runners):
            if not self._compatible(runner):
                return Unsatisfied(number)
        for number, runner in enumerate(self._runners):
            for wanted in _demands(self._provider(runner)):
                if not self._satisfied(number, wanted):
                    return Unsatisfied(number, wanted, *self._behind_join(number, wanted))
        return None

    def unreceived(self) -> Iterator[Taken | Renamed]:
        """The inputs that are satisfied, and that nothing gives under their names at run time.

        What the plan writes under the name of an input is there then, whatever the file says, and a
        runner knows its own defaults and the parameters that stand in for its inputs.
        """
        for number, runner in enumerate(self._runners):
            written = _attributes(runner)
            for wanted in _demands(self._provider(runner)):
                if wanted.name in written or self._stands_in(runner, wanted):
                    continue
                fitting = list(self._fitting(number, wanted))
                if any(_arrives(each) for each in fitting) or self._may_come(number):
                    continue
                alias = next((alias for alias in wanted.aliases if alias in written), None)
                if alias is not None and reads_plan(wanted):
                    yield Renamed(number, wanted, alias)
                elif fitting:
                    yield fitting[0]

    def _resolution(self, runner: Element) -> Resolution:
        pair = runner.interface, runner.provider
        if pair not in self._resolutions:
            self._resolutions[pair] = self._library.resolve(*pair)
        return self._resolutions[pair]

    def _compatible(self, runner: Element) -> bool:
        """False if the provider surely is none of this interface on the robot.

        Where the library is all there is, names of other dialects mean nothing either.
        """
        match = self._resolution(runner).match
        if match is Match.MISMATCH or not self._library.complete:
            return match is not Match.MISMATCH
        own = self._library.translation(runner.interface) is None
        return own and self._library.provider(runner.provider) is not None

    def _provider(self, runner: Element) -> Provider | None:
        """The provider, if its own file says what it takes and gives."""
        provider = self._resolution(runner).provider
        return (
            provider if provider is not None and provider.described and not provider.lent else None
        )

    def _unknown(self, runner: Element) -> bool:
        """True if nobody has said what a runner hands over."""
        return self._resolution(runner).match is Match.UNDESCRIBED

    def _satisfied(self, number: int, wanted: Input) -> bool:
        if _allows(wanted, Source.UPSTREAM) and (
            any(self._fitting(number, wanted)) or self._may_come(number)
        ):
            return True
        return self._configured(self._runners[number], wanted)

    def _configured(self, runner: Element, wanted: Input) -> bool:
        """True if the plan or a default gives the value, in the eyes of the engine."""
        written = _attributes(runner)
        named = any(name in written for name in (wanted.name, *wanted.aliases))
        return (reads_plan(wanted) and named) or self._stands_in(runner, wanted)

    def _stands_in(self, runner: Element, wanted: Input) -> bool:
        """True if a parameter that stands in for an input is written, or there is a default."""
        provider = self._resolution(runner).provider
        assert provider is not None
        fallback = next(
            (
                parameter
                for parameter in provider.configuration
                if parameter.name == (wanted.fallback or wanted.name)
            ),
            None,
        )
        default = fallback is not None and fallback.default is not None
        configured = fallback is not None and (default or fallback.name in _attributes(runner))
        if configured and _allows(wanted, Source.CONFIGURATION):
            return True
        return _allows(wanted, Source.DEFAULT) and (default or wanted.default is not None)

    def _upstream(self, number: int) -> Iterator[tuple[int, Event]]:
        """The instances with a connection straight to this one."""
        automaton = self._automaton
        for signal in automaton.inputs[automaton.runner_node(number)]:
            if automaton.nodes[signal.node].kind is NodeKind.RUNNER:
                yield automaton.runner_number(signal.node), signal.event

    def _may_come(self, number: int) -> bool:
        return any(self._unknown(self._runners[giver]) for giver, _ in self._upstream(number))

    def _fitting(self, number: int, wanted: Input) -> Iterator[Taken]:
        for giver, event in self._upstream(number):
            for output in self._outputs(giver):
                if fits(output, wanted):
                    yield Taken(number, wanted, giver, output, event)

    def _outputs(self, number: int) -> tuple[Output, ...]:
        provider = self._provider(self._runners[number])
        return () if provider is None else provider.outputs

    def _behind_join(self, number: int, wanted: Input) -> tuple[int | None, int | None]:
        """The nearest instance that has an input, but through a join, and this join.

        Joins are not connected to each other: each is closed before the next is made.
        """
        automaton = self._automaton
        for join, _ in automaton.inputs[automaton.runner_node(number)]:
            if automaton.nodes[join].kind is not NodeKind.JOIN:
                continue
            givers = (automaton.runner_number(source) for source, _ in automaton.inputs[join])
            for giver in sorted(givers, reverse=True):
                if any(fits(output, wanted) for output in self._outputs(giver)):
                    return giver, join
        return None, None


def fits(output: Output, wanted: Input) -> bool:
    """True if the engine takes an output for what an input wants."""
    handed, wants = (each.type_word or each.type.value for each in (output, wanted))
    if handed and wants and handed != wants:
        return False
    return bool(_keys(output) & _keys(wanted))


def _attributes(runner: Element) -> set[str]:
    """The names of all attributes: to the engine, name and id are parameters as well."""
    return {attribute.name for attribute in runner.attributes}


def _keys(value: Input | Output) -> set[str]:
    return {value.name, value.semantic_key, *value.aliases} - {""}


def _allows(wanted: Input, source: Source) -> bool:
    return source in (wanted.satisfiable_from or (Source.UPSTREAM,))


def reads_plan(wanted: Input) -> bool:
    """True if an attribute satisfies an input."""
    return _allows(wanted, Source.CONFIGURATION) or _allows(wanted, Source.EXTERNAL)


def _demands(provider: Provider | None) -> Iterator[Input]:
    return (each for each in (provider.inputs if provider else ()) if each.demanded)


def _arrives(taken: Taken) -> bool:
    return taken.output.name == taken.wanted.name and taken.output.event is taken.event
