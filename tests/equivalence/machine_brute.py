"""Machines played straight from their graphs, as semantics 9.2 and 9.5 have it.

Shares no code with the product: an instant is a memo of what happens at it, on the names of a graph
of networkx, and every pairing of what starts at one instant is tried. For a few runners only.
"""

from __future__ import annotations

from itertools import permutations, product
from math import inf
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterator

    import networkx as nx

Graph = Any
Joins = frozenset[tuple[str, frozenset[int], bool]]


class At(NamedTuple):
    """A configuration: the active instances; of each join what has arrived, and if it has fired."""

    active: frozenset[str]
    joins: Joins


class Seen(NamedTuple):
    """What is seen of an instant."""

    started: frozenset[str]
    stopped: frozenset[str]
    end: str


class Played:
    """A machine, played one outcome at a time."""

    def __init__(self, graph: nx.MultiDiGraph[Any]) -> None:
        self.kind = {name: data["kind"] for name, data in graph.nodes(data=True)}
        self.need = {name: data.get("need", 0) for name, data in graph.nodes(data=True)}
        self.action = {name: data.get("interface") for name, data in graph.nodes(data=True)}
        self.into: dict[str, list[tuple[str, str]]] = {name: [] for name in graph}
        self.stops: dict[str, list[tuple[str, str]]] = {name: [] for name in graph}
        for source, target, data in graph.edges(data=True):
            stops = data.get("action") == "stop"
            (self.stops if stops else self.into)[target].append((source, data["event"]))

    def begin(self) -> tuple[At, Seen]:
        """The first instant."""
        starts = {(name, "SUCCEEDED") for name, kind in self.kind.items() if kind == "start"}
        joins = frozenset(
            (name, frozenset[int](), False) for name, kind in self.kind.items() if kind == "join"
        )
        return self._instant(At(frozenset(), joins), starts)

    def after(self, at: At, name: str, event: str) -> tuple[At, Seen]:
        """An active instance has an outcome."""
        assert name in at.active
        return self._instant(at._replace(active=at.active - {name}), {(name, event)})

    def _instant(self, at: At, causes: set[tuple[str, str]]) -> tuple[At, Seen]:
        memo: dict[tuple[str, str], bool] = dict.fromkeys(causes, True)
        before = {name: (arrived, fired) for name, arrived, fired in at.joins}

        def any_of(signals: list[tuple[str, str]]) -> bool:
            return any(happens(*signal) for signal in signals)

        def inputs(join: str) -> tuple[frozenset[int], bool]:
            arrived, fired = before[join]
            if any_of(self.stops[join]):
                arrived, fired = frozenset(), False
            new = {place for place, each in enumerate(self.into[join]) if happens(*each)}
            return arrived | new, fired

        def happens(name: str, event: str) -> bool:
            if (name, event) not in memo:
                memo[name, event] = decide(name, event)
            return memo[name, event]

        def decide(name: str, event: str) -> bool:
            if self.kind[name] == "join":
                arrived, fired = inputs(name)
                return event == "SUCCEEDED" and not fired and len(arrived) >= self.need[name]
            if self.kind[name] == "runner" and event == "STOPPED":
                return name in at.active and any_of(self.stops[name])
            if self.kind[name] == "runner" and event == "STARTED":
                idle = name not in at.active or happens(name, "STOPPED")
                return idle and any_of(self.into[name])
            return False

        runners = [name for name, kind in self.kind.items() if kind == "runner"]
        started = frozenset(name for name in runners if happens(name, "STARTED"))
        stopped = frozenset(name for name in runners if happens(name, "STOPPED"))
        joins = []
        for join in before:
            arrived, fired = inputs(join)
            fired = fired or happens(join, "SUCCEEDED")
            if fired and len(arrived) == len(self.into[join]):
                arrived, fired = frozenset(), False
            joins.append((join, arrived, fired))
        end = ""
        for kind in ("complete", "give_up"):  # giving up wins
            if any(any_of(self.into[name]) for name in self.kind if self.kind[name] == kind):
                end = kind
        return At(at.active - stopped | started, frozenset(joins)), Seen(started, stopped, end)


Pairs = frozenset[tuple[str, str]]
State = tuple[Pairs, Joins, Joins]


def distance(one: Graph, other: Graph, *, most: int = 3_000) -> float | None:
    """The fewest outcomes after which an observer can tell the machines apart; inf if never.

    None: there are more than ``most`` states.
    """
    first, second = Played(one), Played(other)

    def met(rest: Pairs, mine: tuple[At, Seen], theirs: tuple[At, Seen]) -> list[State | None]:
        """The ways to go on, None for the end of both; no way: they differ."""
        (here, seen), (there, also) = mine, theirs
        if seen.end != also.end or len(seen.started) != len(also.started):
            return []
        orders = [
            frozenset(zip(sorted(seen.started), order, strict=True))
            for order in permutations(sorted(also.started))
        ]
        orders = [
            more for more in orders if all(first.action[a] == second.action[b] for a, b in more)
        ]
        if seen.end:
            return [None] if orders else []
        if any((a in seen.stopped) != (b in also.stopped) for a, b in rest):
            return []
        rest = frozenset(pair for pair in rest if pair[0] not in seen.stopped)
        return [(rest | more, here.joins, there.joins) for more in orders]

    def moves(state: State) -> Iterator[list[State | None]]:
        pairs, here, there = state
        mine = At(frozenset(a for a, _ in pairs), here)
        theirs = At(frozenset(b for _, b in pairs), there)
        for (a, b), event in product(sorted(pairs), ("SUCCEEDED", "FAILED")):
            after = first.after(mine, a, event), second.after(theirs, b, event)
            yield met(pairs - {(a, b)}, *after)

    beginning = met(frozenset(), first.begin(), second.begin())
    edges: dict[State, list[list[State | None]]] = {}
    pending = [state for state in beginning if state is not None]
    while pending:
        state = pending.pop()
        if state not in edges:
            edges[state] = list(moves(state))
            pending += [each for ways in edges[state] for each in ways if each is not None]
            if len(edges) > most:
                return None
    values: dict[State | None, float] = dict.fromkeys(edges, inf)
    values[None] = inf
    changed = True
    while changed:
        changed = False
        for state, options in edges.items():
            least = min((_worst(ways, values) for ways in options), default=inf) + 1
            if least < values[state]:
                values[state], changed = least, True
    return _worst(beginning, values)


def _worst(ways: list[State | None], values: dict[State | None, float]) -> float:
    return max((values[each] for each in ways), default=0)
