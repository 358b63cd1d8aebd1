"""SCXML (W3C, 2015): statecharts ↔ machines.

An atomic state with transitions is a runner: it acts until one of its events comes. The names of
the events tell how it ends, as those of outcomes do (``outcomes.py``). A transition of a state with
others in it may be taken at any time while one of these is active: a choice watches for it. What is
left by a transition is stopped.

    <parallel id="P"><state id="A">…</state><state id="B">…</state></parallel>
    entering P enters A and B; done.state.P comes when each has come to a final state: a join

What gpsfsm writes itself (``scxml_writing``) is read by ``scxml_regions``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from gpsfsm.compile.formats import Format
from gpsfsm.compile.formats.elements import Elements
from gpsfsm.compile.formats.outcomes import is_failure
from gpsfsm.compile.formats.scxml_chart import Chart
from gpsfsm.compile.formats.scxml_macrosteps import LONGEST, Macrosteps, Moment, Nodes, Signal, Step
from gpsfsm.compile.formats.scxml_regions import read_regions, runner_of
from gpsfsm.compile.formats.scxml_writing import NAMESPACE, OWN_NAMESPACE, write
from gpsfsm.compile.machines import machine_of
from gpsfsm.model.capability import CHOICE, TICK
from gpsfsm.model.event import Event
from gpsfsm.model.precision import Cause
from gpsfsm.model.printable import clip
from gpsfsm.syntax.text import root_name

if TYPE_CHECKING:
    from gpsfsm.compile.formats.scxml_content import Doubt
    from gpsfsm.compile.formats.scxml_macrosteps import Memory
    from gpsfsm.compile.machines import ReadMachine
    from gpsfsm.model.tree import TreeNode
    from gpsfsm.syntax.source import Limits

_EVENTLESS: Final = "transition without event"
_MOST_MOMENTS: Final = 2_000
_MOST_STEPS: Final = 10_000


def recognises(text: str, file: str) -> bool:
    """True for XML whose outermost element is scxml, in whatever namespace."""
    del file
    return root_name(text).rpartition(":")[2] == "scxml"


def read(text: str, file: str, limits: Limits) -> ReadMachine:
    """The machine of a statechart, or what is wrong with it."""
    elements = Elements(text, limits, NAMESPACE, OWN_NAMESPACE)
    if not elements.nodes:
        return None, tuple(elements.problems)
    if elements.nodes[0].text("gpsfsm:form") == "regions":
        return read_regions(elements, file, limits)
    chart = Chart(elements)
    if elements.problems:
        return None, tuple(elements.problems)
    reader = _Reader(chart)
    if elements.problems:
        return None, tuple(elements.problems)
    return machine_of(
        reader.graph, file=file, places=reader.places, approximations=chart.approximations
    )


class _Reader(Nodes):
    def __init__(self, chart: Chart) -> None:
        super().__init__(chart)
        self.runner: dict[int, str] = {}  # by element: the node of an atomic state
        self.watchers: dict[int, list[str]] = {}  # by element: what watches while it is active
        self.joins: dict[int, str] = {}
        self.extras: dict[str, list[str]] = {}  # by join: those in front of it
        self.done: dict[int, str] = {}  # by element: what stands between its end and what follows
        self.marks: dict[int, str] = {}  # by element: what its end marks
        self.uncertain: set[int] = set()  # elements whose done.state is watched for like an event
        self.left: set[int] = set()  # the states that the last transition has left
        self.taken: list[tuple[list[Signal], TreeNode, TreeNode]] = []
        for name in ("begin", "complete", "give_up"):
            self.node(name, self.root, kind="start" if name == "begin" else name)
        self.macrosteps = Macrosteps(chart)
        self.memory: Memory = {}
        self.passing: dict[Moment, str] = {}  # by moment: the node of one that passes
        self.passed: list[tuple[Moment, list[Step], list[Doubt]]] = []
        for each in chart.states:
            ends = chart.inside(each) and chart.done(each) and not self._is_calm(each)
            if ends and chart.is_uncertain(each):
                self.uncertain.add(each.index)
        for each in chart.states:
            self._make(each)
        for each in chart.states:
            self._leave(each)
        begin: Signal = ("begin", Event.SUCCEEDED)
        if chart.follows:
            self._branch([begin], self.root, *self.macrosteps.begin())
        else:
            self._go(begin, self.root, None)
        for signals, source, row in self.taken:  # now that all nodes are there
            if not self.elements.problems:
                self._take(signals, source, row)
        if not self.elements.problems:
            self._pass()

    def _make(self, node: TreeNode) -> None:
        name, inside = self.chart.name(node), self.chart.inside(node)
        if node.tag == "state" and not inside:
            runner = runner_of(self.elements, node, name)
            self.runner[node.index] = self.node(name, node, **runner)
            self._mark_eventless(node)
        elif node.tag == "parallel" and self._is_counted(node):
            need = len(inside)
            self.joins[node.index] = self.node(f"{name}: done", node, kind="join", need=need)
        if inside:
            self.watchers[node.index] = []
            for each in self._watched(node):
                self._watch(node, each)
            self._make_mark(node)
            rows = self._done_rows(node)
            if rows and (node.tag == "parallel" or self.chart.cond(rows[0])):
                self._make_done(node)
        outer = self._outer_join(node)
        if outer and node.index in self.joins:
            self.connect([(self.joins[node.index], Event.SUCCEEDED)], outer)

    def _mark_eventless(self, node: TreeNode) -> None:
        """An atomic state acts for a while, which the file says only of what waits for events."""
        for each in self.chart.live(node):
            if each.text("event"):
                continue
            if self.chart.cond(each):
                self.over(self.runner[node.index], each, "cond", Cause.VALUE)
            elif self._is_disturbed(node):
                self.over(self.runner[node.index], each, _EVENTLESS, Cause.ORDER)

    def _is_disturbed(self, node: TreeNode) -> bool:
        """True if something else can happen while a state is active."""
        return any(
            each.tag == "parallel" or self.chart.transitions(each)
            for each in self.chart.outwards(self.chart.parent(node))
        )

    def _is_counted(self, node: TreeNode) -> bool:
        """True if something follows the end of all regions of a parallel."""
        outer = self.chart.parent(node)
        return bool(self._done_rows(node)) or (outer.tag == "parallel" and self._is_counted(outer))

    def _outer_join(self, node: TreeNode) -> str:
        return self.joins.get(self.chart.parent(node).index, "")

    def _done_rows(self, node: TreeNode) -> list[TreeNode]:
        """The transitions that follow at once when a state is done."""
        if not self.chart.inside(node) or node.index in self.uncertain:
            return []
        rows = [] if self._is_calm(node) else self.chart.done(node)
        return rows if any(each.text("target") for each in rows) else []

    def _is_calm(self, node: TreeNode) -> bool:
        """True for a state whose end always belongs to a macrostep that is followed."""
        apart = node.tag != "parallel" and not self.chart.in_parallel(node)
        return self.chart.follows and apart

    def _watched(self, node: TreeNode) -> list[TreeNode]:
        """The transitions of a state around others that may be taken at any time."""
        return [
            each
            for each in self.chart.live(node)
            if (
                each.text("target")
                or self.chart.cond(each)
                or self.chart.outer(each)
                or self.chart.contents.of(each).raises
            )
            and not (self._is_calm(node) and self.chart.is_by_end(node, each))
            and (node.index in self.uncertain or not self.chart.is_of_itself(node, each))
        ]

    def _watch(self, node: TreeNode, row: TreeNode) -> None:
        """While a state is active, an event may come: now, later or never."""
        text, event = f"{self.chart.name(node)}: {row.text('event') or 'always'}", row.text("event")
        if event or self.chart.cond(row) or not self.chart.is_left_at_once(node):
            now = again = self.moment(text, row, of=f"{text} comes" if event else text)
            if self.chart.state_in(row) or (event and not self.chart.external(row)):
                again = self._perhaps(node, row, now)
            self.connect([(now, Event.FAILED)], again)
        else:
            now = self.moment(text, row, TICK)
        if not event:
            self.over(now, row, _EVENTLESS, Cause.ORDER)
        self.watchers[node.index].append(now)

    def _perhaps(self, node: TreeNode, row: TreeNode, now: str) -> str:
        """A choice for what may never come: ``now`` follows later, or nothing."""
        later = self.add(node, row, f"{clip(now, LONGEST - 40)}: later", [])
        ends = all(each[:2] == ("done", "state") for each in self.chart.events(row))
        self.over(later, row, "done.state" if ends else "event", Cause.EVENTS)
        self.connect([(later, Event.SUCCEEDED)], now)
        self.connect([(later, Event.FAILED)], now, "stop")  # it does not come any more
        return later

    def _make_mark(self, node: TreeNode) -> None:
        """A node without consequences: entering it says that no run from here on is exact."""
        if self._is_calm(node):
            return
        handled = self._done_rows(node) and not self.chart.cond(self._done_rows(node)[-1])
        if node.index in self.uncertain or (not handled and self.chart.is_listened_for(node)):
            join = self.node(f"{self.chart.name(node)}: its end", node, kind="join", need=1)
            self.over(join, node, "done.state", Cause.EVENTS)
            self.marks[node.index] = join

    def _make_done(self, node: TreeNode) -> None:
        """The moment between the end of all regions and what follows.

        A region that is done may be left by a transition of its own, and be done again. So if there
        are such transitions, nobody knows whether all are done: now, later or never.
        """
        chart, name = self.chart, self.chart.name(node)
        joins = [self.joins[node.index]] if node.index in self.joins else []
        signals = [(each, Event.SUCCEEDED) for each in joins]
        if node.tag == "parallel" and any(
            each.tag == "parallel" or chart.live(each) for each in chart.inside(node)
        ):
            then = self.add(node, node, f"{name}: all regions are done", signals)
            self.over(then, node, "parallel", Cause.ORDER)
            self.connect([(then, Event.FAILED)], self._perhaps(node, node, then))
        else:
            then = self.add(node, node, f"{name}: then", signals, TICK)
            if self._is_disturbed(node):
                self.over(then, node, "done.state", Cause.ORDER)
        self.done[node.index] = then

    # -- entering ---------------------------------------------------------------------------

    def _go(self, signal: Signal, source: TreeNode, row: TreeNode | None) -> None:
        """A transition whose configuration is not known; without one, the start."""
        effects, doubts = self.macrosteps.forked(lambda memory: self._effects(memory, source, row))
        for each, last in self.alternatives([signal], row or source, len(effects), doubts):
            self.effects = effects[last]
            self.emit(each)

    def _effects(
        self, memory: Memory, source: TreeNode, row: TreeNode | None
    ) -> dict[str, set[str]]:
        """The effects of a transition, and of all that follows at once.

        A final state that is entered is a transition of its own, once all else has been entered
        (W3C, appendix D). What that leaves again was never active.
        """
        self.memory, self.effects, self.noise = memory, {}, []
        ended: list[TreeNode] = []
        pending = self._entered(source, row)
        for _ in range(_MOST_STEPS):
            for node in pending:
                self._begin(node)
                if node.index in self.runner:
                    self.trigger(self.runner[node.index])
            ended += [each for each in pending if each.tag == "final"]
            pending = []
            if not ended:
                break
            done = self._ended(ended[0])
            around = self.chart.parent(ended.pop(0))
            if done is not None:
                self.left.clear()
                pending = self._entered(around, done)
                ended = [each for each in ended if not self._is_left(each)]
        else:
            self.elements.fault(source, "this is entered without end", "let something happen")
        self.tell()
        return self.effects

    # -- macrosteps that are followed ---------------------------------------------------------

    def _branch(
        self,
        signals: list[Signal],
        place: TreeNode,
        steps: list[Step],
        doubts: list[Doubt],
        row: TreeNode | None = None,
    ) -> None:
        """Connect a signal with all that may follow: stable configurations, moments that pass.

        ``row``: the transition out of a stable configuration that it is the signal of.
        """
        for signal, number in self.alternatives(signals, row or place, len(steps), doubts):
            step = steps[number]
            name = self._passing_of(step.moment) if step.moment is not None else ""
            self.effects = {}
            if row is not None and name:
                self._stop_around(place)
            elif row is not None and row.text("target"):
                self._depart(place, row)
            if name:
                self.trigger(name)
            else:
                self._enter(place, step, row)
            for each in step.doubts:
                self.trigger(self.marker(each))
            self.emit(signal)

    def _enter(self, place: TreeNode, step: Step, row: TreeNode | None) -> None:
        """A stable configuration: all of it, or what a transition has entered."""
        entered = step.entered
        if row is not None and not entered:
            entered = frozenset([place.index])
        for index in sorted(entered):
            node = self.elements.nodes[index]
            self._begin(node)
            around = self.chart.parent(node)
            if index in self.runner:
                self.trigger(self.runner[index])
            elif node.tag == "final" and around is self.root:
                self.trigger("give_up" if is_failure(self.chart.name(node)) else "complete")
            elif node.tag == "final" and self._outer_join(around):
                self._arrive(around, self._outer_join(around))
        if row is not None and row.text("target") and self.chart.domain_of(place, row) is place:
            for watcher in self.watchers.get(place.index, ()):
                self.trigger(watcher)  # it stays active

    def _passing_of(self, moment: Moment) -> str:
        """The node of a moment that passes, "" for one that is stable."""
        if moment not in self.passing:
            steps, doubts = self.macrosteps.steps(moment)
            self.passing[moment] = ""
            if [each.moment for each in steps] != [None]:
                leaf = self.elements.nodes[max(moment.active)]
                name = f"{self.chart.name(leaf)} passes"
                kind = CHOICE if len(steps) > 1 else TICK
                self.passing[moment] = self.moment(name, leaf, kind)
                self.passed.append((moment, steps, doubts))
                if len(self.passed) > _MOST_MOMENTS:
                    message = f"the machine passes through more than {_MOST_MOMENTS} moments"
                    self.elements.fault(leaf, message, "raise fewer events")
        return self.passing[moment]

    def _pass(self) -> None:
        """Connect the moments that pass; states that only pass are no runners."""
        for moment, steps, doubts in self.passed:  # grows
            if self.elements.problems:
                return
            name = self.passing[moment]
            leaf = self.elements.nodes[max(moment.active)]
            whole = [each._replace(entered=(each.moment or moment).active) for each in steps]
            signals: list[Signal] = [(name, Event.SUCCEEDED)]
            if len(steps) > 1:
                for construct, element, cause in doubts:
                    self.over(name, element, construct, cause)
                self._branch(signals, leaf, whole[:1], doubts)
                signals, whole = [(name, Event.FAILED)], whole[1:]
            self._branch(signals, leaf, whole, doubts)
        reached = self.reached()
        kept = set() if self.chart.follows else {*self.graph} - {*self.marks.values()}
        only_passed = {
            index
            for moment, *_ in self.passed
            if self.passing[moment] in reached
            for index in moment.active
        }
        self.finish(
            kept.union(name for index, name in self.runner.items() if index not in only_passed)
        )

    def _is_left(self, node: TreeNode) -> bool:
        """True for what lies in a state that the last transition has left."""
        return any(each.index in self.left for each in self.chart.outwards(node))

    def _begin(self, node: TreeNode) -> None:
        """A state around others becomes active: its watchers start, its join forgets."""
        for watcher in self.watchers.get(node.index, ()):
            self.trigger(watcher)
        if node.index in self.joins:
            self.effects[self.joins[node.index]] = {"stop"}
        self.hear(self.chart.contents.entry(node))
        for each in self.elements.children(node):
            if each.tag == "invoke":
                self.trigger(self.marker(("invoke", each, Cause.INVOKED)))

    def _ended(self, final: TreeNode) -> TreeNode | None:
        """A final state was entered: the run ends, or a transition of the state around it follows.

        The others of its transitions stay: it is active, in its final state.
        """
        around = self.chart.parent(final)
        if around is self.root:
            self.trigger("give_up" if is_failure(self.chart.name(final)) else "complete")
            return None
        if self._outer_join(around):
            self._arrive(around, self._outer_join(around))
        for each in self.chart.outwards(around):
            if each.index in self.marks and (each is around or each.tag == "parallel"):
                self.trigger(self.marks[each.index])
        if around.index in self.done:
            self.trigger(self.done[around.index])
            return None
        rows = self._done_rows(around)
        return rows[0] if rows else None

    def _arrive(self, region: TreeNode, join: str) -> None:
        """A region is done; a second one at the same time has a connection of its own."""
        if "trigger" in self.effects.get(join, ()):
            name = f"{self.chart.name(region)}: done"
            extra = self.node(name, region, kind="join", need=1)
            self.connect([(extra, Event.SUCCEEDED)], join)
            self.extras.setdefault(join, []).append(extra)
            join = extra
        self.trigger(join)

    # -- leaving ----------------------------------------------------------------------------

    def _leave(self, node: TreeNode) -> None:
        if node.index in self.runner:
            self._outcomes(node, self.runner[node.index])
        watchers = self.watchers.get(node.index, ())  # atomic states have none
        for watcher, row in zip(watchers, self._watched(node), strict=False):
            signals: list[Signal] = [(watcher, Event.SUCCEEDED)]
            if self.chart.cond(row):
                choice = self._alternative(node, row, signals)
                self.connect([(choice, Event.FAILED)], watcher)
                signals = [(choice, Event.SUCCEEDED)]
            elif row.text("event") and not self.chart.is_private(node, row):
                signals = self._step(node, row, signals)
            self.taken.append((signals, node, row))
            inward = row.text("target") and self.chart.domain_of(node, row) is node
            if not row.text("target") or (inward and not self._is_followed(node, row)):
                self.connect(signals, watcher)  # it stays active, and so does its watcher
        if node.index in self.done:
            signals = [(self.done[node.index], Event.SUCCEEDED)]
            for row in self._done_rows(node):
                taken = signals
                if self.chart.cond(row):
                    choice = self._alternative(node, row, signals)
                    taken, signals = [(choice, Event.SUCCEEDED)], [(choice, Event.FAILED)]
                self.taken.append((taken, node, row))

    def _step(self, node: TreeNode, row: TreeNode, signals: list[Signal]) -> list[Signal]:
        """A moment before a transition whose event is taken elsewhere too, or never comes."""
        name = f"{self.chart.name(node)}: on {row.text('event')}"
        step = self.add(node, row, name, signals, TICK)
        self.over(step, row, "event", self._cause(row))
        return [(step, Event.SUCCEEDED)]

    def _outcomes(self, node: TreeNode, runner: str) -> None:
        """The transitions of an atomic state: by two events, and choices where there are more."""
        rows = self.chart.live(node)
        failures = [each for each in rows if is_failure(each.text("event"))]
        others = [each for each in rows if each not in failures]
        both: list[Signal] = [(runner, Event.SUCCEEDED), (runner, Event.FAILED)]
        mixed = failures and others
        if rows and not mixed and (len(rows) == 1 or not self._is_sure(rows[0])):
            self._among(both, node, rows)
        elif rows:
            if not mixed:
                others, failures = rows[:1], rows[1:]
            self._among(both[:1], node, others)
            self._among(both[1:], node, failures)

    def _among(self, signals: list[Signal], node: TreeNode, rows: list[TreeNode]) -> None:
        """One of several transitions of an atomic state: first those that are exact.

        Where no condition holds, an unconditional one follows, or the state waits on.
        """
        sure = [each for each in rows if self._is_sure(each)]
        firm = [each for each in sure if self.chart.is_private(node, each)]
        order = [*firm, *(each for each in rows if each not in firm)]
        exact = True
        for each in order:
            taken = signals
            if each not in sure or each is not order[-1]:
                choice = self._alternative(node, each, signals, marked=exact and each not in firm)
                taken, signals = [(choice, Event.SUCCEEDED)], [(choice, Event.FAILED)]
                exact = exact and each in firm
            elif exact and each not in firm and each.text("event"):
                taken = self._step(node, each, signals)
            self.taken.append((taken, node, each))
        if order[-1] in sure:
            return
        runner = self.runner[node.index]
        if sure:
            self.taken.append((signals, node, sure[-1]))
        elif any(
            not self.chart.state_in(each) and (not each.text("event") or self.chart.external(each))
            for each in self.chart.live(node)
        ):
            self.connect(signals, runner)  # it stays, and waits for the next event
        else:
            self.connect(signals, self._perhaps(node, order[-1], runner))

    def _is_sure(self, row: TreeNode) -> bool:
        """True for a transition that is taken as soon as the environment says so."""
        return not self.chart.cond(row) and (
            not row.text("event") or bool(self.chart.external(row))
        )

    def _alternative(
        self, node: TreeNode, row: TreeNode, signals: list[Signal], *, marked: bool = True
    ) -> str:
        """A choice between a transition and what comes if it is not taken."""
        cond = self.chart.cond(row)
        name = f"{self.chart.name(node)}: {cond or row.text('event')}"
        choice = self.add(node, row, name, signals)
        if cond:
            self.over(choice, row, "cond", Cause.VALUE)
        elif marked:
            self.over(choice, row, "event", self._cause(row))
        return choice

    def _cause(self, row: TreeNode) -> Cause:
        return Cause.ORDER if self.chart.external(row) else Cause.EVENTS

    def _take(self, signals: list[Signal], source: TreeNode, row: TreeNode) -> None:
        """A transition: what it leaves is stopped, and its targets are entered."""
        if self._is_followed(source, row):
            clean = self.macrosteps.is_clean(source)
            self._branch(signals, source, *self.macrosteps.start(source, row, clean=clean), row)
            return
        stays = source.index in self.runner or self.chart.contents.of(row).raises
        for signal in signals if row.text("target") or stays else ():
            self._go(signal, source, row)

    def _is_followed(self, source: TreeNode, row: TreeNode) -> bool:
        """True for a transition after which all active states are known."""
        chart = self.chart
        if row.text("target"):
            return chart.follows and not chart.in_parallel(chart.domain_of(source, row))
        return chart.follows and source.index in self.runner and not chart.in_parallel(source)

    def _entered(self, source: TreeNode, row: TreeNode | None) -> list[TreeNode]:
        """The states that a transition enters; those that it leaves are stopped."""
        if row is None:
            targets, domain = self.macrosteps.initial(self.root)[0], self.root
        else:
            self.hear(self.chart.contents.of(row))
            if not row.text("target"):
                return [source] if source.index in self.runner else []
            self._depart(source, row)
            targets, domain = self.chart.targets(row), self.chart.domain_of(source, row)
        states, rows = self.macrosteps.entered([(targets, domain)], self.memory)
        for each in rows:
            self.hear(self.chart.contents.of(each))
        return states

    def _depart(self, source: TreeNode, row: TreeNode) -> None:
        """All that a transition leaves is stopped."""
        domain, left = self.chart.domain_of(source, row), [source]
        if domain.index == source.index:
            left = self.chart.inside(source)
        while self.chart.parent(left[0]).index != domain.index:
            left = [self.chart.parent(left[0])]
        for each in left:
            self._stop(each)

    def _stop_around(self, source: TreeNode) -> None:
        """All that may be active with a state is stopped."""
        around = [each for each in self.chart.outwards(source) if each is not self.root]
        regions = [each for each in around if each.tag == "parallel"]
        self._stop((regions or [source])[-1])
        for each in around:
            for rows in (self.watchers, self.added):
                for name in rows.get(each.index, ()):
                    self.effects[name] = {"stop"}

    def _stop(self, node: TreeNode) -> None:
        """All that is active in a state is stopped, and its end counts no more."""
        self.left.add(node.index)
        pending = [node]
        while pending:
            each = pending.pop()
            names = [self.runner[each.index]] if each.index in self.runner else []
            for row in (self.watchers, self.added):
                names += row.get(each.index, ())
            for name in names:
                self.effects[name] = {"stop"}
            if each.index in self.joins:
                join = self.joins[each.index]
                self.effects[join] = {"stop"}
                for name in self.extras.get(join, ()):
                    self.effects.pop(name, None)
            self.hear(self.chart.contents.exit(each))
            pending += self.chart.inside(each)


FORMAT = Format("scxml", "SCXML statecharts", recognises, read, write)
