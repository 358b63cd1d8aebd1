"""An interpreter of statecharts, written from appendix D of the W3C's SCXML alone: a judge.

It knows states, parallels, finals, initial elements, internal and eventless transitions, event
descriptors and ``done.state`` events. Data is not read: a condition may hold or not, anew at each
selection. It explores all sequences of external events: for each descriptor that descriptor and a
longer name, and an event that nobody names.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET  # what is read here was written by tests
from dataclasses import dataclass, field
from itertools import product

import networkx as nx

from gpsfsm.compile.formats.outcomes import is_failure

SCXML = "{http://www.w3.org/2005/07/scxml}"
_INTERNAL = ("done.state.", "done.invoke.", "error.execution", "error.communication")
_UNKNOWN = "an_event_of_nobody"
MOST = 3_000
Configuration = frozenset[int]
Queue = tuple[str, ...]


class TooManyError(Exception):
    """The chart has more configurations than this looks at."""


@dataclass(frozen=True)
class Transition:
    """A transition, with the numbers of its source and its targets."""

    source: int
    events: tuple[str, ...]
    targets: tuple[int, ...]
    cond: bool
    internal: bool
    number: int

    def matches(self, event: str | None) -> bool:
        """True if it is enabled by the event (None: by none), as far as its names say."""
        if event is None or not self.events:
            return event is None and not self.events
        words = event.split(".")
        return any(each == [] or words[: len(each)] == each for each in map(tokens, self.events))


def tokens(descriptor: str) -> list[str]:
    """The tokens that the name of an event has to begin with."""
    return [each for each in descriptor.split(".") if each not in ("", "*")]


@dataclass
class Verdict:
    """What a chart can do."""

    completes: bool = False
    gives_up: bool = False
    stuck: bool = False
    endless: bool = False
    waits: bool = False  # for a transition of a state around others, and for nothing else
    acting: set[frozenset[str]] = field(default_factory=set)  # atomic states, in stable moments
    passing: set[frozenset[str]] = field(default_factory=set)  # in others too


class Chart:
    """A statechart in document order; state 0 is the root."""

    def __init__(self, text: str) -> None:
        self.tags: list[str] = []
        self.names: list[str] = []
        self.parents: list[int] = []
        self.children: list[list[int]] = []
        self.transitions: list[list[Transition]] = []
        self._elements: list[ET.Element] = []
        self._add(ET.fromstring(text), -1)  # noqa: S314
        self.numbers = {name: number for number, name in enumerate(self.names) if name}
        count = 0
        for number, element in enumerate(self._elements):
            for each in element.findall(f"{SCXML}transition"):
                self.transitions[number].append(
                    Transition(
                        number,
                        tuple(each.get("event", "").split()),
                        tuple(self.numbers[name] for name in each.get("target", "").split()),
                        "cond" in each.attrib,
                        each.get("type") == "internal",
                        count,
                    )
                )
                count += 1
        self._spins = False  # a macrostep need not end
        self._passed: set[Configuration] = set()
        self.initial = [self._initial(number) for number in range(len(self.tags))]

    def _add(self, element: ET.Element, parent: int) -> None:
        number = len(self.tags)
        self.tags.append(element.tag.removeprefix(SCXML))
        self.names.append(element.get("id", ""))
        self.parents.append(parent)
        self.children.append([])
        self.transitions.append([])
        self._elements.append(element)
        if parent >= 0:
            self.children[parent].append(number)
        for child in element:
            if child.tag in {f"{SCXML}{tag}" for tag in ("state", "parallel", "final")}:
                self._add(child, number)

    def _initial(self, number: int) -> list[int]:
        element = self._elements[number]
        named = element.get("initial", "").split()
        for each in element.findall(f"{SCXML}initial/{SCXML}transition"):
            named = each.get("target", "").split()
        return [self.numbers[name] for name in named] or self.children[number][:1]

    def ancestors(self, state: int) -> list[int]:
        """The states around a state, the innermost first, with the root."""
        rows = []
        while state:
            state = self.parents[state]
            rows.append(state)
        return rows

    def is_atomic(self, state: int) -> bool:
        """True for states without states in them."""
        return not self.children[state]

    def is_compound(self, state: int) -> bool:
        """True for the root, and states (no parallels) with states in them."""
        return bool(self.children[state]) and self.tags[state] != "parallel"

    def is_final(self, configuration: Configuration, state: int) -> bool:
        """isInFinalState."""
        if self.tags[state] == "parallel":
            return all(self.is_final(configuration, each) for each in self.children[state])
        return any(
            self.tags[each] == "final" and each in configuration for each in self.children[state]
        )

    # -- selection --------------------------------------------------------------------------

    def selections(self, at: Configuration, event: str | None) -> list[list[Transition]]:
        """The sets of transitions that an event may select, by what the conditions say."""
        on_ways = {each for state in at for each in self.transitions[state] if each.matches(event)}
        conditions = sorted((each for each in on_ways if each.cond), key=lambda each: each.number)
        if len(conditions) > 6:
            raise TooManyError
        found: list[list[Transition]] = []
        for values in product((True, False), repeat=len(conditions)):
            false = {each for each, value in zip(conditions, values, strict=True) if not value}
            chosen: list[Transition] = []
            for state in sorted(at):
                if self.is_atomic(state):
                    first = next(
                        (
                            each
                            for around in (state, *self.ancestors(state))
                            for each in self.transitions[around]
                            if each in on_ways and each not in false
                        ),
                        None,
                    )
                    if first is not None and first not in chosen:
                        chosen.append(first)
            chosen = self._without_conflicts(at, chosen)
            if chosen not in found:
                found.append(chosen)
        return found

    def _without_conflicts(self, at: Configuration, chosen: list[Transition]) -> list[Transition]:
        kept: list[Transition] = []
        for one in chosen:
            removed = []
            for other in kept:
                if self.exits(at, [one]) & self.exits(at, [other]):
                    if other.source in self.ancestors(one.source):
                        removed.append(other)
                    else:
                        break
            else:
                kept = [each for each in kept if each not in removed] + [one]
        return kept

    def domain(self, each: Transition) -> int:
        """getTransitionDomain."""
        inside = all(each.source in self.ancestors(target) for target in each.targets)
        if each.internal and self.is_compound(each.source) and inside:
            return each.source
        return next(
            around
            for around in self.ancestors(each.source)
            if self.is_compound(around)
            and all(around in self.ancestors(target) for target in each.targets)
        )

    def exits(self, at: Configuration, chosen: list[Transition]) -> set[int]:
        """computeExitSet."""
        return {
            state
            for each in chosen
            if each.targets
            for state in at
            if self.domain(each) in self.ancestors(state)
        }

    # -- steps ------------------------------------------------------------------------------

    def entered(self, targets: list[int], around: int) -> set[int]:
        """The states to be entered for targets in the state ``around``."""
        rows: set[int] = set()
        for target in targets:
            self._descendants(target, rows)
        for target in targets:
            self._ancestors(target, around, rows)
        return rows

    def _descendants(self, state: int, rows: set[int]) -> None:
        rows.add(state)
        if self.is_compound(state):
            for each in self.initial[state]:
                self._descendants(each, rows)
            for each in self.initial[state]:
                self._ancestors(each, state, rows)
        else:
            for child in self.children[state]:
                if not any(child == row or child in self.ancestors(row) for row in rows):
                    self._descendants(child, rows)

    def _ancestors(self, state: int, around: int, rows: set[int]) -> None:
        for each in self.ancestors(state):
            if each == around:
                break
            rows.add(each)
            if self.tags[each] == "parallel":
                for child in self.children[each]:
                    if not any(child == row or child in self.ancestors(row) for row in rows):
                        self._descendants(child, rows)

    def microstep(self, at: Configuration, chosen: list[Transition]) -> tuple[Configuration, Queue]:
        """The configuration after transitions, and the events that it raises."""
        rows: set[int] = set()
        for each in chosen:
            if each.targets:
                rows |= self.entered(list(each.targets), self.domain(each))
        after = set(at) - self.exits(at, chosen)
        return self._enter(frozenset(after), rows)

    def _enter(self, at: Configuration, rows: set[int]) -> tuple[Configuration, Queue]:
        after, raised = set(at), []
        for state in sorted(rows):
            after.add(state)
            parent = self.parents[state]
            if self.tags[state] == "final" and parent:
                raised.append(f"done.state.{self.names[parent]}")
                outer = self.parents[parent]
                if self.tags[outer] == "parallel" and all(
                    self.is_final(frozenset(after), each) for each in self.children[outer]
                ):
                    raised.append(f"done.state.{self.names[outer]}")
        return frozenset(after), tuple(raised)

    def settled(self, at: Configuration, queue: Queue) -> set[Configuration]:
        """The stable configurations that a macrostep may lead to."""
        stable: set[Configuration] = set()
        seen = {(at, queue)}
        graph: nx.DiGraph[object] = nx.DiGraph()
        pending = [(at, queue)]
        while pending:
            here = pending.pop()
            at, queue = here
            for after in self._next(at, queue):
                if after is None:
                    stable.add(at)
                    continue
                graph.add_edge(here, after)
                if after not in seen:
                    seen.add(after)
                    pending.append(after)
            if len(seen) > MOST:
                raise TooManyError
        self._passed |= {at for at, _ in seen}
        self._spins = self._spins or not nx.is_directed_acyclic_graph(graph)
        return stable

    def _next(self, at: Configuration, queue: Queue) -> list[tuple[Configuration, Queue] | None]:
        if self.end(at) is not None:
            return [None]
        rows: list[tuple[Configuration, Queue] | None] = []
        for chosen in self.selections(at, None):
            if chosen:
                after, raised = self.microstep(at, chosen)
                rows.append((after, queue + raised))
            elif not queue:
                rows.append(None)
            else:
                for taken in self.selections(at, queue[0]):
                    after, raised = self.microstep(at, taken)
                    rows.append((after, queue[1:] + raised))
        return rows

    def end(self, at: Configuration) -> int | None:
        """The final state of the root that is active."""
        return next(
            (each for each in at if self.tags[each] == "final" and not self.parents[each]), None
        )

    # -- everything -------------------------------------------------------------------------

    def alphabet(self) -> list[str]:
        """External events that make all the differences that the chart can tell."""
        names = {_UNKNOWN}
        for rows in self.transitions:
            for each in rows:
                for descriptor in each.events:
                    name = ".".join(tokens(descriptor))
                    if name and not f"{name}.".startswith(_INTERNAL):
                        names |= {name, f"{name}.{_UNKNOWN}"}
        return sorted(names)

    def verdict(self) -> Verdict:
        """What the chart can do. Raises TooManyError."""
        verdict, events = Verdict(), self.alphabet()
        start, raised = self._enter(frozenset([0]), self.entered(self.initial[0], 0))
        pending = list(self.settled(start, raised))
        seen = set(pending)
        graph: nx.MultiDiGraph[Configuration] = nx.MultiDiGraph()
        while pending:
            at = pending.pop()
            end = self.end(at)
            if end is not None:
                failed = is_failure(self.names[end])
                verdict.gives_up, verdict.completes = (
                    verdict.gives_up or failed, verdict.completes or not failed
                )  # fmt: skip
                continue
            verdict.acting.add(self.acting(at))
            sources = self._step(at, events, graph)
            verdict.stuck = verdict.stuck or not sources
            verdict.waits = verdict.waits or (
                bool(sources) and not any(self.is_atomic(each) for each in sources)
            )
            for after in list(graph.successors(at)) if at in graph else []:
                if after not in seen:
                    seen.add(after)
                    pending.append(after)
            if len(seen) > MOST:
                raise TooManyError
        verdict.endless = self._spins or any(
            self._goes_on(graph, part) for part in nx.strongly_connected_components(graph)
        )
        verdict.passing = {self.acting(at) for at in self._passed}
        return verdict

    def acting(self, at: Configuration) -> frozenset[str]:
        """The atomic states of a configuration."""
        return frozenset(
            self.names[each] for each in at if self.is_atomic(each) and self.tags[each] != "final"
        )

    def _step(
        self, at: Configuration, events: list[str], graph: nx.MultiDiGraph[Configuration]
    ) -> set[int]:
        """Add what events lead to; the sources of all transitions that may be taken."""
        sources: set[int] = set()
        for event in (None, *events):
            for chosen in self.selections(at, event):
                if not chosen:
                    continue
                sources |= {each.source for each in chosen}
                after, raised = self.microstep(at, chosen)
                moved = self.exits(at, chosen) | {each.source for each in chosen}
                for stable in self.settled(after, raised):
                    graph.add_edge(at, stable, moved=frozenset(moved))
        return sources

    def _goes_on(self, graph: nx.MultiDiGraph[Configuration], part: set[Configuration]) -> bool:
        """True if a run can stay here for ever, and no state waits for ever for its own events."""
        inside = graph.subgraph(part)
        if not inside.number_of_edges():
            return False
        always = frozenset.intersection(*part)
        moved = {state for *_, rows in inside.edges(data="moved") for state in rows}
        return all(
            state in moved for state in always if self.is_atomic(state) and self.transitions[state]
        )
