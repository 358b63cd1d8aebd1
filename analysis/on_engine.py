"""What a rule about engines sees (GP7xx): the plan as the paper reads it, and on the engine."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.analysis.decide import Decided, Deciders
from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import Event
from gpsfsm.model.report import Frequency

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.analysis.context import Context
    from gpsfsm.compile import Compiled
    from gpsfsm.model.engine import Parameter

__all__ = ["Cause", "Loss", "OnEngine", "decided_like"]


class Loss(Enum):
    """Why a runner that the paper reaches is never triggered on an engine."""

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
        Raises Inconclusive at a limit.
        """
        reached = self._reached
        meant = set(range(len(reached))).difference(self.paper.answers["reachability"] or ())
        causes: dict[int, Cause] = {}
        found: dict[Cause, list[int]] = {}
        for number in range(len(reached)):
            if reached[number]:
                continue
            cause = causes[number] = self._cause(number, causes)
            if number in meant:
                found.setdefault(cause, []).append(number)
        return {cause: tuple(numbers) for cause, numbers in found.items()}

    @cached_property
    def _reached(self) -> Sequence[bool]:
        unreachable = set(self.context.answers["reachability"] or ())
        return [number not in unreachable for number in range(len(self.context.plan.runners))]

    def _cause(self, number: int, earlier: Mapping[int, Cause]) -> Cause:
        """Why a runner is lost; its only input comes from a node before it."""
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
    """What is decided about a plan with the same runs as on paper; ``compiled`` is the engine's.

    None for a plan that is small enough for z3, and where the ends of runs matter: where durations
    are declared, and where runners may hang or not start.
    """
    answers, constraints = paper.answers, paper.deciders.constraints
    unlike = constraints.no_start or constraints.hang or answers["makespan"] or answers["joins"]
    small = paper.deciders.structure is None or paper.deciders.asks_solver
    if unlike or small or None in (answers["completion"], answers["dangling"]):
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
    return Decided(deciders, {**answers, **on_engine})
