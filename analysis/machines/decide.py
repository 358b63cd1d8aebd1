"""The facts about a machine, read off the exploration of its configurations (semantics, 9.4)."""

from __future__ import annotations

import heapq
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal

from gpsfsm.analysis.decisions.completion import frequency
from gpsfsm.analysis.machines.exact import NOWHERE, ExactPart
from gpsfsm.compile.instants import CODES, COMPLETED, FAILED, GAVE_UP, GOING, SUCCEEDED, bits
from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.capability import OWN
from gpsfsm.model.event import Event
from gpsfsm.model.report import Frequency
from gpsfsm.model.story import Vocabulary

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping

    from gpsfsm.analysis.machines.search import Exploration, Lasso, Step, Steps
    from gpsfsm.model.automaton import Automaton

Run = tuple[tuple[int, int], ...]
"""Steps of a run: (number of the runner, outcome)."""


@dataclass(frozen=True, slots=True)
class Loop:
    """A loop that a run may never leave; ``lasso`` is the shortest such run.

    ``trap``: it cannot be left, whatever the outcomes; ``runners`` are all that act in it then,
    else those of the lasso.
    """

    trap: bool
    lasso: Lasso
    runners: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class DanglingAt:
    """A dangling event; ``shown`` is a run that ends with it, if its effect needs one."""

    signal: Signal
    effect: Literal["give_up", "stuck", "dont_care"]
    shown: Run | None


Claim = tuple[object, ...]
"""A claim that something can happen, such as ("end", COMPLETED) or ("orphan", 3)."""

WaitingEffect = Literal["stuck", "give_up", "endless", "absorbed"]


@dataclass(frozen=True, slots=True)
class WaitingJoin:
    """A join that waits for ever; ``shown`` leads to it, ``loop`` is what is repeated then.

    ``fair``: it also does if outcomes that can occur at every visit occur.
    """

    node: int
    effect: WaitingEffect
    shown: Run
    loop: Run = ()
    fair: bool = True


@dataclass(frozen=True, slots=True)
class Answers:
    """The facts about a machine; runners are numbers, runs are shortest ones.

    ``with_fewest``: a run that gives up with the fewest failures.
    ``shown``: a run that comes to each end that some run comes to, GOING for STUCK. ``may``: the
    claims of which no run is exact (semantics, 9.6); all others are proved.
    """

    completes: Frequency
    gives_up: Frequency
    stuck: Frequency
    endless: Frequency
    completes_if_fair: Frequency
    unreachable: tuple[int, ...]
    loops: tuple[Loop, ...]
    dangling: tuple[DanglingAt, ...]
    waiting: tuple[WaitingJoin, ...]
    orphans: tuple[tuple[int, Run], ...]
    fewest_failures: int | None
    shown: dict[int, Run]
    configurations: int
    with_fewest: Run = ()
    may: frozenset[Claim] = frozenset()

    def without_exact_runs(self) -> Answers:
        """The same where no run was looked for that is exact: all that can happen is a may."""
        claims: list[Claim] = [("end", end) for end in self.shown]
        claims += [("endless",), ("fewest",)]
        claims += (("loop", loop.trap, frozenset(loop.runners)) for loop in self.loops)
        claims += (("dangling", each.signal) for each in self.dangling)
        claims += (("waiting", each.node) for each in self.waiting)
        claims += (("orphan", number) for number, _ in self.orphans)
        return replace(self, may=frozenset(claims))


