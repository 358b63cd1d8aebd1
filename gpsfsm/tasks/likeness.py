"""Which instances of two plans are of the same action, and which look alike besides."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.compile import UnitKind
from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.plan import value_key
from gpsfsm.tasks.pairs import Pair, Sides

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterable, Mapping

    from gpsfsm.compile import Compiled
    from gpsfsm.model.automaton import Automaton
    from gpsfsm.tasks.behaviour import Action, Behaviour

__all__ = ["sides_of"]

_Numbers = tuple[tuple[int, ...], tuple[int, ...]]


def sides_of(
    first: Behaviour, second: Behaviour, *, tolerance: float = 0.0, consistent: bool = False
) -> Sides:
    """Both plans, ready to be played side by side; numbers of ``Sides`` depend on nothing else.

    ``tolerance``: numbers of one parameter that differ by no more are equal, and so are those that
    are linked by a chain of such.
    """
    kinds = _kinds(first, second, tolerance)
    last: dict[int, Pair] = {}
    for number, kind in enumerate(kinds[0]):
        last[kind] = Pair(number, -1)
    for number, kind in enumerate(kinds[1]):
        last[kind] = Pair(last.get(kind, Pair(-1, -1)).first, number)
    twins = _twins(first.compiled, kinds[0]), _twins(second.compiled, kinds[1])
    return Sides(first, second, kinds, twins, _ranks(first, second, kinds), last, consistent)


def _kinds(first: Behaviour, second: Behaviour, tolerance: float) -> _Numbers:
    known: dict[Action, int] = {}
    close = _close(first, second, tolerance) if tolerance > 0 else {}
    found = [
        tuple(
            known.setdefault(_rounded(runner.parameters, action, close), len(known))
            for runner, action in zip(behaviour.plan.runners, behaviour.actions, strict=True)
        )
        for behaviour in (first, second)
    ]
    return found[0], found[1]


_Close = dict[tuple[str, str], dict[float, float]]
"""Per interface and parameter the number that stands for each number."""


def _close(first: Behaviour, second: Behaviour, tolerance: float) -> _Close:
    values: dict[tuple[str, str], set[float]] = {}
    for runner in (*first.plan.runners, *second.plan.runners):
        for name, value in runner.parameters.items():
            if _is_number(value):
                values.setdefault((runner.interface, name), set()).add(value)  # type: ignore[arg-type]
    found: _Close = {}
    for key, numbers in values.items():
        before = leader = None
        for number in sorted(numbers):
            if before is None or leader is None or number - before > tolerance:
                leader = number
            found.setdefault(key, {})[number] = leader
            before = number
    return found


def _is_number(value: object) -> bool:
    """A number that can be compared: no Boolean, no nan."""
    return isinstance(value, int | float) and not isinstance(value, bool) and value == value  # noqa: PLR0124


def _rounded(parameters: Mapping[str, object], action: Action, close: _Close) -> Action:
    if not close:
        return action
    assert isinstance(action, tuple)
    interface = action[0]
    typed = sorted(parameters.items())
    return (
        interface,
        *(
            (name, value_key(close.get((interface, name), {}).get(value, value)))  # type: ignore[call-overload]
            if _is_number(value)
            else (name, value_key(value))  # type: ignore[arg-type]
            for name, value in typed
        ),
    )


def _twins(compiled: Compiled, kinds: tuple[int, ...]) -> tuple[int, ...]:
    """Runners of equal actions right in one parallel control can be exchanged."""
    units = compiled.units
    numbers = {
        runner.index: number for number, runner in enumerate(compiled.automaton.plan.runners)
    }
    found = list(range(len(kinds)))
    for unit, kind in enumerate(units.kinds):
        if kind not in (UnitKind.ALL, UnitKind.ANY):
            continue
        same: dict[int, int] = {}
        for child in units.children[unit]:
            if units.kinds[child] is UnitKind.RUNNER:
                number = numbers[units.elements[child]]
                found[number] = same.setdefault(kinds[number], number)
    return tuple(found)


def _ranks(first: Behaviour, second: Behaviour, kinds: _Numbers) -> _Numbers:
    """What leads on from an instance, what leads to it, and what leads on from that again."""
    known: dict[Hashable, int] = {}
    found = []
    for behaviour, mine in zip((first, second), kinds, strict=True):
        automaton = behaviour.compiled.automaton
        order = _topological(automaton)
        colours = [
            (node.kind.value, node.need, mine[node.index - 1] if _is_runner(automaton, n) else 0)
            for n, node in enumerate(automaton.nodes)
        ]
        ranks = [known.setdefault(colour, len(known)) for colour in colours]
        for nodes, forwards in ((order[::-1], True), (order, False), (order[::-1], True)):
            ranks = _pass(automaton, nodes, ranks, known, forwards=forwards)
        found.append(tuple(ranks[1 : 1 + len(mine)]))
    return found[0], found[1]


def _is_runner(automaton: Automaton, node: int) -> bool:
    return automaton.nodes[node].kind is NodeKind.RUNNER


def _pass(
    automaton: Automaton,
    nodes: Iterable[int],
    ranks: list[int],
    known: dict[Hashable, int],
    *,
    forwards: bool,
) -> list[int]:
    """New ranks: of the old one and of the nodes that a node leads to, or that lead to it."""
    near: list[list[tuple[str, int]]] = [[] for _ in ranks]
    for source, event, target in automaton.edges:
        one, other = (source, target) if forwards else (target, source)
        near[one].append((event.value, other))
    found = [0] * len(ranks)
    for node in nodes:
        seen = tuple(sorted((event, found[other]) for event, other in near[node]))
        found[node] = known.setdefault((ranks[node], forwards, seen), len(known))
    return found


def _topological(automaton: Automaton) -> list[int]:
    """All nodes, each after those that lead to it."""
    missing = [len(inputs) for inputs in automaton.inputs]
    ready = [node for node, count in enumerate(missing) if not count]
    order: list[int] = []
    while ready:
        node = ready.pop()
        order.append(node)
        for target in automaton.successors[node]:
            missing[target] -= 1
            if not missing[target]:
                ready.append(target)
    return order
