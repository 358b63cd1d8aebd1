"""The executable content of an SCXML document, and what a macrostep makes of it.

What a block raises is known unless an expression decides it. Where all active states are known as
well, a macrostep is followed as appendix D of the recommendation says: what is left and entered,
then transitions without event, then the internal queue. Its moments are those of the machine.

    <state id="a"><onentry><raise event="x"/></onentry><transition event="x" target="b"/></state>
    Moment({a}, queue x) → Moment({b}, queue empty), which is stable
"""

from __future__ import annotations

from functools import cached_property
from itertools import product
from math import prod
from typing import TYPE_CHECKING, Final, NamedTuple, TypeVar

from gpsfsm.model.precision import Cause

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from gpsfsm.compile.formats.scxml_chart import Chart
    from gpsfsm.model.tree import TreeNode

Tokens = tuple[str, ...]
Queue = tuple[Tokens, ...] | None
"""The internal events that have not been processed yet; None where they are not known."""
Doubt = tuple[str, "TreeNode", Cause]
"""A construct that a run passes through, after which the run may be none of the file."""
Memory = dict[int, tuple["TreeNode", ...]]
"""By element of a history: where it leads; its transition comes first if that is followed."""
T = TypeVar("T")

ERRORS: Final = (("error", "execution"), ("error", "communication"), ("error", "platform"))
"""The events of what goes wrong."""
EXPRESSIONS: Final = {
    "if": ("cond",),
    "elseif": ("cond",),
    "foreach": ("array", "item", "index"),
    "assign": ("expr", "location"),
    "log": ("expr",),
    "data": ("expr", "src"),
    "param": ("expr", "location"),
    "content": ("expr",),
    "cancel": ("sendidexpr",),
    "send": ("eventexpr", "targetexpr", "typeexpr", "delayexpr", "namelist", "idlocation"),
}
"""The attributes that are evaluated, by element."""
_FAILING: Final = ("assign", "script", "foreach", "invoke")
_INTERNAL: Final = "#_internal"
_OURS: Final = (
    "", "scxml", "http://www.w3.org/TR/scxml", "http://www.w3.org/TR/scxml/",
    "http://www.w3.org/TR/scxml/#SCXMLEventProcessor",
)  # fmt: skip
_MORE: Final = "\0"
_LONGEST_QUEUE: Final = 30
_MOST_MEMORIES: Final = 16
_MOST_SELECTIONS: Final = 64


def tokens(descriptor: str) -> Tokens:
    """The tokens that the name of an event has to begin with.

    >>> tokens("nav.failed.*"), tokens("*")
    (('nav', 'failed'), ())
    """
    if descriptor in ("*", ".*"):
        return ()
    return tuple(descriptor.removesuffix("*").removesuffix(".").split("."))


def is_literal(text: str) -> bool:
    """True for an expression that cannot fail: a text, a number, or nothing.

    >>> [is_literal(text) for text in ("'a'", "1.5", "x + 1")]
    [True, True, False]
    """
    text = text.strip()
    inner = text[1:-1]
    if len(text) > 1 and text[0] == text[-1] and text[0] in "'\"":
        return text[0] not in inner and "\\" not in inner
    return not text or text.replace(".", "", 1).isdecimal()


class Effect(NamedTuple):
    """What a block of executable content does."""

    queue: Queue = ()
    doubts: tuple[Doubt, ...] = ()
    raises: tuple[TreeNode, ...] = ()  # the elements that raise something somebody waits for

    def then(self, other: Effect) -> Effect:
        """One block after the other."""
        queue = None if self.queue is None or other.queue is None else self.queue + other.queue
        if queue is not None and len(queue) > _LONGEST_QUEUE:
            queue = None
        return Effect(queue, self.doubts + other.doubts, self.raises + other.raises)


