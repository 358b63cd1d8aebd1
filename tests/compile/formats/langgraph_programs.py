"""Random programs that build LangGraph graphs, how its versions draw them, and their supersteps.

Written from what langgraph 0.2.76, 0.6.11 and 1.2.24 do; it shares nothing with the reader. The
drawing of newer versions is a simulation of the graph in which each condition writes all targets
that it declares, once.
"""

from __future__ import annotations

import json
import random
from collections import defaultdict
from dataclasses import dataclass, field
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

from tests.compile.formats.against_runs import COMPLETES, GIVES_UP, Graph

if TYPE_CHECKING:
    from collections.abc import Iterator

START, END = "__start__", "__end__"
_MOST = 150
Edge = tuple[str, str, bool]
Position = tuple[Any, ...]


class TooManyError(Exception):
    """There are more positions than are looked at."""


class Route(NamedTuple):
    """Where a function leads: a condition, or what a node returns as ``Command``.

    ``targets`` None: it declares none. ``several``: it may name several targets, or none.
    """

    targets: tuple[str, ...] | None
    several: bool
    command: bool = False


@dataclass
class Program:
    """The calls that build a graph."""

    nodes: list[str] = field(default_factory=list)
    plain: dict[str, list[str]] = field(default_factory=lambda: defaultdict(list))
    joins: list[tuple[tuple[str, ...], str]] = field(default_factory=list)
    routes: dict[str, list[Route]] = field(default_factory=lambda: defaultdict(list))
    defer: set[str] = field(default_factory=set)
    graphs: dict[str, Program] = field(default_factory=dict)


# -- drawn at random -------------------------------------------------------------------------------


def random_program(chance: random.Random, *, inner: bool = False) -> Program:
    """A program; ``inner``: that of a subgraph."""
    names = ["a", "b", "c", "d", "give_up", "another node follows"]
    program = Program(names[: chance.choice((1, 2, 2, 3) if inner else (1, 2, 3, 3, 4, 4))])
    if chance.random() < 0.1:
        program.nodes[-1] = names[-1]
    several = chance.random() < 0.2 and not inner
    program.plain[START] = chance.sample(program.nodes, min(1 + several, len(program.nodes)))
    if not inner and chance.random() < 0.2:
        program.routes[START].append(_route(chance, program))
        program.plain[START] = program.plain[START] if chance.random() < 0.5 else []
    for name in program.nodes:
        _lead_on(chance, program, name, inner=inner)
    for _ in range(chance.choice((0, 0, 0, 1, 1, 2)) if len(program.nodes) > 2 else 0):
        starts = tuple(chance.sample(program.nodes, chance.randint(1, 3)))
        join = (starts, chance.choice(program.nodes))
        program.joins += [join] * (join not in program.joins)
    return program


def _lead_on(chance: random.Random, program: Program, name: str, *, inner: bool) -> None:
    kind = chance.choice(("plain", "plain", "plain", "route", "route", "command", "both", "none"))
    if kind in ("plain", "both"):
        targets = [*program.nodes, END, END]
        program.plain[name] = list(
            dict.fromkeys(chance.choices(targets, k=chance.choice((1, 1, 2))))
        )
    if kind in ("route", "both"):
        program.routes[name].append(_route(chance, program))
    if kind == "command":
        program.routes[name].append(_route(chance, program)._replace(command=True))
    if chance.random() < 0.08:
        program.defer.add(name)
    elif not inner and chance.random() < 0.1:
        program.graphs[name] = random_program(chance, inner=True)


def _route(chance: random.Random, program: Program) -> Route:
    several = chance.random() < 0.4
    if chance.random() < 0.35:
        return Route(None, several)
    targets = chance.sample([*program.nodes, END], chance.randint(1, min(3, len(program.nodes))))
    return Route(tuple(targets), several)


# -- supersteps ------------------------------------------------------------------------------------


