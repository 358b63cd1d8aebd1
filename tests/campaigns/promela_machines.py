"""Promela models of machines, written from the graph and section 9 of docs/semantics.md alone.

One process chooses which active runner has which outcome. An instant is one step in which all
events are evaluated from what was before, again and again until none changes: since none causes
itself, this is the one set of events that section 9.2 speaks of, and no order has to be known.

A run for ever is a cycle through ``accept_end``. It is passed whenever all runners that were active
when it was passed last have come to an end since, in a run that has not ended.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tests.campaigns.promela import Model

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import networkx as nx

__all__ = ["machine_model"]

_OUTCOMES = ("SUCCEEDED", "FAILED")


class _Writer:
    """The names of variables: ``e…`` events, ``s…`` states, ``i…`` inputs, ``f…`` fired joins."""

    def __init__(self, graph: nx.MultiDiGraph[Any], outcomes: Mapping[str, frozenset[str]]) -> None:
        self.outcomes = outcomes
        self.kinds: dict[str, str] = {name: data["kind"] for name, data in graph.nodes(data=True)}
        self.runners = [name for name, kind in self.kinds.items() if kind == "runner"]
        self.joins = {
            name: graph.nodes[name]["need"] for name, kind in self.kinds.items() if kind == "join"
        }
        self.edges = [
            (source, target, data["event"], data["action"])
            for source, target, data in graph.edges(data=True)
        ]
        self.inputs = {
            join: [
                (f"i{number}", self.event(source, event))
                for number, (source, target, event, action) in enumerate(self.edges)
                if target == join and action == "trigger"
            ]
            for join in self.joins
        }

    def event(self, name: str, event: str) -> str:
        kind = self.kinds[name]
        return "begins" if kind == "start" else f"e_{name}_{event}"

    def any_of(self, target: str, action: str) -> str:
        events = [
            self.event(source, event)
            for source, to, event, how in self.edges
            if (to, how) == (target, action)
        ]
        return f"({' || '.join(events) or 'false'})"

    def end(self, kind: str) -> str:
        names = [name for name, each in self.kinds.items() if each == kind]
        return " || ".join(self.any_of(name, "trigger") for name in names) or "false"

    # -- an instant -------------------------------------------------------------------------

    def definitions(self) -> Iterator[tuple[str, str]]:
        """Each event that may follow, and when it happens."""
        for name in self.runners:
            stopped = f"(s_{name} != 0 && {self.any_of(name, 'stop')})"
            yield self.event(name, "STOPPED"), stopped
            triggered = self.any_of(name, "trigger")
            yield self.event(name, "STARTED"), f"{triggered} && (s_{name} == 0 || {stopped})"
        for name, need in self.joins.items():
            stopped = self.any_of(name, "stop")
            count = " + ".join(f"({self.arrives(name, *each)})" for each in self.inputs[name])
            fired = f"(f_{name} && !{stopped})"
            yield self.event(name, "SUCCEEDED"), f"({count or '0'}) >= {need} && !{fired}"

    def arrives(self, join: str, kept: str, event: str) -> str:
        return f"({kept} && !{self.any_of(join, 'stop')}) || {event}"

    def instant(self) -> Iterator[str]:
        yield "inline instant() {"
        yield "  again = true;"
        yield "  do"
        yield "  :: !again -> break"
        yield "  :: again -> again = false;"
        for event, condition in self.definitions():
            yield f"    new = {condition};"
            yield f"    if :: new != {event} -> {event} = new; again = true :: else fi;"
        yield "  od;"
        yield "  just = false;"
        yield "  if"
        yield f"  :: ended == 0 && ({self.end('give_up')}) -> ended = 2"
        yield f"  :: ended == 0 && !({self.end('give_up')}) && ({self.end('complete')}) ->"
        yield "     ended = 1; just = true"
        yield "  :: else"
        yield "  fi;"
        for name in self.joins:
            yield from self.join(name)
        for name in self.runners:
            stopped, started = self.event(name, "STOPPED"), self.event(name, "STARTED")
            yield f"  w_{name} = w_{name} && !{stopped};"
            yield "  if"
            yield f"  :: {started} -> s_{name} = 1"
            yield f"  :: !{started} && {stopped} -> s_{name} = 0"
            yield "  :: else"
            yield "  fi;"
        for event in self.events():
            yield f"  {event} = false;"
        yield from self.waiting()
        yield "}"

    def join(self, name: str) -> Iterator[str]:
        stopped, fires = self.any_of(name, "stop"), self.event(name, "SUCCEEDED")
        for kept, event in self.inputs[name]:
            yield f"  {kept} = {self.arrives(name, kept, event)};"
        yield f"  f_{name} = (f_{name} && !{stopped}) || {fires};"
        kept_all = [kept for kept, _ in self.inputs[name]]
        yield f"  if :: {' && '.join([f'f_{name}', *kept_all])} -> f_{name} = false;"
        yield from (f"    {kept} = false;" for kept in kept_all)
        yield "    skip :: else fi;"

    def waiting(self) -> Iterator[str]:
        """Everybody who was active at the beginning of the round has come to an end."""
        none = " && ".join(f"!w_{name}" for name in self.runners)
        yield f"  round = ({none}) && ended == 0;"
        yield f"  if :: {none} ->"
        yield from (f"    w_{name} = (s_{name} == 1);" for name in self.runners)
        yield "    skip :: else fi"

    def events(self) -> Iterator[str]:
        yield "begins"
        for name in self.runners:
            yield from (self.event(name, each) for each in ("STARTED", "STOPPED", *_OUTCOMES))
        yield from (self.event(name, "SUCCEEDED") for name in self.joins)

    # -- the whole --------------------------------------------------------------------------

    def variables(self) -> Iterator[str]:
        bits = [*self.events(), "again", "new", "just", "round"]
        bits += [f"f_{name}" for name in self.joins]
        bits += [kept for inputs in self.inputs.values() for kept, _ in inputs]
        bits += [f"w_{name}" for name in self.runners]
        yield from (f"bool {name} = false;" for name in bits)
        yield from (f"byte s_{name} = 0;" for name in self.runners)
        yield "byte ended = 0;"

    def process(self, variables: list[str]) -> Iterator[str]:
        yield "active proctype machine() {"
        yield "  d_step { begins = true; instant(); round = false };"
        yield "  do"
        yield "  :: atomic {"
        yield "    if"
        for name in self.runners:
            for outcome in sorted(self.outcomes[name]):
                after = f"s_{name} = 0; {self.event(name, outcome)} = true"
                if outcome == "HANG":
                    after = f"s_{name} = 2"
                yield f"    :: s_{name} == 1 -> w_{name} = false; {after}"
        yield "    fi;"
        yield "    d_step { instant() } };"
        yield "    if"
        yield "    :: round ->"
        yield "accept_end: round = false"
        yield "    :: else"
        yield "    fi"
        yield from (f"  :: {line}; break" for line in variables)
        yield "  od"
        yield "}"


def machine_model(graph: nx.MultiDiGraph[Any], outcomes: Mapping[str, frozenset[str]]) -> Model:
    """The model of a machine whose nodes have names that are words."""
    writer = _Writer(graph, outcomes)
    still = " && ".join(f"s_{name} != 1" for name in writer.runners)
    queries = [
        ("completes", "", "ended == 1"),
        ("gives_up", "", "ended == 2"),
        ("stuck", "", f"ended == 0 && {still}"),
    ]
    for name in writer.runners:
        queries.append(("reached", name, f"s_{name} != 0"))
        queries.append(("orphan", name, f"just && s_{name} != 0"))
    for name, need in writer.joins.items():
        inputs = " || ".join(kept for kept, _ in writer.inputs[name])
        if need > 1 and inputs:
            waits = f"{still} && ({inputs}) && !f_{name}"
            queries.append(("waits stuck", name, f"{waits} && ended == 0"))
    # The number makes each assertion known in what the verifier prints.
    asserted = [
        f"assert(!(({what}) && {1000 + number} == {1000 + number}))"
        for number, (_, _, what) in enumerate(queries)
    ]
    lines = [*writer.variables(), *writer.instant(), *writer.process(asserted), ""]
    return Model("\n".join(lines), tuple((kind, name) for kind, name, _ in queries))