class Contents:
    """The events that a chart sends itself, as far as a transition waits for them."""

    def __init__(self, chart: Chart) -> None:
        self.chart = chart
        self.raised: set[Tokens] = set()
        self.sent: set[Tokens] = set()
        self.raises_any = self.sends_any = self.fails = self.late = False
        self._effects: dict[int, Effect] = {}
        for node in chart.read:
            if node.tag in ("raise", "send"):
                self._sends(node)
            elif node.tag == "invoke":
                self.sends_any = self.late = True
            failing = self._can_fail(node)
            undecided = node.tag == "transition" and chart.is_undecided(node)
            self.fails = self.fails or failing or undecided
            self.late = self.late or (failing and node.tag == "send")
        self.errors = self.fails and any(map(self.hears, ERRORS))
        """True if something may fail, and a transition waits for the error."""
        self.late = self.late and self.errors
        """True if an error may come at any time: what has been sent or invoked fails."""

    def _sends(self, node: TreeNode) -> None:
        inward = self.is_inward(node)
        if not node.text("event"):
            self.raises_any, self.sends_any = self.raises_any or inward, True
            return
        name = tuple(node.text("event").split("."))
        if self.hears(name):
            (self.raised if inward else self.sent).add(name)

    def is_inward(self, node: TreeNode) -> bool:
        """True for what puts an event into the internal queue."""
        return node.tag == "raise" or node.text("target").strip() == _INTERNAL

    def hears(self, name: Tokens) -> bool:
        """True if a transition waits for an event of this name."""
        return any(name[:length] in self.chart.by_name for length in range(len(name) + 1))

    def is_own(self, start: Tokens) -> bool:
        """True for what an event of the machine itself may begin with."""
        names = (*self.raised, *self.sent)
        return bool(start) and (self.sends_any or any(name[: len(start)] == start for name in names))

    def _can_fail(self, node: TreeNode) -> bool:
        texts = [node.text(each) for each in EXPRESSIONS.get(node.tag, ())]
        if node.tag in ("if", "elseif"):
            return self.chart.is_undecided(node)
        if node.tag == "send":
            target, kind = node.text("target").strip(), node.text("type").strip()
            inside = self.chart.elements.children(node)
            if target not in ("", _INTERNAL) or kind not in _OURS or any(map(self._can_fail, inside)):
                return True
        if node.tag == "data" and not node.text("expr"):
            return True  # its text is not looked at
        return node.tag in _FAILING or not all(map(is_literal, texts))

    # -- blocks -----------------------------------------------------------------------------

    def of(self, block: TreeNode) -> Effect:
        """The effect of a block: of a transition, of ``onentry`` or the like."""
        if block.index not in self._effects:
            effect = Effect()
            for each in self.chart.elements.children(block):
                effect = effect.then(self._one(each))
            self._effects[block.index] = effect
        return self._effects[block.index]

    def _one(self, node: TreeNode) -> Effect:
        """The effect of one element; an error that somebody waits for makes the queue unknown."""
        doubt: Doubt = (node.tag, node, Cause.EVENTS)
        effect = Effect()
        if node.tag in ("if", "foreach"):
            inner = self.of(node)
            certain = inner.queue == ()
            effect = Effect((), inner.doubts) if certain else Effect(None, (doubt,), inner.raises)
        elif node.tag in ("raise", "send"):
            effect = self._event(node, doubt)
        if self.errors and self._can_fail(node):
            effect = Effect(None, (*effect.doubts, doubt), effect.raises or (node,))
        return effect

    def _event(self, node: TreeNode, doubt: Doubt) -> Effect:
        name, inward = tuple(node.text("event").split(".")), self.is_inward(node)
        if not node.text("event"):
            return Effect(None, (doubt,), (node,)) if inward else Effect((), (doubt,))
        if not self.hears(name):
            return Effect()
        return Effect((name,), (), (node,)) if inward else Effect((), (doubt,))

    def entry(self, state: TreeNode) -> Effect:
        """What happens when a state is entered, but for its ``done.state`` and its transitions."""
        effect, late = Effect(), self.chart.root.text("binding") == "late"
        children = self.chart.elements.children(state)
        tags = ("datamodel",) if late else ()
        for tag in (*tags, "onentry", "donedata"):
            for each in children:
                effect = effect.then(self.of(each)) if each.tag == tag else effect
        return effect

    def exit(self, state: TreeNode) -> Effect:
        """What happens when a state is left."""
        effect = Effect()
        for each in self.chart.elements.children(state):
            effect = effect.then(self.of(each)) if each.tag == "onexit" else effect
        return effect

    def start(self) -> Effect:
        """What happens before the first state is entered."""
        effect = Effect()
        for each in self.chart.read:
            if each.tag == "datamodel":
                effect = effect.then(self.of(each))
            elif each.tag == "script" and self.chart.parent(each) is self.chart.root:
                effect = effect.then(self._one(each))
        return effect

    # -- what may happen --------------------------------------------------------------------

    @cached_property
    def internal(self) -> dict[Tokens, list[Tokens]]:
        """Internal events by each beginning that a transition names; one of those alike."""
        names: set[Tokens] = {*self.raised, *(ERRORS if self.errors else ())}
        names |= {self.chart.done_event(each) for each in self.chart.states}
        if self.raises_any:
            names |= {(*start, *more) for start in self.chart.by_name for more in ((), (_MORE,))}
        alike: dict[tuple[Tokens, ...], Tokens] = {}
        for name in sorted(names):
            starts = (name[:length] for length in range(len(name) + 1))
            alike.setdefault(tuple(each for each in starts if each in self.chart.by_name), name)
        rows: dict[Tokens, list[Tokens]] = {}
        for key, name in alike.items():
            for start in key:
                rows.setdefault(start, []).append(name)
        return rows

    @cached_property
    def may_go_on(self) -> bool:
        """True if a macrostep beside unknown states may raise events without end."""
        import networkx

        chart = self.chart
        if self.raises_any or not (self.raised or self.errors):
            return self.raises_any
        rows = [
            (node, row, self._raises(node, row))
            for node in chart.states
            for row in chart.live(node)
            if not row.text("event") or any(self.internal.get(each) for each in chart.events(row))
        ]
        graph: networkx.DiGraph[int] = networkx.DiGraph()
        for number, (source, row, raised) in enumerate(rows):
            domain = chart.domain_of(source, row)
            for other, (node, then, _) in enumerate(rows):
                if not then.text("event"):
                    inside = row.text("target") and chart.contains(domain, node)
                    follows = bool(inside or chart.cond(then))
                else:
                    follows = any(_begins(name, chart.events(then)) for name in raised)
                if follows:
                    graph.add_edge(number, other)
        return not networkx.is_directed_acyclic_graph(graph)

    def _raises(self, source: TreeNode, row: TreeNode) -> set[Tokens]:
        """All that a transition may raise, whatever it leaves and enters."""
        chart = self.chart
        states = []
        if row.text("target"):
            domain = chart.domain_of(source, row)
            states = [each for each in chart.states if chart.contains(domain, each)]
        effects = [self.of(row), *map(self.entry, states), *map(self.exit, states)]
        names = {name for each in effects for name in each.queue or ()}
        names |= {chart.done_event(chart.parent(each)) for each in states if each.tag == "final"}
        names |= {chart.done_event(each) for each in states if each.tag == "parallel"}
        if any(each.queue is None for each in effects):
            names |= self.raised | set(ERRORS)
        return names | (set(ERRORS) if self.errors and chart.cond(row) else set())


