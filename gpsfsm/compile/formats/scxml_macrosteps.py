"""Macrosteps of an SCXML document whose active states are all known, and the nodes of its graph.

A macrostep is followed as appendix D of the recommendation says: what is left and entered, then
transitions without event, then the internal queue. Each moment that passes is a node.

    <state id="a"><onentry><raise event="x"/></onentry><transition event="x" target="b"/></state>
    Moment({a}, queue x) → Moment({b}, queue empty), which is stable
"""

from __future__ import annotations

from functools import cached_property
from itertools import product
from math import prod
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeVar

from gpsfsm.compile.formats.elements import place_of
from gpsfsm.compile.formats.scxml_content import Doubt, Effect, Queue, Tokens, begins
from gpsfsm.compile.machines import mark
from gpsfsm.model.capability import CHOICE, TICK
from gpsfsm.model.event import Event
from gpsfsm.model.precision import Approximation, Cause, Reading
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    import networkx as nx

    from gpsfsm.compile.formats.scxml_chart import Chart
    from gpsfsm.model.tree import TreeNode

Memory = dict[int, tuple["TreeNode", ...]]
"""By element of a history: where it leads; its transition comes first if that is followed."""
Pairs = list[tuple[list["TreeNode"], "TreeNode"]]
"""Targets, each with the state around them that stays active."""
T = TypeVar("T")
Signal = tuple[str, Event]
_MOST_MEMORIES: Final = 16
_MOST_SELECTIONS: Final = 64
LONGEST: Final = 200


class Moment(NamedTuple):
    """The active states within a macrostep, and the events in the internal queue.

    ``left``: the states with a history that have been left; None where that is not known.
    """

    active: frozenset[int]
    queue: Queue
    left: frozenset[int] | None = None


class Step(NamedTuple):
    """A moment that follows another one; None where that is stable."""

    moment: Moment | None
    doubts: tuple[Doubt, ...] = ()
    entered: frozenset[int] = frozenset()


class ForkError(Exception):
    """It depends on a history where it goes on."""

    def __init__(self, history: TreeNode) -> None:
        super().__init__(history)
        self.history = history


