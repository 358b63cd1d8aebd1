"""Workflow nets of an automaton, for Woflan (pm4py).

A place for what waits to run and for every input of a join, a transition per outcome. Completion
and give-up both end in the sink. Woflan asks whether the net is sound: whether every run can end
with one token in the sink and none elsewhere. For a fan-out that is the question whether the join
can wait for ever; a parallel_any is never sound, because its other units run on.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from benchmarks.other_tools.questions import Cone, cone_of
from gpsfsm.model.automaton import Automaton, NodeKind, Signal
from gpsfsm.model.event import Event

if TYPE_CHECKING:
    from collections.abc import Iterator, Set

Transition = tuple[list[str], list[str]]
"""The places that a transition takes tokens from, and those that it puts tokens into."""


def net_of(automaton: Automaton, *, never_fails: Set[int] = frozenset()) -> str:
    """The net as JSON: its ``transitions``; its places are all that they name."""
    cone = cone_of(automaton, None, never_fails)
    transitions = [transition for node in cone.nodes for transition in _transitions(cone, node)]
    return json.dumps({"source": "source", "sink": "sink", "transitions": transitions})


def _transitions(cone: Cone, node: int) -> Iterator[Transition]:
    inputs = cone.into[node]
    takes = ["source"] if node == 0 else [f"waiting{node}"]
    if cone.collects(node):
        if len(inputs) < cone.node(node).need:
            return  # one input never comes
        takes = [f"input{number}" for number in inputs]
    elif _passes_on(cone, node):
        return
    for event in cone.events(node):
        started = _places(cone, Signal(node, Event.STARTED))
        yield takes, [*started, *_places(cone, Signal(node, event))]


def _passes_on(cone: Cone, node: int) -> bool:
    """Whether a node needs no place of its own: its triggers are as good as what they trigger."""
    return node != 0 and cone.node(node).kind is not NodeKind.RUNNER and not cone.collects(node)


def _places(cone: Cone, signal: Signal) -> list[str]:
    """Where an event puts its tokens."""
    places: list[str] = []
    pending = [signal]
    while pending:
        for number in cone.targets(pending.pop()):
            target = cone.edges[number].target
            if target in (cone.automaton.complete, cone.automaton.give_up):
                places.append("sink")
            elif cone.collects(target):
                places.append(f"input{number}")
            elif _passes_on(cone, target):
                pending.append(Signal(target, Event.SUCCEEDED))
            else:
                places.append(f"waiting{target}")
    return places