def _begins(name: Tokens, starts: Iterable[Tokens]) -> bool:
    return any(name[: len(start)] == start for start in starts)


class Moment(NamedTuple):
    """What is active within a macrostep, and what waits in the internal queue.

    ``left``: the states with a history that have been left; None where that is not known.
    """

    active: frozenset[int]
    queue: Queue
    left: frozenset[int] | None = None


class Step(NamedTuple):
    """What follows a moment: another one, or None where it is stable."""

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
    ) -> list[TreeNode | None]:
        """The transitions of which one is the first that an atomic state has; None for none."""
        rows: list[TreeNode | None] = []
        for around in self.chart.outwards(leaf):
            for row in self.chart.transitions(around):
                starts = self.chart.events(row)
                fits = not starts if event is None else _begins(event, starts)
                holds = self.holds(row, active) if fits else False
                if holds is not False:
                    rows.append(row)
                if holds:
                    return rows
        return [*rows, None]

    def selections(
        self, active: frozenset[int], event: Tokens | None
    ) -> tuple[list[tuple[TreeNode, ...]], list[Doubt]]:
        """The sets of transitions that may be selected, and the conditions that decide."""
        leaves = [self.nodes[each] for each in sorted(active) if not self.chart.inside(self.nodes[each])]
        options = [self._enabled(each, active, event) for each in leaves]
        if prod(map(len, options)) > _MOST_SELECTIONS:
            message = "too many conditions may hold or not while this is active"
            self.chart.elements.fault(leaves[0], message, "use fewer conditions")
            options = [each[-1:] for each in options]
        found: dict[tuple[TreeNode, ...], None] = {}
        for chosen in product(*options):
            rows = list(dict.fromkeys(each for each in chosen if each is not None))
            found.setdefault(self._compatible(active, rows))
        unsure = {
            row.index: row
            for each in options
            for row in each
            if row is not None and self.holds(row, active) is None
        }
        return list(found), [("cond", row, Cause.VALUE) for row in unsure.values()]

    def _compatible(
        self, active: frozenset[int], rows: list[TreeNode]
    ) -> tuple[TreeNode, ...]:
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
        """Where a history may lead: first its default, then what may have been active."""
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
        """What comes of each possibility of each history that it depends on."""
        found: list[T] = []
        doubts: dict[int, Doubt] = {}
        pending: list[Memory] = [{}]
        while pending:
            memory = pending.pop()
            try:
                found.append(run(memory))
            except ForkError as fork:
                history, options = fork.history, self.options(fork.history, left)
                pending += [{**memory, history.index: each} for each in reversed(options)]
                if len(options) > 1:
                    doubts[history.index] = ("history", history, Cause.HISTORY)
        return found, list(doubts.values())

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

    def begin(self) -> tuple[list[Step], list[Doubt]]:
        """The start of the run."""
        effect = self.contents.start()
        moment = Moment(frozenset(), effect.queue, frozenset())
        targets, _ = self.initial(self.chart.root)
        return self._entering(moment, [(targets, self.chart.root)], effect)

    def start(self, source: TreeNode, row: TreeNode, *, clean: bool) -> tuple[list[Step], list[Doubt]]:
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
        """What is done when states are left; others may be active in the outermost of them."""
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
        inside = [each for each in chart.states if chart.contains(source, each)]
        if self.contents.late or any(map(chart.in_parallel, (source, *inside))):
            return False
        for state in (*inside, *chart.outwards(source)):
            for row in chart.transitions(state):
                loud = self.contents.of(row).raises and not row.text("target")
                if loud and chart.inside(state):
                    return False
                if self.contents.errors and row.text("event") and chart.is_undecided(row):
                    return False
        return True

    def steps(self, moment: Moment) -> tuple[list[Step], list[Doubt]]:
        """What may follow a moment, and what decides."""
        if any(self.nodes[each].tag == "final" and not self.nodes[each].parent for each in moment.active):
            return [Step(None)], []
        choices, doubts = self.selections(moment.active, None)
        queue = None if doubts and self.contents.errors else moment.queue
        found: list[Step] = []
        for chosen in choices:
            if chosen:
                steps, more = self._taken(moment, chosen, queue)
            elif queue is None:
                steps, more = self._any(moment)
            else:
                steps, more = self._next(moment, queue)
            found += steps
            doubts += more
        merged: dict[Moment | None, Step] = {}
        for each in found:
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
            found: list[Step] = []
            for chosen in choices:
                steps, more = self._taken(moment, chosen, rest)
                found += steps
                doubts += more
            return found, doubts
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
        found, doubts = [Step(None)], list[Doubt]()
        for name in sorted(names):
            for chosen in self.selections(moment.active, name)[0]:
                if any(each.text("target") or self.contents.of(each).raises for each in chosen):
                    steps, more = self._taken(moment, chosen, None)
                    found += steps
                    doubts += [*more, ("event", chosen[0], Cause.EVENTS)]
        return found, doubts

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
        self, moment: Moment, pairs: list[tuple[list[TreeNode], TreeNode]], effect: Effect
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

    def enter(
        self, moment: Moment, pairs: list[tuple[list[TreeNode], TreeNode]], effect: Effect
    ) -> Step:
        """What is active after the targets have been entered, each pair with its domain."""
        for targets, domain in pairs:
            self._into(targets, domain)
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
                found = self.steps.expanded([each], self.memory)
                first = self.memory[each.index][0]
                if first.tag == "transition":
                    self.contents.setdefault(each.parent, []).append(first)
                self._into(found, around)
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
