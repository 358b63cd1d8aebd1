"""Whether a plan runs on an engine step by step as the paper has it: sufficient, and linear.

It is so where both do one thing at a time and every outcome of every runner leads to the same next
thing, however many joins stand between them. Whoever gives up in the paper hangs on the engine.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import Event

if TYPE_CHECKING:
    from gpsfsm.model.automaton import Automaton

__all__ = ["same_runs"]

_NOTHING, _COMPLETE = -1, -2
_OUTCOMES = (Event.SUCCEEDED, Event.FAILED)


def same_runs(paper: Automaton, engine: Automaton) -> bool:
    """Whether both automata of one plan have the same runs, where runners succeed or fail.

    False also where this simple comparison cannot tell. The engine never aborts if it is True: what
    happens one after the other cannot arrive twice at a join that has fired, since no connection
    leads back.
    """
    if engine.traits.looping:
        return False
    there = _next_things(engine)
    return there is not None and there == _next_things(paper)


def _next_things(automaton: Automaton) -> list[int] | None:
    """What follows the start and each outcome; None if anything happens beside another thing."""
    if any(event is Event.STARTED for _, event, _ in automaton.edges):
        return None
    known: dict[int, int | None] = {}  # what follows a join
    found: list[int] = []
    for node in automaton.nodes:
        if node.kind in (NodeKind.START, NodeKind.RUNNER):
            for event in _OUTCOMES:
                thing = _follow(automaton, Signal(node.index, event), known)
                if thing is None:
                    return None
                found.append(thing)
    return found


def _follow(automaton: Automaton, signal: Signal, known: dict[int, int | None]) -> int | None:
    """The one runner that an event triggers, in the end; None if there are more, or it waits."""
    joins: list[int] = []
    while True:
        targets = [
            target for target in automaton.outputs.get(signal, ()) if target != automaton.give_up
        ]
        thing: int | None = None
        if not targets:
            thing = _NOTHING
        elif len(targets) == 1:
            (target,) = targets
            node = automaton.nodes[target]
            if target == automaton.complete:
                thing = _COMPLETE
            elif node.kind is NodeKind.RUNNER:
                thing = target
            elif target in known:
                thing = known[target]
            elif node.need == 1:
                joins.append(target)
                signal = Signal(target, Event.SUCCEEDED)
                continue
        known.update(dict.fromkeys(joins, thing))
        return thing