class Macrosteps:
    """The macrosteps of a chart."""

    def __init__(self, chart: Chart) -> None:
        self.chart = chart
        self.contents = chart.contents
        self.nodes = chart.elements.nodes

    # -- selection --------------------------------------------------------------------------

    def holds(self, row: TreeNode, active: frozenset[int]) -> bool | None:
        """True or False where that is known of the condition of a transition."""
        state = self.chart.state_in(row)
        if state is not None:
            return state.index in active
        return False if self.chart.never_holds(row) else None if self.chart.cond(row) else True

    def _enabled(
        self, leaf: TreeNode, active: frozenset[int], event: Tokens | None
    ) -> tuple[list[TreeNode | None], list[TreeNode]]:
        """The transitions of which one is the first that an atomic state has; None for none.

        And those whose conditions may hold or not, or may fail if a transition waits for the error.
        """
        rows: list[TreeNode | None] = []
        unsure: list[TreeNode] = []
        for around in list(self.chart.outwards(leaf))[:-1]:
            for row in self.chart.transitions(around):
                starts = self.chart.events(row)
                fits = not starts if event is None else begins(event, starts)
                holds = self.holds(row, active) if fits else False
                if holds is not False:
                    rows.append(row)
                fails = fits and self.contents.errors and self.chart.may_fail(row)
                if holds is None or fails:
                    unsure.append(row)
                if holds:
                    return rows, unsure
        return [*rows, None], unsure

    def selections(
        self, active: frozenset[int], event: Tokens | None
    ) -> tuple[list[tuple[TreeNode, ...]], list[Doubt]]:
        """The sets of transitions that may be selected, and the conditions that decide."""
        leaves = [
            self.nodes[each] for each in sorted(active) if not self.chart.inside(self.nodes[each])
        ]
        enabled = [self._enabled(each, active, event) for each in leaves]
        options = [rows for rows, _ in enabled]
        if prod(map(len, options)) > _MOST_SELECTIONS:
            message = "too many conditions may hold or not while this is active"
            self.chart.elements.fault(leaves[0], message, "use fewer conditions")
            options = [each[-1:] for each in options]
        results: dict[tuple[TreeNode, ...], None] = {}
        for chosen in product(*options):
            rows = list(dict.fromkeys(each for each in chosen if each is not None))
            results.setdefault(self._compatible(active, rows))
        unsure = {row.index: row for _, rows in enabled for row in rows}
        return list(results), [("cond", row, Cause.VALUE) for row in unsure.values()]

    def _compatible(self, active: frozenset[int], rows: list[TreeNode]) -> tuple[TreeNode, ...]:
        """The transitions without those that another one preempts."""
        kept: list[TreeNode] = []
        for row in rows:
            leaves, removed = self._exits(active, row), []
            for other in kept:
                if leaves & self._exits(active, other):
                    if not self.chart.contains(self.chart.parent(other), self.chart.parent(row)):
                        break
                    removed.append(other)
            else:
                kept = [*(each for each in kept if each not in removed), row]
        return tuple(kept)

    def _exits(self, active: frozenset[int], row: TreeNode) -> frozenset[int]:
        if not row.text("target"):
            return frozenset()
        domain = self.chart.domain_of(self.chart.parent(row), row)
        return frozenset(each for each in active if self.chart.contains(domain, self.nodes[each]))

    # -- entering ---------------------------------------------------------------------------

    def options(self, history: TreeNode, left: frozenset[int] | None) -> list[tuple[TreeNode, ...]]:
        """The targets that a history may stand for: its default, then what may have been active."""
        parent = self.chart.parent(history)
        row = self.chart.transitions(history)[0]
        default = (row, *self.chart.targets(row))
        if left is not None and parent.index not in left:
            return [default]
        rows = self._configurations(parent) if history.text("type") == "deep" else None
        if rows is None:
            inside = self.chart.inside(parent)
            rows = [tuple(inside)] if parent.tag == "parallel" else [(each,) for each in inside]
        if len(rows) > _MOST_MEMORIES:
            message = f"what this history remembers has more than {_MOST_MEMORIES} possibilities"
            self.chart.elements.fault(history, message, "name the state to go back to")
        return [default, *rows[:_MOST_MEMORIES]]

    def _configurations(self, state: TreeNode) -> list[tuple[TreeNode, ...]]:
        """The sets of atomic states that may be active in a state; not many more than needed."""
        inside = self.chart.inside(state)
        parts = [self._configurations(each) for each in inside]
        if not inside:
            return [(state,)]
        if state.tag != "parallel":
            return [each for part in parts for each in part][: _MOST_MEMORIES + 1]
        rows: list[tuple[TreeNode, ...]] = [()]
        for part in parts:
            rows = [(*one, *two) for one in rows for two in part][: _MOST_MEMORIES + 1]
        return rows

    def forked(
        self, run: Callable[[Memory], T], left: frozenset[int] | None = None
    ) -> tuple[list[T], list[Doubt]]:
        """The results of a function for each possibility of each history that it depends on."""
        results: list[T] = []
        doubts: dict[int, Doubt] = {}
        pending: list[Memory] = [{}]
        while pending:
            memory = pending.pop()
            try:
                results.append(run(memory))
            except ForkError as fork:
                history, options = fork.history, self.options(fork.history, left)
                pending += [{**memory, history.index: each} for each in reversed(options)]
                if len(options) > 1:
                    doubts[history.index] = ("history", history, Cause.HISTORY)
        return results, list(doubts.values())

    def expanded(self, targets: Iterable[TreeNode], memory: Memory) -> list[TreeNode]:
        """The targets with what histories stand for. Raises ForkError."""
        rows: list[TreeNode] = []
        for each in targets:
            if each.tag == "history" and each.index not in memory:
                raise ForkError(each)
            rows += memory[each.index] if each.tag == "history" else (each,)
        return [each for each in rows if each.tag != "transition"]

    def initial(self, state: TreeNode) -> tuple[list[TreeNode], list[TreeNode]]:
        """The states that a state begins with, and the transition that leads there."""
        names = state.text("initial").split()
        rows = [each for each in self.chart.elements.children(state) if each.tag == "initial"]
        first = [self.chart.transitions(each)[0] for each in rows]
        names = first[0].text("target").split() if first else names
        return [self.chart.ids[each] for each in names] or self.chart.inside(state)[:1], first

    # -- steps ------------------------------------------------------------------------------

    def entered(self, pairs: Pairs, memory: Memory) -> tuple[list[TreeNode], list[TreeNode]]:
        """The states that targets enter, and the transitions that lead there. Raises ForkError."""
        entry = _Entry(self, memory)
        entry.add(pairs)
        rows = [row for each in entry.contents.values() for row in each]
        return [self.nodes[each] for each in sorted(entry.states)], rows

    def begin(self) -> tuple[list[Step], list[Doubt]]:
        """The start of the run."""
        effect = self.contents.start()
        moment = Moment(frozenset(), effect.queue, frozenset())
        targets, _ = self.initial(self.chart.root)
        return self._entering(moment, [(targets, self.chart.root)], effect)

    def start(
        self, source: TreeNode, row: TreeNode, *, clean: bool
    ) -> tuple[list[Step], list[Doubt]]:
        """A transition out of a stable moment, of which only what is around its source is known.

        ``clean``: nothing else may be in the queue before it.
        """
        chart = self.chart
        staying = [each for each in chart.outwards(source) if each is not chart.root]
        effect, pairs = Effect(() if clean else None), []
        if row.text("target"):
            domain = chart.domain_of(source, row)
            pairs = [(chart.targets(row), domain)]
            leaving = [each for each in staying if chart.contains(domain, each)]
            staying = [each for each in staying if each not in leaving]
            effect = self._leave(leaving, leaving[-1] if leaving else source, effect)
        effect = effect.then(self.contents.of(row))
        moment = Moment(frozenset(each.index for each in staying), effect.queue)
        return self._entering(moment, pairs, effect)

    def _leave(self, sure: list[TreeNode], outermost: TreeNode, effect: Effect) -> Effect:
        """The effect of leaving states; others may be active in the outermost of them."""
        for each in reversed(self._loud):
            if each in sure or self.chart.contains(outermost, each):
                effect = effect.then(self.contents.exit(each))
                if each not in sure and self.contents.exit(each).raises:
                    effect = effect.then(Effect(None))
        return effect

    @cached_property
    def _loud(self) -> list[TreeNode]:
        """The states that do something when they are left."""
        return [each for each in self.chart.states if self.contents.exit(each) != Effect()]

    def is_clean(self, source: TreeNode) -> bool:
        """True if nothing waits in the internal queue when a transition of a state is taken.

        It may where the transition can belong to a macrostep that has begun beside the state, or
        around it, or if a condition fails.
        """
        chart = self.chart
        inside, around = chart.within(source), list(chart.outwards(source))[:-1]
        if self.contents.late or any(map(chart.in_parallel, (source, *inside))):
            return False
        for state in (*inside, *around):
            for row in chart.transitions(state):
                loud = self.contents.of(row).raises and not row.text("target")
                if loud and chart.inside(state):
                    return False
                if self.contents.errors and row.text("event") and chart.may_fail(row):
                    return False
        return True

    def steps(self, moment: Moment) -> tuple[list[Step], list[Doubt]]:
        """The steps that may follow a moment, and what decides."""
        if any(
            self.nodes[each].tag == "final" and not self.nodes[each].parent
            for each in moment.active
        ):
            return [Step(None)], []
        choices, doubts = self.selections(moment.active, None)
        queue = None if doubts and self.contents.errors else moment.queue
        results: list[Step] = []
        for chosen in choices:
            if chosen:
                steps, more = self._taken(moment, chosen, queue)
            elif queue is None:
                steps, more = self._any(moment)
            else:
                steps, more = self._next(moment, queue)
            results += steps
            doubts += more
        merged: dict[Moment | None, Step] = {}
        for each in results:
            other = merged.get(each.moment, each)
            doubts_of = tuple(dict.fromkeys((*other.doubts, *each.doubts)))
            merged[each.moment] = each._replace(doubts=doubts_of)
        return list(merged.values()), doubts

    def _next(self, moment: Moment, queue: tuple[Tokens, ...]) -> tuple[list[Step], list[Doubt]]:
        """The next event of the queue that a transition waits for."""
        for number, event in enumerate(queue):
            choices, doubts = self.selections(moment.active, event)
            if choices == [()]:
                continue
            rest = None if doubts and self.contents.errors else queue[number + 1 :]
            results: list[Step] = []
            for chosen in choices:
                steps, more = self._taken(moment, chosen, rest)
                results += steps
                doubts += more
            return results, doubts
        return [Step(None)], []

    def _any(self, moment: Moment) -> tuple[list[Step], list[Doubt]]:
        """Any internal event, or none, where the queue is not known."""
        starts = {
            start
            for each in moment.active
            for row in self.chart.transitions(self.nodes[each])
            for start in self.chart.events(row)
        }
        names = {name for start in starts for name in self.contents.internal.get(start, ())}
        results, doubts = [Step(None)], list[Doubt]()
        for name in sorted(names):
            for chosen in self.selections(moment.active, name)[0]:
                if any(each.text("target") or self.contents.of(each).raises for each in chosen):
                    steps, more = self._taken(moment, chosen, None)
                    results += steps
                    doubts += [*more, ("event", chosen[0], Cause.EVENTS)]
        return results, doubts

    def _taken(
        self, moment: Moment, rows: tuple[TreeNode, ...], queue: Queue
    ) -> tuple[list[Step], list[Doubt]]:
        """A microstep."""
        leaving = frozenset[int]().union(*(self._exits(moment.active, row) for row in rows))
        effect = Effect(queue)
        for each in sorted(leaving, reverse=True):
            effect = effect.then(self.contents.exit(self.nodes[each]))
        pairs = []
        for row in rows:
            effect = effect.then(self.contents.of(row))
            if row.text("target"):
                domain = self.chart.domain_of(self.chart.parent(row), row)
                pairs.append((self.chart.targets(row), domain))
        left = moment.left
        if left is not None:
            remembering = {self.chart.parent(each).index for each in self.chart.histories}
            left |= leaving & remembering
        return self._entering(Moment(moment.active - leaving, effect.queue, left), pairs, effect)

    def _entering(
        self, moment: Moment, pairs: Pairs, effect: Effect
    ) -> tuple[list[Step], list[Doubt]]:
        return self.forked(
            lambda memory: _Entry(self, memory).enter(moment, pairs, effect), moment.left
        )


