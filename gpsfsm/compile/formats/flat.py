"""Automata in which one runner acts at a time, as states and their transitions.

Formats without our joins can say these: a state for each runner, with a transition for each of its
two outcomes.

    start → A;  A SUCCEEDED → B;  A FAILED → complete;  B SUCCEEDED → complete
    A {succeeded: B, failed: completed}   B {succeeded: completed, failed: gave_up}
An outcome that leads nowhere ends a plan: it gives up.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.compile.formats import CannotSayError
from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import Event

if TYPE_CHECKING:
    from gpsfsm.model.automaton import Automaton
    from gpsfsm.model.plan import Element

COMPLETED, GAVE_UP = "completed", "gave_up"
"""The names of the two ends."""

_NAME = re.compile(r"[^A-Za-z0-9_]+")


class FlatState(NamedTuple):
    """A state: its name, its runner, and the names of what its outcomes lead to."""

    name: str
    element: Element
    succeeded: str
    failed: str


def flat(automaton: Automaton) -> tuple[str, tuple[FlatState, ...]]:
    """The first state and all states, in document order. Raises CannotSayError."""
    plan = automaton.plan

    def refuse(node: int, why: str) -> CannotSayError:
        return CannotSayError(plan.path(automaton.nodes[node].origin), why)

    targets: dict[Signal, int] = {}
    for source, event, target in automaton.edges:
        if event in (Event.STARTED, Event.STOPPED):
            raise refuse(source, f"its {event} leads on, so that two run at once")
        if targets.setdefault(Signal(source, event), target) != target:
            raise refuse(source, "it starts several at once")
    for source, _, target in automaton.stops:
        raise refuse(source, f"it stops {plan.path(automaton.nodes[target].origin)}")
    again = _repeating(automaton)
    for node in automaton.nodes:
        if node.kind is NodeKind.JOIN and node.need > 1:
            raise refuse(node.index, "it waits for several at once")
        if node.index in again and len(automaton.inputs[node.index]) > 1:
            raise refuse(node.index, "it fires again only once all its inputs have come")
    if len(automaton.starts) != 1:
        raise refuse(automaton.starts[1], "it is a second start")
    names = {automaton.complete: COMPLETED, automaton.give_up: GAVE_UP}
    taken = {COMPLETED, GAVE_UP}
    for runner in automaton.runners:
        name = _name(plan.elements[runner.origin], taken)
        names[runner.index] = name
        taken.add(name)

    def leads(node: int, event: Event) -> str:
        target = targets.get(Signal(node, event), -1)
        while target >= 0 and automaton.nodes[target].kind is NodeKind.JOIN:
            target = targets.get(Signal(target, Event.SUCCEEDED), -1)  # of one of its inputs
        if target < 0:
            raise refuse(node, f"nothing happens when it has {event}, and the machine is stuck")
        return names[target]

    states = tuple(
        FlatState(
            names[runner.index],
            plan.elements[runner.origin],
            leads(runner.index, Event.SUCCEEDED),
            leads(runner.index, Event.FAILED),
        )
        for runner in automaton.runners
    )
    return leads(automaton.starts[0], Event.SUCCEEDED), states


def _repeating(automaton: Automaton) -> set[int]:
    """The joins in loops."""
    import networkx

    parts = networkx.strongly_connected_components(automaton.graph)
    looping = {node for part in parts if len(part) > 1 for node in part}
    return {each for each in looping if automaton.nodes[each].kind is NodeKind.JOIN}


def _name(element: Element, taken: set[str]) -> str:
    """A name for a state: the runner's own, or its interface's, made unique."""
    written = element.text("name") or element.interface.rpartition("/")[2]
    plain = _NAME.sub("_", written).strip("_") or "state"
    if plain[0].isdigit():
        plain = f"s_{plain}"
    name, number = plain, 2
    while name in taken:
        name, number = f"{plain}_{number}", number + 1
    return name
