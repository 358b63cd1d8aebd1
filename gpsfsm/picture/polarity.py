"""Which joins collect failures: what leads on from them is a failure, and is drawn as one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.event import Event
from gpsfsm.model.plan import ControlType, Kind
from gpsfsm.model.tree_nodes import BUILTINS, Meaning

if TYPE_CHECKING:
    from gpsfsm.model.automaton import Automaton, Node, Signal
    from gpsfsm.model.plan import Element

__all__ = ["failing_joins", "meaning_of"]

_SWAPPING = (Meaning.INVERT, Meaning.FORCE_FAILURE)
_FORCING = (Meaning.FORCE_SUCCESS, Meaning.FORCE_FAILURE)
_ALTERNATIVES = (Meaning.FALLBACK, Meaning.REACTIVE_FALLBACK, Meaning.RETRY)


def meaning_of(element: Element) -> Meaning | None:
    """What a node of a behaviour tree means; None for what the file itself has named."""
    builtin = BUILTINS.get(element.tag)
    return builtin.meaning if builtin else None


def failing_joins(automaton: Automaton) -> frozenset[int]:
    """The joins that collect failures.

    The control of a join tells it, but for parallels, which have a join for either: there, and on
    engines, the inputs tell.
    """
    found: set[int] = set()
    for node in automaton.nodes:
        if node.kind is NodeKind.JOIN:
            fails = _by_control(automaton, node)
            if fails is None:
                inputs = automaton.inputs[node.index]
                failures = sum(_fails(automaton, found, signal, node) for signal in inputs)
                fails = 2 * failures > len(inputs)
            if fails:
                found.add(node.index)
    return frozenset(found)


def _by_control(automaton: Automaton, join: Node) -> bool | None:
    element = automaton.plan.elements[join.origin]
    meaning = meaning_of(element)
    if not automaton.traits.gives_up or meaning is Meaning.BRANCH:
        return None
    if meaning in _FORCING or meaning in _ALTERNATIVES:
        return False
    if element.control_type is ControlType.RECOVERY:
        return False
    sequential = element.control_type in (ControlType.SEQUENTIAL, None)
    return True if sequential and element.kind is not Kind.RUNNER else None


def _fails(automaton: Automaton, known: set[int], signal: Signal, join: Node) -> bool:
    """Whether a signal tells the control of the join that something in it has failed."""
    fails = signal.event is Event.FAILED or signal.node in known
    elements = automaton.plan.elements
    index = automaton.nodes[signal.node].origin
    while index > join.origin:
        if meaning_of(elements[index]) in _SWAPPING:
            fails = not fails
        index = elements[index].parent
    return fails