class _Entry:
    """The states that a microstep enters (addDescendantStatesToEnter and its sister)."""

    def __init__(self, steps: Macrosteps, memory: Memory) -> None:
        self.steps, self.chart, self.memory = steps, steps.chart, memory
        self.states: set[int] = set()
        self.contents: dict[int, list[TreeNode]] = {}  # by state: transitions that lead inwards

    def add(self, pairs: Pairs) -> None:
        """Targets are entered, too."""
        for targets, domain in pairs:
            self._into(targets, domain)

    def enter(self, moment: Moment, pairs: Pairs, effect: Effect) -> Step:
        """The moment after the targets have been entered."""
        self.add(pairs)
        active, contents = set(moment.active), self.steps.contents
        for index in sorted(self.states):
            state = self.steps.nodes[index]
            active.add(index)
            effect = effect.then(contents.entry(state))
            for row in self.contents.get(index, ()):
                effect = effect.then(contents.of(row))
            if state.tag == "final":
                effect = effect.then(Effect(tuple(self._done(state, active))))
        after = Moment(frozenset(active), effect.queue, moment.left)
        return Step(after, effect.doubts, frozenset(self.states))

    def _done(self, final: TreeNode, active: set[int]) -> list[Tokens]:
        around = self.chart.parent(final)
        outer = self.chart.parent(around) if around is not self.chart.root else around
        names = [self.chart.done_event(around)] if around is not self.chart.root else []
        if outer.tag == "parallel" and self._is_done(outer, active):
            names.append(self.chart.done_event(outer))
        return [each for each in names if self.steps.contents.hears(each)]

    def _is_done(self, state: TreeNode, active: set[int]) -> bool:
        inside = self.chart.inside(state)
        if state.tag == "parallel":
            return all(self._is_done(each, active) for each in inside)
        return any(each.tag == "final" and each.index in active for each in inside)

    def _into(self, targets: list[TreeNode], around: TreeNode) -> None:
        for each in targets:
            if each.tag == "history":
                results = self.steps.expanded([each], self.memory)
                first = self.memory[each.index][0]
                if first.tag == "transition":
                    self.contents.setdefault(each.parent, []).append(first)
                self._into(results, around)
            else:
                self._descend(each)
        for each in targets:
            self._ascend(each, around)

    def _descend(self, state: TreeNode) -> None:
        self.states.add(state.index)
        inside = self.chart.inside(state)
        if state.tag == "parallel":
            self._regions(inside)
        elif inside:
            targets, rows = self.steps.initial(state)
            self.contents.setdefault(state.index, [])[:0] = rows
            self._into(targets, state)

    def _ascend(self, state: TreeNode, around: TreeNode) -> None:
        for each in self.chart.outwards(self.chart.parent(state)):
            if each is around or each is self.chart.root:
                break
            self.states.add(each.index)
            if each.tag == "parallel":
                self._regions(self.chart.inside(each))

    def _regions(self, regions: list[TreeNode]) -> None:
        """Those of a parallel in which nothing is entered yet."""
        for each in regions:
            if not any(
                index == each.index or self.chart.contains(each, self.steps.nodes[index])
                for index in self.states
            ):
                self._descend(each)