class Judge:
    """The questions of semantics 9.4, put to one exploration.

    ``inexact`` are nodes of the automaton. A run that shows something is looked for in the exact
    part first: where none is there, the claim is a may.
    """

    def __init__(self, exploration: Exploration, inexact: Collection[int] = ()) -> None:
        self.exploration = exploration
        part = ExactPart(exploration, inexact) if inexact else None
        self.part = part if part is not None and part.reached else None
        self.exact = None if self.part is None else Judge(self.part)
        self.inexact = inexact
        self.may: set[Claim] = set()
        self.automaton = exploration.automaton
        self.count = exploration.reached
        self.tree = tree = self.automaton.plan.vocabulary is Vocabulary.TREE
        runners = self.automaton.plan.runners
        # A choice of a tree is nothing that anybody does: it neither fails nor leads nowhere.
        self.uncounted = frozenset(
            number for number, each in enumerate(runners) if tree and each.interface in OWN
        )
        self.choices = [  # of which nobody knows what they can be
            self.automaton.runner_number(node)
            for node in self.inexact
            if self.automaton.nodes[node].kind is NodeKind.RUNNER
        ]
        self.stops_lead_on = not tree  # what a tree halts is no way to go on
        self.components = exploration.components(exploration.going())
        self.lingering = [each for each in self.components if exploration.just(each)]
        self._spared_from: dict[tuple[int, int], bool] = {}

    def facts(self) -> Answers:
        """All facts."""
        ends = self._ends()
        endless, fair = bool(self.lingering), self.exploration.fair(self.lingering, self.choices)
        if endless and not (self.exact and self.exact.lingering):
            self._doubt("endless")
        ended = {end: bool(numbers) for end, numbers in ends.items()}
        others = {
            end: any(possible for other, possible in ended.items() if other != end) for end in ended
        }
        completes, gives_up, stuck = (
            frequency(ended[end], others[end] or endless) for end in (COMPLETED, GAVE_UP, GOING)
        )
        triggered = 0
        for each in self.exploration.configurations[: self.count]:
            triggered |= each.active | each.hanging
        runners = len(self.automaton.runners)
        fewest, with_fewest = self._fewest_failures()
        facts = Answers(
            completes=completes,
            gives_up=gives_up,
            stuck=stuck,
            endless=frequency(endless, any(ended.values())),
            completes_if_fair=frequency(ended[COMPLETED], others[COMPLETED] or fair),
            unreachable=tuple(each for each in range(runners) if not triggered >> each & 1),
            loops=self._loops(),
            dangling=tuple(self._dangling(triggered)),
            # What has ended in a tree waits for nobody and leaves nothing running.
            waiting=() if self.tree else tuple(self._waiting()),
            orphans=() if self.tree else self._orphans(),
            fewest_failures=fewest,
            with_fewest=with_fewest,
            shown=self._shown(ends),
            configurations=self.count,
        )
        facts = replace(facts, may=frozenset(self.may))
        assert any(
            each is not Frequency.NEVER
            for each in (facts.completes, facts.gives_up, facts.stuck, facts.endless)
        ), "every machine has a maximal run"
        return facts

    def _ends(self) -> dict[int, list[int]]:
        """The first configurations of each end; those of GOING are standstills."""
        ends: dict[int, list[int]] = {COMPLETED: [], GAVE_UP: [], GOING: []}
        for at in range(self.count):
            each = self.exploration.configurations[at]
            if each.ended != GOING:
                ends[each.ended].append(at)
            elif not each.active:
                ends[GOING].append(at)
        return ends

    def _doubt(self, *claim: object) -> None:
        """No exact run shows what this claim says."""
        if self.inexact:
            self.may.add(claim)

    def _shown(self, ends: Mapping[int, list[int]]) -> dict[int, Run]:
        """A shortest run to each end, an exact one if there is any."""
        exact = {} if self.exact is None else self.exact._shown(self.exact._ends())
        for end, numbers in ends.items():
            if numbers and end not in exact:
                self._doubt("end", end)
        paths = {end: self.exploration.path(min(row)) for end, row in ends.items() if row}
        return paths | exact

    # -- loops ------------------------------------------------------------------------------

    def _loops(self) -> tuple[Loop, ...]:
        """The components in which runs can stay: traps first, one per set of runners in a loop."""
        if not self.lingering:
            return ()
        leaving = self.exploration.leading_to(
            at
            for at, each in enumerate(self.exploration.configurations[: self.count])
            if each.ended != GOING or not each.active
        )
        loops: dict[tuple[bool, frozenset[int]], Loop] = {}
        for component in self.lingering:
            trap = min(component) not in leaving
            exact = self._exact_lasso(component)
            lasso = exact or self.exploration.lasso(component)
            runners = lasso.runners
            if trap:
                acting = {step.number for steps in component.values() for step in steps}
                runners = tuple(sorted(acting))
            key = trap, frozenset(runners)
            if exact is None and key not in loops:
                self._doubt("loop", *key)
            elif exact is not None:
                self.may.discard(("loop", *key))
                loops.pop(key, None)
            loops.setdefault(key, Loop(trap, lasso, runners))
        return tuple(sorted(loops.values(), key=lambda loop: not loop.trap))

    def _exact_lasso(self, component: Steps) -> Lasso | None:
        """An exact run that stays in a component for ever, if there is any."""
        if self.exact is None or self.part is None:
            return None
        sources = self.part.sources
        inner = (each for each in self.exact.lingering if sources[min(each)] in component)
        return next(map(self.part.lasso, inner), None)

    # -- events that lead nowhere -----------------------------------------------------------

    def _dangling(self, triggered: int) -> Iterator[DanglingAt]:
        leading = leading_on(self.automaton, stops=self.stops_lead_on)
        for number in bits(triggered):
            if number in self.uncounted:
                continue
            for event in (Event.SUCCEEDED, Event.FAILED):
                signal = Signal(self.automaton.runner_node(number), event)
                if signal not in leading:
                    yield self._effect(signal, number, CODES[event])

    def _effect(self, signal: Signal, number: int, event: int) -> DanglingAt:
        costs = self._costs(number, event)
        exact = (None, None) if self.exact is None else self.exact._costs(number, event)
        effects: tuple[Literal["give_up", "stuck"], ...] = ("give_up", "stuck")
        for effect, run, exact_run in zip(effects, costs, exact, strict=True):
            if run is not None:
                if exact_run is None:
                    self._doubt("dangling", signal)
                return DanglingAt(signal, effect, run if exact_run is None else exact_run)
        return DanglingAt(signal, "dont_care", None)

    def _costs(self, number: int, event: int) -> tuple[Run | None, Run | None]:
        """Runs that end with this event by giving up, or stuck, and need not with the other one."""
        costs: list[Run | None] = [None, None]
        for at, place in self._endings.get((number, event), ()):
            if costs[place] is None and self._spared(at, number, event, place):
                costs[place] = (*self.exploration.path(at), (number, event))
        return costs[0], costs[1]

    @cached_property
    def _endings(self) -> dict[tuple[int, int], list[tuple[int, int]]]:
        """By runner and outcome: from where they end the run, and how (0: gives up, 1: stuck)."""
        exploration = self.exploration
        places = {
            at: 0 if each.ended == GAVE_UP else 1
            for at, each in enumerate(exploration.configurations[: self.count])
            if each.ended == GAVE_UP or (each.ended == GOING and not each.active)
        }
        endings: dict[tuple[int, int], list[tuple[int, int]]] = {}
        for at, steps in enumerate(exploration.steps[: self.count] if places else ()):
            if exploration.configurations[at].ended != GOING:
                continue
            for step in steps:
                if step.target in places:
                    key = step.number, step.outcome
                    endings.setdefault(key, []).append((at, places[step.target]))
        return endings

    def _spared(self, before: int, number: int, event: int, place: int) -> bool:
        """True if with the other outcome some maximal run does not give up, or is not stuck."""
        other = SUCCEEDED if event == FAILED else FAILED
        start = self.exploration.instead(before, number, other)
        if start == NOWHERE:
            return False
        if (start, place) not in self._spared_from:
            self._spared_from[start, place] = self._leads_elsewhere(start, place)
        return self._spared_from[start, place]

    def _leads_elsewhere(self, start: int, place: int) -> bool:
        """True if some maximal run from a configuration does not give up, or is not stuck."""
        exploration = self.exploration
        pending, seen = [start], {start}
        reachable: Steps = {}
        while pending:
            at = pending.pop()
            each = exploration.configurations[at]
            reachable[at] = exploration.steps[at]
            if each.ended == COMPLETED or (place == 1 and each.ended == GAVE_UP):
                return True
            if place == 0 and each.ended == GOING and not each.active:
                return True
            for step in exploration.steps[at]:
                if step.target not in seen:
                    seen.add(step.target)
                    pending.append(step.target)
        going = {
            at: [step for step in steps if exploration.configurations[step.target].ended == GOING]
            for at, steps in reachable.items()
            if exploration.configurations[at].ended == GOING
        }
        return bool(exploration.endless(going))

    # -- joins, orphans, failures -----------------------------------------------------------

    def _waiting(self) -> Iterator[WaitingJoin]:
        instants = self.exploration.instants
        for node in self.automaton.nodes:
            if node.kind is NodeKind.JOIN and node.need > 1:
                place = instants.place[node.index]
                waiting = self._waits(node.index, instants.inputs_of[place], 1 << place)
                if waiting is None:
                    continue
                exact = self.exact and self.exact._waits(
                    node.index, instants.inputs_of[place], 1 << place
                )
                if exact and exact.effect == waiting.effect:
                    yield exact
                else:
                    self._doubt("waiting", node.index)
                    yield waiting

    def _waits(self, node: int, inputs: int, bit: int) -> WaitingJoin | None:
        """A join that in some maximal run has inputs and neither fires nor is armed any more."""
        exploration = self.exploration
        part = exploration.part(
            lambda at, each: (
                at < self.count and bool(each.arrived & inputs) and not each.fired & bit
            ),
            lambda step: not step.joined & bit,
        )
        configurations = exploration.configurations
        still = {at: configurations[at].ended for at in part if not configurations[at].active}
        lingering = exploration.endless(part)
        order: tuple[tuple[WaitingEffect, int, bool], ...] = (
            ("stuck", GOING, False),
            ("give_up", GAVE_UP, False),
            ("give_up", GAVE_UP, True),
            ("endless", GOING, True),
            ("absorbed", COMPLETED, False),
            ("absorbed", COMPLETED, True),
        )
        for effect, end, looping in order:
            if not looping and end in still.values():
                at = min(at for at, ended in still.items() if ended == end)
                return WaitingJoin(node, effect, exploration.path(at))
            for component in lingering if looping else ():
                if configurations[min(component)].ended == end:
                    lasso = exploration.lasso(component)
                    fair = effect != "endless" or exploration.fair(lingering, self.choices)
                    return WaitingJoin(node, effect, lasso.prefix, lasso.loop, fair=fair)
        return None

    def _orphans(self) -> tuple[tuple[int, Run], ...]:
        """The runners active after the instant of completion, each with a shortest run up to it."""
        exploration = self.exploration
        configurations = exploration.configurations
        orphans: dict[int, Run] = {}
        left = 0
        for at, step in self._completing():
            each = configurations[at if step is None else step.target]
            new = (each.active | each.hanging) & ~left
            if new:
                left |= new
                last = () if step is None else ((step.number, step.outcome),)
                orphans |= dict.fromkeys(bits(new), (*exploration.path(at), *last))
        exact = {} if self.exact is None else dict(self.exact._orphans())
        for number in orphans.keys() - exact.keys():
            self._doubt("orphan", number)
        return tuple(sorted((orphans | exact).items()))

    def _completing(self) -> Iterator[tuple[int, Step | None]]:
        """The steps at whose instant the run completes; None if that is the first instant."""
        configurations = self.exploration.configurations
        if configurations[0].ended == COMPLETED:
            yield 0, None
        for at, steps in enumerate(self.exploration.steps[: self.count]):
            if configurations[at].ended == GOING:
                for step in steps:
                    if configurations[step.target].ended == COMPLETED:
                        yield at, step

    def _fewest_failures(self) -> tuple[int | None, Run]:
        """The fewest failures with which a run gives up, and the shortest such run."""
        fewest, run = self._fewest()
        if self.exact is not None and fewest is not None:
            exact_fewest, exact_run = self.exact._fewest()
            if exact_fewest == fewest:
                return fewest, exact_run
        if fewest is not None:
            self._doubt("fewest")
        return fewest, run

    def _fewest(self) -> tuple[int | None, Run]:
        configurations = self.exploration.configurations
        fewest = {0: (0, 0)}
        origins: dict[int, tuple[int, Step]] = {}
        queue = [(0, 0, 0)]  # failures, steps, configuration
        while queue:
            failures, length, at = heapq.heappop(queue)
            if configurations[at].ended == GAVE_UP:
                return failures, _run_to(at, origins)
            if configurations[at].ended != GOING or fewest[at] < (failures, length):
                continue
            for step in self.exploration.steps[at]:
                fails = step.outcome == FAILED and step.number not in self.uncounted
                reached = failures + fails, length + 1
                if step.target not in fewest or reached < fewest[step.target]:
                    fewest[step.target] = reached
                    origins[step.target] = at, step
                    heapq.heappush(queue, (*reached, step.target))
        return None, ()


def _run_to(at: int, origins: Mapping[int, tuple[int, Step]]) -> Run:
    """The steps that lead to a configuration, by the step before each."""
    steps: list[tuple[int, int]] = []
    while at in origins:
        at, step = origins[at]
        steps.append((step.number, step.outcome))
    return tuple(reversed(steps))


def leading_on(automaton: Automaton, *, stops: bool = True) -> frozenset[Signal]:
    """The events that lead, through joins, to a runner or to completion; ``stops`` may count."""
    import networkx

    nodes = automaton.nodes
    joins: networkx.DiGraph[Signal] = networkx.DiGraph()  # from what a join emits to its inputs
    ends = [Signal(source, event) for source, event, _ in automaton.stops if stops]
    for source, event, target in automaton.edges:
        if nodes[target].kind is NodeKind.JOIN:
            joins.add_edge(Signal(target, Event.SUCCEEDED), Signal(source, event))
        elif target != automaton.give_up:
            ends.append(Signal(source, event))
    joins.add_nodes_from(ends)
    layers = networkx.bfs_layers(joins, list(dict.fromkeys(ends)))
    return frozenset(signal for layer in layers for signal in layer)
