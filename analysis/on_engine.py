"""The plan as the paper reads it and on an engine: what rules about engines see (GP7xx)."""

from __future__ import annotations

from dataclasses import replace
from enum import Enum
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.late import dataclass
from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import End, Event
from gpsfsm.model.finding import Severity
from gpsfsm.model.report import Frequency
from gpsfsm.model.story import Vocabulary

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.analysis.context import Context
    from gpsfsm.analysis.decide import Decided
    from gpsfsm.compile import Compiled
    from gpsfsm.model.engine import Parameter
    from gpsfsm.model.finding import Scenario


class Loss(Enum):
    """The reason why a runner that the paper reaches is never triggered on an engine."""

    NO_STARTED = "it waits for a STARTED that is never emitted"
    JOIN_EVENT = "it waits for an event that no join emits"
    JOIN_WAITS = "it waits for a join that never fires"
    UNCONNECTED = "nothing is connected to it"


class Cause(NamedTuple):
    """``node``: the runner (NO_STARTED, UNCONNECTED: the first that is lost) or the join."""

    loss: Loss
    node: int


@dataclass(frozen=True, slots=False, eq=False)
class OnEngine:
    """Two contexts of one plan: what it means, and what the engine makes of it.

    ``parameters`` are, per runner instance, the attributes as the engine stores them. ``same``: the
    plan runs there step by step as the paper has it.
    """

    name: str
    paper: Context
    context: Context
    parameters: Sequence[Sequence[Parameter]]
    same: bool = False

    @cached_property
    def lost(self) -> Mapping[Cause, tuple[int, ...]]:
        """The runners that the paper reaches and the engine does not, by cause.

        Runner numbers ascend; causes come in the order of their first runner.
        Raises InconclusiveError at a limit.
        """
        reached = self._reached
        meant = set(range(len(reached))).difference(self.paper.answers["reachability"] or ())
        causes: dict[int, Cause] = {}
        lost: dict[Cause, list[int]] = {}
        for number in range(len(reached)):
            if reached[number]:
                continue
            cause = causes[number] = self._cause(number, causes)
            if number in meant:
                lost.setdefault(cause, []).append(number)
        return {cause: tuple(numbers) for cause, numbers in lost.items()}

    @cached_property
    def _reached(self) -> Sequence[bool]:
        unreachable = set(self.context.answers["reachability"] or ())
        return [number not in unreachable for number in range(len(self.context.plan.runners))]

    def _cause(self, number: int, earlier: Mapping[int, Cause]) -> Cause:
        """The reason why a runner is lost; its only input comes from a node before it."""
        automaton = self.context.automaton
        node = automaton.runner_node(number)
        signal = next(iter(automaton.inputs[node]), None)
        if signal is None:
            return Cause(Loss.UNCONNECTED, node)
        if automaton.nodes[signal.node].kind is NodeKind.JOIN:
            waits = signal.event is Event.SUCCEEDED
            return Cause(Loss.JOIN_WAITS if waits else Loss.JOIN_EVENT, signal.node)
        source = automaton.runner_number(signal.node)
        if not self._reached[source]:
            return earlier[source]
        silent = signal.event is Event.STARTED and signal.node in automaton.traits.silent
        return Cause(Loss.NO_STARTED if silent else Loss.UNCONNECTED, node)

    def trigger(self, number: int) -> Signal | None:
        """The one event that triggers a runner on the engine, if any does."""
        automaton = self.context.automaton
        return next(iter(automaton.inputs[automaton.runner_node(number)]), None)


def decided_like(paper: Context, compiled: Compiled) -> Decided | None:
    """The decisions about a plan with the same runs as on paper; ``compiled`` is the engine's.

    None for a plan that is small enough for z3, and where the ends of runs matter: where durations
    are declared, and where runners may hang or not start.
    """
    from gpsfsm.analysis.decide import Decided, Deciders  # rules are loaded without it

    answers, constraints = paper.answers, paper.deciders.constraints
    unlike = constraints.no_start or constraints.hang or answers["makespan"] or answers["joins"]
    if unlike or paper.deciders.small or None in (answers["completion"], answers["dangling"]):
        return None
    completes, gives_up = answers["completion"]
    lost = tuple(
        each._replace(effect="stuck" if each.effect == "give_up" else each.effect)
        for each in answers["dangling"]
    )
    on_engine = {
        "completion": (completes, Frequency.NEVER),
        "stuck": (Frequency.NEVER, gives_up, Frequency.NEVER),
        "dangling": lost,
        "fewest": None,
    }
    options = replace(paper.deciders.options, solver="z3")
    deciders = Deciders(compiled, constraints, options)
    return Decided(deciders, {**answers, **on_engine}, proof=paper.proof)


@dataclass(frozen=True, slots=True)
class Ending:
    """The end of a plan whose failure nothing handles, and how bad that is.

    ``note`` is what the message of the finding adds about the engine; ``hangs``: it runs the plan
    as the paper has it, and waits for ever where that gives up.
    """

    severity: Severity
    scenario: Scenario | None
    note: str = ""
    hangs: bool = False


def ending(context: Context, scenario: Scenario | None) -> Ending:
    """The end of a run that gives up by the paper, and of the same run on an engine that cannot.

    To give up is what a plan may mean. So is to hang, on an engine that otherwise does as the paper
    says; else it is an error. The scenario is told as it goes on there, if it does: other
    connections may lead elsewhere before, of which there are findings of their own.
    """
    seen = context.engine
    if seen is None:
        return Ending(Severity.INFO, scenario)
    note = f"; {seen.name} cannot give up"
    if seen.same:
        if scenario is not None:
            scenario = replace(scenario, ends=End.HANG, vocabulary=Vocabulary.ENGINE)
        return Ending(Severity.INFO, scenario, note, hangs=True)
    if scenario is None or not _hangs(scenario, seen.context):
        return Ending(Severity.ERROR, scenario, note)
    scenario = replace(scenario, ends=End.HANG, vocabulary=Vocabulary.ENGINE)
    return Ending(Severity.ERROR, scenario, f"{note}: the plan hangs")


def _hangs(scenario: Scenario, context: Context) -> bool:
    """Every run of the scenario happens on the engine, and hangs."""
    numbers = {
        context.plan.path(runner): number for number, runner in enumerate(context.plan.runners)
    }
    if not all(path in numbers for path, _ in scenario.outcomes):
        return False
    decisions = {numbers[path]: outcome for path, outcome in scenario.outcomes}
    evaluator = context.deciders.evaluator
    reached = evaluator.surely(decisions).triggered
    if not all(context.automaton.runner_node(number) in reached for number in decisions):
        return False
    return evaluator.possibly(decisions).ends is End.HANG
