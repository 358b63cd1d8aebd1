"""Two machines side by side, or a machine and a plan (semantics, 9.5).

The lockstep search of ``comparison`` plays them: its states are pairs of configurations, which it
visits once each, so that loops come to an end. What a join remembers counts as long as an active
instance can still reach that join. Machines that are the same up to the names of their nodes are
equal at once.

    one      A FAILED → A;  A SUCCEEDED → complete
    other    A FAILED → B;  B FAILED → A;  A, B SUCCEEDED → complete;  A and B have one action
    states   (A, A), and after a failure (A, B), from which a failure leads back: they are equal
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import networkx

from gpsfsm.analysis.constraints import constraints_of
from gpsfsm.compile.instants import (
    CODES,
    COMPLETED,
    GAVE_UP,
    GOING,
    STARTED,
    STOPPED,
    Configuration,
    Instants,
    bits,
)
from gpsfsm.equivalence.alignment import kinds_of
from gpsfsm.equivalence.pairs import Behaviour, Joint, Meeting, Pair, Reaction, Sides, Step
from gpsfsm.errors import GpsfsmError
from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.event import End, Event, Outcome
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.compile import Compiled
    from gpsfsm.compile.instants import Instant
    from gpsfsm.model.automaton import Automaton

_ENDS = {GOING: None, COMPLETED: End.COMPLETED, GAVE_UP: End.GAVE_UP}
_OUTCOMES = {Event.SUCCEEDED: Outcome.SUCCEEDED, Event.FAILED: Outcome.FAILED}
_MOST_NODES = 300
"""Larger machines are not compared by their graphs: networkx goes as deep as they have nodes."""
_MOST_TRIED = 100_000
"""So many pairs of nodes are tried; then the search decides."""

Allowed = tuple[frozenset[Outcome], ...]
"""The outcomes that each instance can have."""


class Player:
    """A machine, or the automaton of a plan, that is played one outcome at a time."""

    def __init__(self, automaton: Automaton) -> None:
        self.automaton = automaton
        self.instants = Instants(automaton)
        self._relevant = self._reach()

    def begin(self) -> tuple[tuple[int, int], Reaction]:
        """The first instant: what joins remember after it, and what is seen."""
        return self._seen(self.instants.first())

    def after(
        self, active: Sequence[int], joins: tuple[int, int], number: int, event: Event
    ) -> tuple[tuple[int, int], Reaction]:
        """The instant at which an active instance has this outcome."""
        bits = sum(1 << each for each in active)
        at = Configuration(bits, 0, joins[0], joins[1], GOING)
        return self._seen(self.instants.after(at, number, CODES[event]))

    def _seen(self, instant: Instant) -> tuple[tuple[int, int], Reaction]:
        numbers: dict[int, list[int]] = {STARTED: [], STOPPED: []}
        for code in instant.events:
            node, event = divmod(code, 4)
            if event in numbers:
                numbers[event].append(self.automaton.runner_number(node))
        after = instant.configuration
        end = _ENDS[after.ended]
        stopped = () if end is not None else tuple(sorted(numbers[STOPPED]))
        reaction = Reaction(tuple(sorted(numbers[STARTED])), end, stopped)
        return self._remembered(after), reaction

    def _remembered(self, at: Configuration) -> tuple[int, int]:
        """The memory of the joins that an active instance can still reach."""
        arrived = fired = 0
        for number in bits(at.active):
            inputs, joins = self._relevant[number]
            arrived, fired = arrived | inputs, fired | joins
        return at.arrived & arrived, at.fired & fired

    def _reach(self) -> list[tuple[int, int]]:
        """For each instance the inputs of joins, and the joins, that it leads to, as bits."""
        graph: networkx.DiGraph[int] = networkx.DiGraph()
        graph.add_nodes_from(range(len(self.automaton.nodes)))
        graph.add_edges_from(
            (source, target) for source, _, target in (*self.automaton.edges, *self.automaton.stops)
        )
        parts = networkx.condensation(graph)
        reached: dict[int, tuple[int, int]] = {}
        for part in reversed(list(networkx.topological_sort(parts))):
            inputs = joins = 0
            for node in parts.nodes[part]["members"]:
                place = self.instants.place.get(node)
                if place is not None:
                    inputs, joins = inputs | self.instants.inputs_of[place], joins | 1 << place
            for following in parts.successors(part):
                more = reached[following]
                inputs, joins = inputs | more[0], joins | more[1]
            reached[part] = inputs, joins
        part_of = parts.graph["mapping"]
        return [reached[part_of[node.index]] for node in self.automaton.runners]


@dataclass(frozen=True, slots=False, eq=False)
class MachineSides(Sides):
    """Two automata to be played side by side; both members of a pair start, end and stop together.

    ``allowed``: the outcomes that an observer may give to the instances of either.
    """

    players: tuple[Player, Player] = field(kw_only=True)
    allowed: tuple[Allowed, Allowed] = field(kw_only=True)

    def begin(self) -> Meeting:
        """Both begin."""
        return self._met((), self.players[0].begin(), self.players[1].begin())

    def after(self, joint: Joint, step: Step) -> Meeting:
        """A pair has this outcome in both."""
        rest = tuple(pair for pair in joint.pairs if pair != step.pair)
        memory = joint.first[0], joint.second[0]
        sides = [
            player.after(
                [pair[side] for pair in joint.pairs], memory[side], step.pair[side], step.event
            )
            for side, player in enumerate(self.players)
        ]
        return self._met(rest, *sides)

    def allows(self, joint: Joint, step: Step) -> bool:
        """True if the observer may give this outcome, which is the same at every visit."""
        assert step.pair in joint.pairs
        outcome = _OUTCOMES[step.event]
        return all(outcome in self.allowed[side][step.pair[side]] for side in (0, 1))

    def _met(
        self,
        rest: tuple[Pair, ...],
        one: tuple[tuple[int, int], Reaction],
        other: tuple[tuple[int, int], Reaction],
    ) -> Meeting:
        """The ways to go on: who is stopped is paired no longer, who starts is paired anew."""
        (here, first), (there, second) = one, other
        stopped, gone = set(first.stopped), set(second.stopped)
        if first.end is None and second.end is None:
            if any((pair.first in stopped) != (pair.second in gone) for pair in rest):
                return Meeting(first, second, ())
            rest = tuple(pair for pair in rest if pair.first not in stopped)
        ways, every = self.paired(rest, first, second)
        if first.end is not None:
            return Meeting(first, second, tuple(Joint((), (), ()) for _ in ways[:1]), every)
        joints = tuple(Joint(pairs, (here,), (there,)) for pairs in ways)
        assert all(len({pair.first for pair in each.pairs}) == len(each.pairs) for each in joints)
        return Meeting(first, second, joints, every)


def machine_sides(
    first: Compiled, second: Compiled, *, tolerance: float = 0.0, assumptions: Sequence[str] = ()
) -> MachineSides:
    """Both machines, ready to be played. Raises AssumptionError, GpsfsmError for contradictions."""
    behaviours = Behaviour(first), Behaviour(second)
    kinds = kinds_of(*behaviours, tolerance)
    one, other = first.automaton, second.automaton
    colours = _colours((one, other), kinds)
    ranks = [
        tuple(colours[side][node.index] for node in automaton.runners)
        for side, automaton in enumerate((one, other))
    ]
    same = not assumptions and _isomorphic((one, other), colours)
    alone = tuple(range(len(kinds[0]))), tuple(range(len(kinds[1])))
    return MachineSides(
        *behaviours,
        kinds,
        twins=alone,
        ranks=(ranks[0], ranks[1]),
        begins=(ranks[0], ranks[1]),
        last={},
        same_form=same,
        players=(Player(one), Player(other)),
        allowed=(_allowed(first, assumptions), _allowed(second, assumptions)),
    )


def _allowed(compiled: Compiled, assumptions: Sequence[str]) -> Allowed:
    """The outcomes that each instance can have under assumptions about single ones.

    Raises UndecidedError for assumptions that tie instances together.
    """
    from gpsfsm.equivalence.comparison import UndecidedError

    plan = compiled.automaton.plan
    constraints = constraints_of(plan, assumptions=tuple(assumptions))
    if constraints.formulas:
        raise UndecidedError(
            "machines are not compared under assumptions that tie runners together"
        )
    if not all(constraints.allowed):
        raise GpsfsmError(
            f"{clip(plan.file, 200)}: the assumptions admit no scenario; correct one of them"
        )
    return tuple(constraints.allowed)


# --- graphs that are the same up to names ---------------------------------------------------------

_Colours = tuple[list[int], list[int]]


def _colours(automata: tuple[Automaton, Automaton], kinds: Sequence[Sequence[int]]) -> _Colours:
    """A number for each node of either graph, other numbers for what no renaming can exchange.

    Nodes begin with their kind, need and action. Then whoever has other neighbours gets another
    number, until nothing changes (the colour refinement of Weisfeiler and Leman).
    """
    colours: list[list[Any]] = [
        [
            (node.kind.value, node.need, kinds[side][automaton.runner_number(node.index)])
            if node.kind is NodeKind.RUNNER
            else (node.kind.value, node.need, -1)
            for node in automaton.nodes
        ]
        for side, automaton in enumerate(automata)
    ]
    count = 0
    while True:
        numbers = {
            colour: number for number, colour in enumerate(sorted({*colours[0], *colours[1]}))
        }
        named = [[numbers[colour] for colour in each] for each in colours]
        if len(numbers) == count:
            return named[0], named[1]
        count = len(numbers)
        colours = [
            _refined(automaton, each) for automaton, each in zip(automata, named, strict=True)
        ]


def _refined(automaton: Automaton, colours: Sequence[int]) -> list[Any]:
    around: list[list[tuple[int, int, int, int]]] = [[] for _ in colours]
    for action, edges in enumerate((automaton.edges, automaton.stops)):
        for source, event, target in edges:
            around[source].append((0, action, CODES[event], colours[target]))
            around[target].append((1, action, CODES[event], colours[source]))
    return [(colour, *sorted(near)) for colour, near in zip(colours, around, strict=True)]


class _TooManyTriedError(Exception):
    """The graphs may be the same, but it would take long to find out."""


def _isomorphic(automata: tuple[Automaton, Automaton], colours: _Colours) -> bool:
    """True if the automata are the same up to names; False is no proof that they are not."""
    if Counter(colours[0]) != Counter(colours[1]) or len(colours[0]) > _MOST_NODES:
        return False
    graphs = []
    for automaton, numbers in zip(automata, colours, strict=True):
        graph: networkx.MultiDiGraph[int] = networkx.MultiDiGraph()
        graph.add_nodes_from((node, {"colour": colour}) for node, colour in enumerate(numbers))
        for action, edges in enumerate((automaton.edges, automaton.stops)):
            for source, event, target in edges:
                graph.add_edge(source, target, effect=(action, CODES[event]))
        graphs.append(graph)
    left = _MOST_TRIED

    def alike(one: Mapping[str, int], other: Mapping[str, int]) -> bool:
        nonlocal left
        left -= 1
        if left < 0:
            raise _TooManyTriedError
        return one["colour"] == other["colour"]

    try:
        return networkx.is_isomorphic(
            graphs[0],
            graphs[1],
            node_match=alike,
            edge_match=lambda one, other: _effects(one) == _effects(other),
        )
    except _TooManyTriedError:
        return False


def _effects(connections: Any) -> list[tuple[int, int]]:
    """The effects of the connections between two nodes, each as often as it is there."""
    return sorted(each["effect"] for each in connections.values())
