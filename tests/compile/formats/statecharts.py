"""An interpreter of statecharts, written from appendix D of the W3C's SCXML alone: a judge.

It knows states, parallels, finals, histories, initial elements, internal and eventless transitions,
event descriptors, ``done.state`` events, and executable content with the events that it raises.
Data is not read: a condition that is no literal and no ``In('id')`` may hold or not, or fail, anew
at each selection. It explores all sequences of external events: for each descriptor that descriptor
and a longer name, an event that nobody names, and what services and delayed events answer.

At most two errors of conditions wait in the internal queue at a time: a condition that always fails
makes more and more of them. Events that no transition names are not kept in the queue.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET  # what is read here was written by tests
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import product
from typing import NamedTuple

import networkx as nx

from gpsfsm.compile.formats.outcomes import is_failure
from tests.compile.formats.statechart_content import (
    COMMUNICATION,
    EXECUTION,
    INTERNAL,
    SCXML,
    Content,
    Queue,
    TooManyError,
    holds,
    is_evaluated,
    is_foreign,
)
from tests.compile.formats.statechart_tree import (
    Configuration,
    Entry,
    History,
    Transition,
    Tree,
    tokens,
)

__all__ = ["MOST", "Chart", "Moment", "TooManyError", "Verdict"]

_INTERNAL = ("done.state.", "done.invoke.", "error.execution.", "error.communication.")
_UNKNOWN = "an_event_of_nobody"
MOST = 3_000
_MOST_WAITING = 30
_MOST_ERRORS = 2


class Moment(NamedTuple):
    """Where a run is: its configuration, what its histories hold, the internal queue."""

    at: Configuration
    history: History = ()
    queue: Queue = ()


class Step(NamedTuple):
    """A moment that may follow, and what has moved; fault: by a condition that failed."""

    after: Moment
    moved: frozenset[int]
    fault: bool


Selection = tuple[tuple[Transition, ...], Queue]


@dataclass
class Verdict:
    """What a chart can do."""

    completes: bool = False
    gives_up: bool = False
    stuck: bool = False
    endless: bool = False
    waits: bool = False  # for a transition of a state around others, and for nothing else
    faulty: bool = False  # goes on for ever, if conditions fail again and again
    acting: set[frozenset[str]] = field(default_factory=set)  # atomic states, in stable moments
    passing: set[frozenset[str]] = field(default_factory=set)  # in others too


class Chart(Tree):
    """A statechart that runs. With ``fails=False`` nothing that it evaluates or sends fails."""

    def __init__(self, text: str, *, fails: bool = True) -> None:
        super().__init__(text)
        self._heard: dict[str, bool] = {}
        self._blocks: dict[tuple[int, Configuration], frozenset[Queue]] = {}
        self._selections: dict[tuple[Configuration, History, str | None], list[Selection]] = {}
        self._settled: dict[Moment, dict[Moment, frozenset[int]]] = {}
        self.spins = False  # a macrostep need not end
        self.faulty = False  # nor if conditions fail again and again
        self._passed: set[Configuration] = set()
        root = self.elements[0]
        self.content = Content(self.is_heard, self._all_names(), fails, root.get("datamodel", ""))
        self._late = root.get("binding") == "late"
        self._invoking = {
            number for number in range(len(self.tags)) if self.inside(number, "invoke")
        }

    def is_heard(self, event: str) -> bool:
        """True if a transition of the chart waits for such an event."""
        if event not in self._heard:
            self._heard[event] = any(
                each.events and each.matches(event) for rows in self.transitions for each in rows
            )
        return self._heard[event]

    # -- selection --------------------------------------------------------------------------

    def selections(self, here: Moment, event: str | None) -> list[Selection]:
        """The sets of transitions that an event may select, and the errors of conditions."""
        key = (here.at, here.history, event)
        if key not in self._selections:
            self._selections[key] = self._all_selections(here, event)
        waiting = here.queue.count(EXECUTION)
        rows: list[Selection] = []
        for chosen, errors in self._selections[key]:
            row = (chosen, errors[: max(0, _MOST_ERRORS - waiting)])
            if row not in rows:
                rows.append(row)
        return rows

    def _all_selections(self, here: Moment, event: str | None) -> list[Selection]:
        active = self.active(here.at)
        values = {
            each: holds(each.cond, active)
            for state in sorted(here.at)
            for each in self.transitions[state]
            if each.matches(event)
        }
        found: list[Selection] = []
        fails = self.content.fails and self.is_heard(EXECUTION)
        answers: dict[Transition, tuple[bool | None, ...]] = {}
        for each, value in values.items():
            if value is None:
                answers[each] = (True, False, None) if fails else (True, False)
            elif self.content.fails and is_foreign(each.cond, self.content.model):
                answers[each] = (value, None) if fails else (value, False)
        unknown = list(answers)
        if len(unknown) > 6:
            raise TooManyError
        for some in product(*answers.values()):
            chosen, failed = self._chosen(here.at, values | dict(zip(unknown, some, strict=True)))
            kept = tuple(self._without_conflicts(here, chosen))
            # whether a condition that is looked at twice fails twice is not said
            for count in range(min(len(set(failed)), _MOST_ERRORS), len(failed) + 1):
                row = (kept, (EXECUTION,) * min(count, _MOST_ERRORS))
                if row not in found:
                    found.append(row)
        return found

    def _chosen(
        self, at: Configuration, values: dict[Transition, bool | None]
    ) -> tuple[list[Transition], list[Transition]]:
        """The transitions that are enabled, and those whose conditions failed (None) on the way."""
        chosen: list[Transition] = []
        failed: list[Transition] = []
        for state in sorted(at):
            if not self.is_atomic(state):
                continue
            for each in self._ways(state):
                value = values.get(each, False)
                if value:
                    if each not in chosen:
                        chosen.append(each)
                    break
                if value is None:
                    failed.append(each)
        return chosen, failed

    def _ways(self, state: int) -> list[Transition]:
        return [
            each for around in (state, *self.ancestors(state)) for each in self.transitions[around]
        ]

    def _without_conflicts(self, here: Moment, chosen: list[Transition]) -> list[Transition]:
        kept: list[Transition] = []
        for one in chosen:
            removed = []
            for other in kept:
                if self.exits(here, [one]) & self.exits(here, [other]):
                    if other.source in self.ancestors(one.source):
                        removed.append(other)
                    else:
                        break
            else:
                kept = [each for each in kept if each not in removed] + [one]
        return kept

    def effective(self, targets: Iterable[int], history: History) -> list[int]:
        """getEffectiveTargetStates."""
        rows: list[int] = []
        for each in targets:
            if self.tags[each] != "history":
                rows.append(each)
            elif each in dict(history):
                rows += sorted(dict(history)[each])
            else:
                rows += self.effective(self.transitions[each][0].targets, history)
        return rows

    def domain(self, each: Transition, history: History) -> int:
        """getTransitionDomain."""
        targets = self.effective(each.targets, history)
        inside = all(each.source in self.ancestors(target) for target in targets)
        if each.internal and self.is_compound(each.source) and inside:
            return each.source
        return next(
            around
            for around in self.ancestors(each.source)
            if self.is_compound(around)
            and all(around in self.ancestors(target) for target in targets)
        )

    def exits(self, here: Moment, chosen: Iterable[Transition]) -> set[int]:
        """computeExitSet."""
        return {
            state
            for each in chosen
            if each.targets
            for state in here.at
            if self.domain(each, here.history) in self.ancestors(state)
        }

    # -- steps ------------------------------------------------------------------------------

    def microstep(self, here: Moment, chosen: Iterable[Transition]) -> set[Moment]:
        """The moments that may be after transitions."""
        leaving = sorted(self.exits(here, chosen), reverse=True)
        history = self._remembered(here, leaving)
        at, queues = here.at, frozenset([here.queue])
        for state in leaving:
            for each in self.inside(state, "onexit"):
                queues = self._run(queues, each, at)
            at -= {state}
        entry = Entry(self, history)
        for way in chosen:
            queues = self._run(queues, way.content, at)
        for way in chosen:
            if way.targets:
                self._add_targets(entry, way.targets, history, self.domain(way, history))
        at, queues = self._enter(at, queues, entry)
        return {Moment(at, history, queue) for queue in queues}

    def _add_targets(
        self, entry: Entry, targets: Iterable[int], history: History, around: int
    ) -> None:
        for target in targets:
            entry.descendants(target)
        for target in self.effective(targets, history):
            entry.ancestors(target, around)

    def _remembered(self, here: Moment, leaving: list[int]) -> History:
        history = dict(here.history)
        for state in leaving:
            for each in self.histories[state]:
                deep = self.elements[each].get("type") == "deep"
                history[each] = frozenset(
                    other
                    for other in here.at
                    if (deep and self.is_atomic(other) and state in self.ancestors(other))
                    or (not deep and self.parents[other] == state)
                )
        return tuple(sorted(history.items()))

    def _run(
        self,
        queues: frozenset[Queue],
        block: ET.Element | tuple[ET.Element, ...],
        at: Configuration,
    ) -> frozenset[Queue]:
        """The queues after a block."""
        if not len(block):
            return queues
        key = (id(block), at)  # blocks live as long as the chart
        if key not in self._blocks:
            self._blocks[key] = self.content.queues(block, self.active(at))
        return self._longer(queues, self._blocks[key])

    def _longer(self, queues: frozenset[Queue], more: frozenset[Queue]) -> frozenset[Queue]:
        rows = frozenset(queue + other for queue in queues for other in more)
        if len(rows) > MOST or any(len(queue) > _MOST_WAITING for queue in rows):
            raise TooManyError
        return rows

    def _enter(
        self, at: Configuration, queues: frozenset[Queue], entry: Entry
    ) -> tuple[Configuration, frozenset[Queue]]:
        for state in sorted(entry.states):
            at |= {state}
            if self._late:
                queues = self._longer(queues, self.content.errors(self._data(state)))
            for each in self.inside(state, "onentry"):
                queues = self._run(queues, each, at)
            if state in entry.defaults:
                queues = self._run(queues, self.initial[state].content, at)
            if state in entry.contents:
                queues = self._run(queues, entry.contents[state], at)
            if self.tags[state] == "final" and self.parents[state]:
                queues = self._longer(queues, self.content.errors(self._asked(state)))
                queues = self._longer(queues, frozenset([self._done(at, state)]))
        return at, queues

    def _data(self, state: int) -> int:
        """How many values of data in a state may fail, two at most."""
        rows = self.elements[state].findall(f"{SCXML}datamodel/{SCXML}data")
        return min(len([each for each in rows if len(each.attrib) > 1 or each.text]), _MOST_ERRORS)

    def _asked(self, state: int) -> int:
        """How many expressions of the data of a final state may fail, two at most."""
        rows = [each for data in self.inside(state, "donedata") for each in data]
        return min(len([each for each in rows if is_evaluated(each)]), _MOST_ERRORS)

    def _done(self, at: Configuration, state: int) -> Queue:
        parent = self.parents[state]
        rows = [f"done.state.{self.names[parent]}"]
        outer = self.parents[parent]
        if self.tags[outer] == "parallel" and all(
            self.is_final(at, each) for each in self.children[outer]
        ):
            rows.append(f"done.state.{self.names[outer]}")
        return tuple(filter(self.is_heard, rows))

    def settled(self, start: Moment) -> dict[Moment, frozenset[int]]:
        """The stable moments that a macrostep may lead to, and what moves on the ways."""
        if start not in self._settled:
            self._settled[start] = self._settle(start)
        return self._settled[start]

    def _settle(self, start: Moment) -> dict[Moment, frozenset[int]]:
        stable: list[Moment] = []
        seen = {start}
        graph: nx.DiGraph[Moment] = nx.DiGraph()
        graph.add_node(start)
        pending = [start]
        while pending:
            here = pending.pop()
            for step in self._next(here):
                if step is None:
                    stable.append(here)
                    continue
                self._add_edge(graph, here, step)
                if step.after not in seen:
                    seen.add(step.after)
                    pending.append(step.after)
            if len(seen) > MOST:
                raise TooManyError
        self._passed |= {each.at for each in seen}
        self._look_for_circles(graph)
        return {Moment(each.at, each.history): self._moved(graph, each) for each in stable}

    def _add_edge(self, graph: nx.DiGraph[Moment], here: Moment, step: Step) -> None:
        moved, fault = step.moved, step.fault
        if graph.has_edge(here, step.after):
            before = graph.edges[here, step.after]
            moved, fault = moved | before["moved"], fault and before["fault"]
        graph.add_edge(here, step.after, moved=moved, fault=fault)

    def _look_for_circles(self, graph: nx.DiGraph[Moment]) -> None:
        if nx.is_directed_acyclic_graph(graph):
            return
        self.faulty = True
        sound = [(here, after) for here, after, row in graph.edges(data=True) if not row["fault"]]
        self.spins = self.spins or not nx.is_directed_acyclic_graph(nx.DiGraph(sound))

    def _moved(self, graph: nx.DiGraph[Moment], stable: Moment) -> frozenset[int]:
        ways = graph.subgraph(nx.ancestors(graph, stable) | {stable})
        return frozenset(state for *_, row in ways.edges(data=True) for state in row["moved"])

    def _next(self, here: Moment) -> list[Step | None]:
        """What may follow within a macrostep. None: it may be over."""
        if self.end(here.at) is not None:
            return [None]
        rows: list[Step | None] = []
        for chosen, errors in self.selections(here, None):
            queue = here.queue + errors
            if chosen:
                rows += self._steps(here._replace(queue=queue), chosen, bool(errors))
            elif not queue:
                rows.append(None)
            else:
                later = here._replace(queue=queue[1:])
                for taken, more in self.selections(later, queue[0]):
                    after = later._replace(queue=later.queue + more)
                    rows += self._steps(after, taken, bool(errors or more))
        return rows

    def _steps(self, here: Moment, chosen: tuple[Transition, ...], fault: bool) -> list[Step]:
        moved = self._moves(here, chosen)
        return [Step(after, moved, fault) for after in self.microstep(here, chosen)]

    def _moves(self, here: Moment, chosen: tuple[Transition, ...]) -> frozenset[int]:
        return frozenset(self.exits(here, chosen) | {each.source for each in chosen})

    # -- everything -------------------------------------------------------------------------

    def _all_names(self) -> tuple[str, ...]:
        """The names that descriptors begin with, and one of nobody."""
        descriptors = {
            ".".join(tokens(name))
            for rows in self.transitions
            for each in rows
            for name in each.events
        }
        return tuple(sorted((descriptors - {""}) | {_UNKNOWN}))

    def alphabet(self) -> list[str]:
        """External events that make all the differences that the chart can tell."""
        own = self._sent() | self._answered()
        names = {_UNKNOWN} | {each for each in own if self.is_heard(each)}
        for name in self._all_names():
            if not f"{name}.".startswith(_INTERNAL):
                names |= {name, f"{name}.{_UNKNOWN}"} if name != _UNKNOWN else {name}
        return sorted(names)

    def _sent(self) -> set[str]:
        """What the chart may send to itself, or learns of what it has sent, by external events."""
        names: set[str] = set()
        for each in self.elements[0].iter(f"{SCXML}send"):
            if each.get("target") == INTERNAL:
                continue
            if "target" not in each.attrib:
                computed = {e for e in self._all_names() if not f"{e}.".startswith(_INTERNAL)}
                names |= {each.attrib["event"]} if "event" in each.attrib else computed
            abroad = {"target", "targetexpr", "typeexpr", "type"} & {*each.attrib}
            if abroad and {"delay", "delayexpr"} & {*each.attrib} and self.content.fails:
                names.add(COMMUNICATION)
        return names

    def _answered(self) -> set[str]:
        """The ends of services."""
        return {
            f"done.invoke.{each.get('id') or f'{self.names[state]}.{_UNKNOWN}'}"
            for state in self._invoking
            for each in self.inside(state, "invoke")
        }

    def first(self) -> set[Moment]:
        """The stable moments before any external event."""
        places = range(len(self.tags)) if not self._late else range(1)
        count = min(sum(map(self._data, places)), _MOST_ERRORS)
        queues = self.content.errors(count)
        for each in self.inside(0, "script"):
            queues = self._longer(queues, self.content.queues([each], frozenset()))
        entry = Entry(self, ())
        self._add_targets(entry, self.initial[0].targets, (), 0)
        at, queues = self._enter(frozenset([0]), queues, entry)
        return {stable for queue in queues for stable in self.settled(Moment(at, (), queue))}

    def events(self, at: Configuration) -> list[str | None]:
        """What may come: None is another look at what needs no event."""
        rows: list[str | None] = [None, *self.alphabet()]
        if self.content.fails and any(state in self._invoking for state in at):
            rows += [each for each in (EXECUTION, COMMUNICATION) if self.is_heard(each)]
        return rows

    def reactions(self, here: Moment, event: str | None) -> list[tuple[Moment, frozenset[int]]]:
        """The stable moments after an external event, and what moved."""
        rows = []
        for (chosen, errors), queue in product(
            self.selections(here, event), self._finalized(here.at, event)
        ):
            start = here._replace(queue=queue + errors)
            moved = self._moves(here, chosen)
            for after in self.microstep(start, chosen):
                for stable, more in self.settled(after).items():
                    rows.append((stable, moved | more))
        return rows

    def _finalized(self, at: Configuration, event: str | None) -> frozenset[Queue]:
        """What the handlers of the events of services may raise."""
        rows = frozenset[Queue]([()])
        for state in self._invoking & at if event is not None else ():
            for each in self.elements[state].findall(f"{SCXML}invoke/{SCXML}finalize"):
                rows |= self._run(frozenset([()]), each, at)
        return rows

    def after(self, moments: Iterable[Moment], event: str) -> set[Moment]:
        """The stable moments after an external event at one of these."""
        rows: set[Moment] = set()
        for here in moments:
            if self.end(here.at) is not None:
                rows.add(here)
            else:
                rows |= {stable for stable, *_ in self.reactions(here, event)}
        return rows

    def verdict(self) -> Verdict:
        """What the chart can do. Raises TooManyError."""
        verdict = Verdict()
        pending = list(self.first())
        seen = set(pending)
        graph: nx.MultiDiGraph[Moment] = nx.MultiDiGraph()
        while pending:
            here = pending.pop()
            end = self.end(here.at)
            if end is not None:
                failed = is_failure(self.names[end])
                verdict.gives_up, verdict.completes = (
                    verdict.gives_up or failed, verdict.completes or not failed
                )  # fmt: skip
                continue
            verdict.acting.add(self.acting(here.at))
            sources = self._step(here, graph)
            verdict.stuck = verdict.stuck or not sources
            verdict.waits = verdict.waits or (
                bool(sources) and not any(self.is_atomic(each) for each in sources)
            )
            for after in list(graph.successors(here)) if here in graph else []:
                if after not in seen:
                    seen.add(after)
                    pending.append(after)
            if len(seen) > MOST:
                raise TooManyError
        verdict.endless = self.spins or any(
            self._goes_on(graph, part) for part in nx.strongly_connected_components(graph)
        )
        verdict.faulty = self.faulty
        verdict.passing = {self.acting(at) for at in self._passed}
        return verdict

    def _step(self, here: Moment, graph: nx.MultiDiGraph[Moment]) -> set[int]:
        """Add what events lead to; the sources of all transitions that may be taken."""
        found: set[int] = set()
        for event in self.events(here.at):
            for chosen, _ in self.selections(here, event):
                found |= {each.source for each in chosen}
            for stable, moved in self.reactions(here, event):
                if moved:
                    graph.add_edge(here, stable, moved=moved)
        return found

    def _goes_on(self, graph: nx.MultiDiGraph[Moment], part: set[Moment]) -> bool:
        """True if a run can stay here for ever, and no state waits for ever for its own events."""
        inside = graph.subgraph(part)
        if not inside.number_of_edges():
            return False
        always = frozenset.intersection(*(each.at for each in part))
        moved = {state for *_, row in inside.edges(data=True) for state in row["moved"]}
        return all(
            state in moved for state in always if self.is_atomic(state) and self.transitions[state]
        )