class Nodes:
    """The nodes and connections of a machine that is read of a chart."""

    def __init__(self, chart: Chart) -> None:
        import networkx

        self.chart = chart
        self.elements = chart.elements
        self.graph: nx.MultiDiGraph[Any] = networkx.MultiDiGraph()
        self.places: dict[Any, Any] = {}
        self.root = chart.root
        self.effects: dict[str, set[str]] = {}  # of one event: triggered, stopped, by node
        self.noise: list[Doubt] = []  # what the last transition may raise or send
        self.markers: dict[Doubt, str] = {}
        self.added: dict[int, list[str]] = {}  # by element: nodes that are stopped with it
        self.spin = ""  # a choice whether the machine raises events without end

    def node(self, name: str, place: TreeNode, **data: Any) -> str:
        """A node of this name, or of a similar one if there is one."""
        unique, number = clip(name, LONGEST - 20), 2
        while unique in self.graph:
            unique, number = f"{clip(name, LONGEST - 20)}#{number}", number + 1
        self.graph.add_node(unique, **data)
        self.places[unique] = place_of(place)
        return unique

    def moment(self, name: str, place: TreeNode, kind: str = CHOICE, of: str = "") -> str:
        """A choice ``of`` what the name says or of something else, or a tick."""
        parameters = {"of": clip(of or name, LONGEST)} if kind == CHOICE else {}
        return self.node(name, place, kind="runner", interface=kind, parameters=parameters)

    def add(
        self, node: TreeNode, place: TreeNode, of: str, signals: list[Signal], kind: str = CHOICE
    ) -> str:
        """A choice or tick that follows signals, and is stopped when the state is left."""
        name = self.moment(of, place, kind)
        self.added.setdefault(node.index, []).append(name)
        self.connect(signals, name)
        return name

    def alternatives(
        self, signals: list[Signal], place: TreeNode, count: int, doubts: list[Doubt]
    ) -> Iterator[tuple[Signal, int]]:
        """The signals of several possibilities, by choices that are marked with what decides."""
        for number in range(count):
            taken = signals
            if number < count - 1:
                node = self.chart.around(place)
                choice = self.add(node, place, f"{self.chart.name(node)}: {doubts[0][0]}", signals)
                for construct, element, cause in doubts:
                    self.over(choice, element, construct, cause)
                taken, signals = [(choice, Event.SUCCEEDED)], [(choice, Event.FAILED)]
            for each in taken:
                yield each, number

    def over(self, name: str, place: TreeNode, construct: str, cause: Cause) -> None:
        """Mark a node: runs through it may be none of the chart."""
        mark(self.graph, name, Approximation(Reading.OVER, construct, place.location, cause))

    def connect(self, signals: list[Signal], target: str, action: str = "trigger") -> None:
        """Signals trigger or stop a node."""
        for source, event in signals:
            if (source, action) != (target, "stop"):  # whoever emits it has ended
                self.graph.add_edge(source, target, event=event.value, action=action)

    def trigger(self, name: str) -> None:
        """A node is triggered by the event that is being read."""
        self.effects.setdefault(name, set()).add("trigger")

    def emit(self, signal: Signal) -> None:
        """The effects that were read are those of a signal."""
        for target, actions in self.effects.items():
            for action in sorted(actions):
                self.connect([signal], target, action)
        self.effects = {}

    def hear(self, effect: Effect) -> None:
        """Take note of what a block may raise or send."""
        self.noise += effect.doubts
        self.noise += [("raise", each, Cause.EVENTS) for each in effect.raises]

    def tell(self) -> None:
        """Mark the effects by what they may raise, which is not followed."""
        for each in dict.fromkeys(self.noise):
            self.trigger(self.marker(each))
        loud = [each for tag, each, _ in self.noise if tag not in ("send", "invoke")]
        if loud and self.chart.contents.may_go_on:
            if not self.spin:
                self.spin = self.moment("events without end", self.root)
                self.over(self.spin, loud[0], "raise", Cause.EVENTS)
            self.trigger(self.spin)

    def marker(self, doubt: Doubt) -> str:
        """A node without consequences: entering it says that no run from here on is exact."""
        if doubt not in self.markers:
            construct, element, cause = doubt
            name = f"{construct}@{element.line}:{element.column}"
            self.markers[doubt] = self.node(name, element, kind="join", need=1)
            self.over(self.markers[doubt], element, construct, cause)
        return self.markers[doubt]

    def finish(self, kept: set[str]) -> None:
        """Leave out what nothing triggers, except for the nodes to be kept.

        What is raised without end lets nothing else happen.
        """
        if self.spin:
            last = self.moment("without end", self.root, TICK)
            self.connect([(self.spin, Event.FAILED), (last, Event.SUCCEEDED)], last)
            for name, kind in list(self.graph.nodes(data="kind")):
                if kind == "runner" and name != last:
                    self.connect([(self.spin, Event.FAILED)], name, "stop")
            for end in ("complete", "give_up"):
                for source, _, data in list(self.graph.in_edges(end, data=True)):
                    self.connect([(source, Event(data["event"]))], self.spin, "stop")
        kept = kept | self.reached()
        self.graph.remove_nodes_from([each for each in self.graph if each not in kept])

    def reached(self) -> set[str]:
        """The nodes that something triggers, the start and the ends."""
        import networkx

        triggers: nx.DiGraph[str] = networkx.DiGraph()
        triggers.add_nodes_from(self.graph)
        triggers.add_edges_from(
            (source, target)
            for source, target, data in self.graph.edges(data=True)
            if data["action"] == "trigger"
        )
        return {"begin", "complete", "give_up", *networkx.descendants(triggers, "begin")}