class Supersteps:
    """The runs of a program.

    A position: the nodes that run in this step, each with its own position if it is a graph; the
    nodes that follow; which starts of joins have ended; and the deferred nodes that wait.
    """

    def __init__(self, program: Program) -> None:
        self.program = program
        self.active: set[str] = set()
        self.written: dict[tuple[int, str], list[tuple[str, ...]]] = {}
        self.firsts = self._begin(program, "")
        self.steps: dict[Any, set[tuple[str, Any]]] = {}
        pending = [each for each in self.firsts if each != COMPLETES]
        while pending:
            at = pending.pop()
            if at in self.steps:
                continue
            self.steps[at] = {*self._moves(program, at, "")}
            pending += (each for _, each in self.steps[at] if each not in (COMPLETES, GIVES_UP))
            if len(self.steps) > _MOST:
                raise TooManyError

    def graph(self) -> Graph:
        """The runs, to be compared."""
        import networkx

        arrows = networkx.DiGraph((at, to) for at, row in self.steps.items() for _, to in row)
        endless = not networkx.is_directed_acyclic_graph(arrows)
        return Graph(frozenset(self.firsts), self.steps, frozenset(self.active), endless)

    def _begin(self, program: Program, path: str) -> list[Any]:
        none = tuple(frozenset[str]() for _ in program.joins)
        return [
            position
            for follow in self._writes(program, START)
            for position in self._settle(program, ((), follow, none, frozenset()), path)
        ]

    def _moves(self, program: Program, at: Position, path: str) -> Iterator[tuple[str, Any]]:
        running, follow, joins, waiting = at
        for number, (name, inside) in enumerate(running):
            others = (*running[:number], *running[number + 1 :])
            if inside is None:
                yield path + name, GIVES_UP
                ends = [path + name]
            else:
                ends = []
                for who, what in self._moves(program.graphs[name], inside, f"{path}{name}:"):
                    if what == COMPLETES:
                        ends.append(who)
                    elif what == GIVES_UP:
                        yield who, GIVES_UP
                    else:
                        kept = tuple(sorted((*others, (name, what)), key=repr))
                        yield who, (kept, follow, joins, waiting)
            for who in dict.fromkeys(ends):
                for more in self._writes(program, name):
                    arrived = tuple(
                        seen | {name} if name in starts else seen
                        for seen, (starts, _) in zip(joins, program.joins, strict=True)
                    )
                    after = (others, tuple(sorted((*follow, *more))), arrived, waiting)
                    for position in self._settle(program, after, path):
                        yield who, position

    def _settle(self, program: Program, at: Position, path: str) -> list[Any]:
        """The next step begins, if this one is over."""
        running, follow, joins, waiting = at
        if running:
            return [at]
        # sent ("!") nodes run as often as they are sent, others once
        tasks = [each.lstrip("!") for each in follow if each[0] == "!"]
        once = {each for each in follow if each[0] != "!"}
        left = []
        for seen, (starts, target) in zip(joins, program.joins, strict=True):
            full = seen >= {*starts}
            once |= {target} if full else set()
            left.append(frozenset() if full else seen)
        waiting |= once & program.defer
        tasks += sorted(once - program.defer)
        if not tasks:
            tasks, waiting = sorted(waiting), frozenset()
        if not tasks:
            return [COMPLETES]
        insides = []
        for name in tasks:
            if name in program.graphs:
                insides.append(self._begin(program.graphs[name], f"{path}{name}:"))
            else:
                self.active.add(path + name)
                insides.append([None])
        return [
            (tuple(sorted(zip(tasks, row, strict=True), key=repr)), (), tuple(left), waiting)
            for row in product(*insides)
        ]

    def _writes(self, program: Program, name: str) -> list[tuple[str, ...]]:
        """What may follow a node: its edges, and for each of its functions one answer of it."""
        if (id(program), name) not in self.written:
            always = {each for each in program.plain[name] if each != END}
            rows = [_answers(program, each) for each in program.routes[name]]
            found = {tuple(sorted(always.union(*answer))) for answer in product(*rows)}
            self.written[id(program), name] = sorted(found)
        return self.written[id(program), name]


def _answers(program: Program, route: Route) -> list[set[str]]:
    targets = program.nodes if route.targets is None else [e for e in route.targets if e != END]
    answers = [{each} for each in targets]
    if route.several:
        answers += ({*targets}, {*targets[:2]})
        answers += ({sign + each for sign in ("!", "!!")} for each in targets[:1])
    if route.several or route.command or route.targets is None or END in route.targets:
        answers.append(set())
    return answers


# -- drawings --------------------------------------------------------------------------------------


def drawing(program: Program, *, old: bool, inlined: bool) -> str:
    """The JSON of ``get_graph(xray=inlined).to_json()``, of 0.2.76 or of a newer version.

    What is no part of it is removed from the program: graphs that are drawn as one node.
    """
    nodes, edges = _graph(program, old=old, inlined=inlined)
    for name in {*program.graphs} & {*nodes}:
        del program.graphs[name]  # it is drawn as one node
    rows = []
    for name in nodes:
        *path, own = name.split(":")
        inner = program.graphs[path[0]] if path else program
        metadata = {"metadata": {"defer": True}} if own in inner.defer and not old else {}
        rows.append({"id": name, "type": "runnable", **metadata})
    arrows: list[dict[str, Any]] = [
        {"source": a, "target": b} | ({"conditional": True} if may else {}) for a, b, may in edges
    ]
    return json.dumps({"nodes": rows, "edges": arrows}, indent=1)


def _graph(program: Program, *, old: bool, inlined: bool) -> tuple[list[str], list[Edge]]:
    edges = _old_edges(program) if old else _new_edges(program)
    nodes = [START, *program.nodes]
    nodes += [END] if any(target == END for _, target, _ in edges) else []
    for name, inner in program.graphs.items() if inlined else ():
        inside = _trimmed(*_graph(inner, old=old, inlined=inlined))
        if inside is not None:
            first, last, names, arrows = inside
            nodes = [each for each in nodes if each != name] + [f"{name}:{each}" for each in names]
            ends = {name: (f"{name}:{last}", f"{name}:{first}")}
            edges = [(ends.get(a, (a,))[0], ends.get(b, (b,))[-1], may) for a, b, may in edges]
            edges += [(f"{name}:{a}", f"{name}:{b}", may) for a, b, may in arrows]
    return nodes, edges


def _trimmed(nodes: list[str], edges: list[Edge]) -> tuple[str, str, list[str], list[Edge]] | None:
    """A subgraph without its start and end, if it has one first and one last node."""
    ends = []
    for side in (1, 0):  # nothing leads to the first one, the last one leads nowhere
        end = _only(nodes, edges, side, "")
        if end is None:
            return None
        again = _only(nodes, edges, side, end)
        if len({each[:2] for each in edges if each[1 - side] == end}) != 1:
            again = None
        if again is not None:
            nodes = [each for each in nodes if each != end]
            edges = [each for each in edges if end not in each[:2]]
        ends.append(again or end)
    return ends[0], ends[1], nodes, edges


def _only(nodes: list[str], edges: list[Edge], side: int, without: str) -> str | None:
    taken = {each[side] for each in edges if each[1 - side] != without}
    found = [each for each in nodes if each != without and each not in taken]
    return found[0] if len(found) == 1 else None


def _old_edges(program: Program) -> list[Edge]:
    edges = [(source, to, False) for source, row in program.plain.items() for to in row]
    edges += [(each, to, False) for starts, to in program.joins for each in starts]
    for source, rows in program.routes.items():
        for route in rows:
            if route.targets is not None:
                edges += [(source, to, True) for to in route.targets]
            elif not route.command:
                edges += [(source, to, True) for to in (*program.nodes, END) if to != source]
    return sorted({*edges})


class _Simulation:
    """The steps of a graph whose conditions all write what they declare, at their first time."""

    def __init__(self, program: Program) -> None:
        self.program = program
        self.joins: dict[tuple[Any, ...], set[str]] = {join: set() for join in program.joins}
        self.waiting: set[str] = set()
        self.declared: dict[str, set[tuple[Any, bool]]] = {}
        self.sources: dict[str, set[tuple[Any, bool]]] = {}
        self.edges: set[Edge] = set()
        self.last: dict[str, set[tuple[Any, bool]]] = {}

    def run(self) -> None:
        """As many steps as langgraph takes."""
        tasks = {START}
        for _ in range(251):
            if not tasks:
                return
            written = {name: self._write(name) for name in tasks}
            self.sources.update(self.last)
            tasks = self._next(written)
            for name in tasks:
                self._draw(name)

    def _write(self, name: str) -> set[Any]:
        """What a node writes in this step: targets, and joins that it has a part in."""
        written: set[Any] = {each for each in self.program.plain[name] if each != END}
        written |= {join for join in self.program.joins if name in join[0]}
        may = set[Any]()
        if name not in self.declared:
            declared = {each for row in self.program.routes[name] for each in row.targets or ()}
            self.edges |= {(name, END, True) for each in declared if each == END}
            may = declared - {END}
            self.declared[name] = {(each, True) for each in may}
        sources = {(each, each in may) for each in written | may} | self.declared[name]
        self.last[name] = sources
        return written | may

    def _next(self, written: dict[str, set[Any]]) -> set[str]:
        found: set[str] = set()
        self.last = {name: self.last[name] for name in written}
        for name, row in written.items():
            for each in row:
                if isinstance(each, str):
                    found.add(each)
                else:
                    self.joins[each].add(name)
        for join, seen in self.joins.items():
            if seen >= {*join[0]}:
                seen.clear()
                found.add(join[1])
        self.waiting |= found & self.program.defer
        found -= self.program.defer
        if not found:
            found, self.waiting = self.waiting, set()
        return found

    def _draw(self, name: str) -> None:
        """Also an edge of a join that is not complete, if something else triggers the node."""
        triggers = {name, *(join for join in self.program.joins if join[1] == name)}
        added = False
        inverse = {
            (trigger, source, may)
            for source, row in self.sources.items()
            for trigger, may in row
            if trigger in triggers
        }
        for trigger, source, may in inverse:
            self.edges.add((source, name, may))
            if (trigger, may) in self.last.get(source, ()):
                added = True
            else:
                self.sources[source].discard((trigger, may))
        if not added:
            self.edges |= {(source, name, True) for source in self.last}


def _new_edges(program: Program) -> list[Edge]:
    simulation = _Simulation(program)
    simulation.run()
    edges: dict[tuple[str, str], bool] = {}
    for source, target, may in sorted(simulation.edges):
        edges.setdefault((source, target), may)
    sources = {source for source, _ in edges}
    termini = {target for _, target in edges if target != END} - sources
    for each in sorted(termini):
        edges.setdefault((each, END), False)
    if not termini and len(simulation.last) == 1 and not any(to == END for _, to in edges):
        for each in simulation.last:
            edges.setdefault((each, END), True)
    return [(source, target, may) for (source, target), may in edges.items()]
