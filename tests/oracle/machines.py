"""All facts of a machine, by brute force: every configuration, every instant, every order.

Written from section 9 of the semantics page alone, for graphs of networkx with the attributes of
docs/machines.md. An instant is played by asking, event by event, whether it happens and why; runs
are paths through the configurations, and what runs can do for ever is looked for in the strongly
connected parts of them.

    s → a, a FAILED → a, a SUCCEEDED → end
    configurations   a active;  a idle, COMPLETED
    steps            a active, FAILED → a active        for ever: ENDLESS, but it is not fair
                     a active, SUCCEEDED → COMPLETED    completes: sometimes; if fair: always
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from heapq import heappop, heappush
from typing import Any, NamedTuple

import networkx as nx

SUCCEEDED, FAILED, HANG = "SUCCEEDED", "FAILED", "HANG"
STARTED, STOPPED = "STARTED", "STOPPED"
COMPLETED, GAVE_UP, STUCK, ENDLESS = "COMPLETED", "GAVE_UP", "STUCK", "ENDLESS"
IDLE, ACTIVE, HANGING = "idle", "active", "hanging"
UNSURE = "unsure"

Name = Hashable


class TooLargeError(Exception):
    """More configurations than one is ready to look at."""


class Configuration(NamedTuple):
    """A configuration of 9.2: states by runner, inputs that arrived by join, how it has ended.

    ``said``: the outcome that each tie has fixed.
    """

    states: tuple[str, ...]
    arrived: tuple[frozenset[int], ...]
    fired: tuple[bool, ...]
    end: str | None
    said: tuple[str | None, ...] = ()


class Tie(NamedTuple):
    """Runners of one outcome; what lets them forget it: writers that act, and events.

    Such an event has the runners that came before it. UNSURE: it came when one of those started,
    and some runner is still active.
    """

    runners: frozenset[Name]
    writers: frozenset[Name] = frozenset()
    resets: frozenset[tuple[tuple[Name, str], frozenset[Name]]] = frozenset()


@dataclass(frozen=True, slots=True)
class Step:
    """What leads from a configuration to the next; ``event`` is None where a runner begins to hang.

    ``over``: the runners whose visit is over. ``moved``: the joins that fire, are armed or stopped.
    """

    after: Configuration
    runner: int
    event: str | None
    over: frozenset[int] = frozenset()
    started: frozenset[int] = frozenset()
    moved: frozenset[int] = frozenset()


class _Instant:
    """One instant: which events happen, each asked for once."""

    def __init__(self, machine: Machine, before: Configuration, cause: tuple[int, str] | None):
        self.machine = machine
        self.before = before
        self.cause = cause
        self.memo: dict[tuple[Name, str], bool] = {}

    def happens(self, node: Name, event: str) -> bool:
        key = (node, event)
        if key not in self.memo:
            self.memo[key] = self._happens(node, event)
        return self.memo[key]

    def _happens(self, node: Name, event: str) -> bool:
        kind = self.machine.kinds[node]
        if kind == "start":
            return self.cause is None
        if kind == "join":
            return self.join(node)[2]
        assert kind == "runner"
        if event in (SUCCEEDED, FAILED):
            return self.cause is not None and self.cause == (self.machine.number[node], event)
        if event == STOPPED:
            return self.state(node) != IDLE and self.reached(node, "stop")
        assert event == STARTED
        return self.reached(node, "trigger") and (
            self.state(node) == IDLE or self.happens(node, STOPPED)
        )

    def reached(self, node: Name, action: str) -> bool:
        return any(
            self.happens(source, event)
            for source, event, _ in self.machine.into[action].get(node, ())
        )

    def state(self, node: Name) -> str:
        """The state once the outcome of this instant has come."""
        number = self.machine.number[node]
        if self.cause is not None and self.cause[0] == number:
            return IDLE
        return self.before.states[number]

    def state_after(self, node: Name) -> str:
        if self.happens(node, STARTED):
            return ACTIVE
        if self.happens(node, STOPPED):
            return IDLE
        return self.state(node)

    def join(self, node: Name) -> tuple[frozenset[int], bool, bool, bool]:
        """What has arrived after, has fired after, fires now, is armed or stopped now."""
        number = self.machine.join_number[node]
        arrived, fired = set(self.before.arrived[number]), self.before.fired[number]
        inputs = self.machine.into["trigger"].get(node, [])
        armed = self.reached(node, "stop")
        if armed:
            arrived, fired = set(), False
        arrived |= {edge for source, event, edge in inputs if self.happens(source, event)}
        fires = len(arrived) >= self.machine.needs[node] and not fired
        fired = fired or fires
        if fired and len(arrived) == len(inputs):
            arrived, fired, armed = set(), False, True
        return frozenset(arrived), fired, fires, armed


class Machine:
    """A machine as its graph says it; ``outcomes`` may limit those of single runners."""

    def __init__(
        self,
        graph: nx.MultiDiGraph[Any],
        outcomes: Mapping[Name, Iterable[str]] | None = None,
        *,
        ties: Sequence[Tie] = (),
        most: int = 20_000,
    ) -> None:
        self.most = most
        self.ties = ties
        self.kinds: dict[Name, str] = {name: data["kind"] for name, data in graph.nodes(data=True)}
        self.runners = [name for name, kind in self.kinds.items() if kind == "runner"]
        self.joins = [name for name, kind in self.kinds.items() if kind == "join"]
        self.number = {name: number for number, name in enumerate(self.runners)}
        self.join_number = {name: number for number, name in enumerate(self.joins)}
        self.needs = {name: graph.nodes[name]["need"] for name in self.joins}
        allowed = outcomes or {}
        self.outcomes = [frozenset(allowed.get(r, (SUCCEEDED, FAILED))) for r in self.runners]
        self.into: dict[str, dict[Name, list[tuple[Name, str, int]]]] = {"trigger": {}, "stop": {}}
        self.leads: dict[tuple[Name, str], list[tuple[str, Name]]] = {}
        for edge, (source, target, data) in enumerate(graph.edges(data=True)):
            event, action = data["event"], data.get("action", "trigger")
            self.into[action].setdefault(target, []).append((source, event, edge))
            self.leads.setdefault((source, event), []).append((action, target))
        self.memo: dict[Configuration, list[Step]] = {}

    def begin(self) -> Configuration:
        """The configuration after the first instant."""
        idle = Configuration(
            (IDLE,) * len(self.runners),
            (frozenset(),) * len(self.joins),
            (False,) * len(self.joins),
            None,
            (None,) * len(self.ties),
        )
        self.first = self._played(idle, None)
        return self.first.after

    def step(self, before: Configuration, runner: int, event: str) -> Step:
        """The instant at which an active runner emits its outcome."""
        assert before.states[runner] == ACTIVE
        return self._played(before, (runner, event))

    def instead(self, before: Configuration, runner: int, event: str) -> Configuration:
        """The configuration after the other outcome."""
        return self.step(before, runner, FAILED if event == SUCCEEDED else SUCCEEDED).after

    def _played(self, before: Configuration, cause: tuple[int, str] | None) -> Step:
        now = _Instant(self, before, cause)
        joins = [now.join(name) for name in self.joins]
        end = before.end
        if end is None:
            for kind, how in (("give_up", GAVE_UP), ("complete", COMPLETED)):
                ends = [name for name, each in self.kinds.items() if each == kind]
                if end is None and any(now.reached(name, "trigger") for name in ends):
                    end = how
        over = {n for n, name in enumerate(self.runners) if now.happens(name, STOPPED)}
        return Step(
            Configuration(
                tuple(now.state_after(name) for name in self.runners),
                tuple(join[0] for join in joins),
                tuple(join[1] for join in joins),
                end,
                tuple(self._said(place, tie, now, over) for place, tie in enumerate(self.ties)),
            ),
            -1 if cause is None else cause[0],
            None if cause is None else cause[1],
            frozenset(over if cause is None else {*over, cause[0]}),
            frozenset(n for n, name in enumerate(self.runners) if now.happens(name, STARTED)),
            frozenset(n for n, join in enumerate(joins) if join[2] or join[3]),
        )

    def _said(self, place: int, tie: Tie, now: _Instant, over: set[int]) -> str | None:
        """The outcome that a tie has fixed, after an instant."""
        before = now.before.said[place]
        resets = [names for (node, event), names in tie.resets if now.happens(node, event)]
        late = any(now.happens(name, STARTED) for names in resets for name in names)
        acting = any(now.state_after(name) == ACTIVE for name in tie.runners)
        if acting and (before == UNSURE or late):
            return UNSURE
        if before == UNSURE or resets or now.cause is None:
            return None
        runner, event = now.cause
        for name in tie.writers:
            number = self.number[name]
            if now.state_after(name) != IDLE or number in over or number == runner:
                return None
        return event if self.runners[runner] in tie.runners else before

    def possible(self, here: Configuration, runner: int) -> frozenset[str]:
        """The outcomes that the ties leave a runner."""
        outcomes = self.outcomes[runner]
        for tie, said in zip(self.ties, here.said, strict=True):
            if said in (SUCCEEDED, FAILED) and self.runners[runner] in tie.runners:
                outcomes &= {str(said), HANG}
        return outcomes

    def steps(self, before: Configuration) -> list[Step]:
        """All that can come next: the outcomes of what is active, and that it hangs."""
        if before not in self.memo:
            if len(self.memo) >= self.most:
                raise TooLargeError
            self.memo[before] = list(self._steps(before))
        return self.memo[before]

    def _steps(self, before: Configuration) -> Iterator[Step]:
        for runner, state in enumerate(before.states):
            if state != ACTIVE:
                continue
            for event in (SUCCEEDED, FAILED):
                if event in self.possible(before, runner):
                    yield self.step(before, runner, event)
            if HANG in self.outcomes[runner]:
                states = list(before.states)
                states[runner] = HANGING
                yield Step(before._replace(states=tuple(states)), runner, None)

    def reach(
        self, roots: Iterable[Configuration], keep: Callable[[Step], bool] = lambda step: True
    ) -> dict[Configuration, list[Step]]:
        """All configurations that steps of this kind lead to, with these steps."""
        steps: dict[Configuration, list[Step]] = {}
        todo = deque(roots)
        while todo:
            here = todo.popleft()
            if here not in steps:
                steps[here] = [step for step in self.steps(here) if keep(step)]
                todo.extend(step.after for step in steps[here])
        return steps


Steps = Mapping[Configuration, list[Step]]


def _parts(steps: Steps) -> Iterator[dict[Configuration, list[Step]]]:
    """The strongly connected parts in which something can happen for ever, and their steps."""
    graph: nx.DiGraph[Configuration] = nx.DiGraph()
    graph.add_nodes_from(steps)
    graph.add_edges_from((here, step.after) for here, each in steps.items() for step in each)
    for members in nx.strongly_connected_components(graph):
        part = {here: [s for s in steps[here] if s.after in members] for here in members}
        if any(part.values()):
            yield {here: part[here] for here in sorted(part, key=repr)}


def _is_run(part: Steps) -> bool:
    """True if no instance has to stay active: the run that takes all steps again and again is one.

    A run that takes fewer of them leaves more instances active for ever.
    """
    runners = range(len(next(iter(part)).states))
    over = {runner for each in part.values() for step in each for runner in step.over}
    rests = {r for here in part for r in runners if here.states[r] != ACTIVE}
    return all(runner in over or runner in rests for runner in runners)


def _is_fair_run(machine: Machine, part: Steps) -> bool:
    """True if some run in this part is fair.

    Who lacks an outcome here emits none for ever in a fair run: without it, look at the rest again.
    """
    emitted: dict[int, set[str]] = {}
    possible: dict[int, set[str]] = {}
    for here, each in part.items():
        for step in each:
            if step.event is not None:
                emitted.setdefault(step.runner, set()).add(step.event)
                possible.setdefault(step.runner, set()).update(machine.possible(here, step.runner))
    lacking = {runner for runner, events in emitted.items() if events != possible[runner] - {HANG}}
    if not lacking:
        return _is_run(part)
    rest = {
        here: [step for step in each if step.event is None or step.runner not in lacking]
        for here, each in part.items()
    }
    return any(_is_fair_run(machine, smaller) for smaller in _parts(rest))


def _stands(here: Configuration) -> bool:
    return ACTIVE not in here.states


def _back(steps: Steps, targets: Iterable[Configuration]) -> set[Configuration]:
    """The configurations from which one of the targets can be reached."""
    before: dict[Configuration, list[Configuration]] = {}
    for here, each in steps.items():
        for step in each:
            before.setdefault(step.after, []).append(here)
    reached = set(targets)
    todo = list(reached)
    while todo:
        for here in before.get(todo.pop(), ()):
            if here not in reached:
                reached.add(here)
                todo.append(here)
    return reached


@dataclass
class _Facts:
    """The facts of 9.4, one after the other."""

    machine: Machine
    steps: dict[Configuration, list[Step]] = field(init=False)
    parts: list[dict[Configuration, list[Step]]] = field(init=False)

    def __post_init__(self) -> None:
        self.first = self.machine.begin()
        self.steps = self.machine.reach([self.first])
        self.parts = [part for part in _parts(self._open(self.steps)) if _is_run(part)]

    @staticmethod
    def _open(steps: Steps) -> dict[Configuration, list[Step]]:
        return {
            here: [step for step in each if step.after.end is None]
            for here, each in steps.items()
            if here.end is None
        }

    # -- how runs end -----------------------------------------------------------------------

    def ends(self, *, fair: bool = False) -> set[str]:
        """How maximal runs end: what has ended goes on in some way, and stays ended."""
        ends = {here.end for here in self.steps if here.end is not None}
        if any(here.end is None and _stands(here) for here in self.steps):
            ends.add(STUCK)
        if any(not fair or _is_fair_run(self.machine, part) for part in self.parts):
            ends.add(ENDLESS)
        return ends

    def unreachable(self) -> list[Name]:
        started = set(self.machine.first.started)
        started |= {r for each in self.steps.values() for step in each for r in step.started}
        return [name for r, name in enumerate(self.machine.runners) if r not in started]

    def orphans(self) -> list[Name]:
        """At completion; the first instant may be it."""
        late: set[int] = set()
        for here, step in [(None, self.machine.first), *self.walk()]:
            if (here is None or here.end is None) and step.after.end == COMPLETED:
                late |= {r for r, state in enumerate(step.after.states) if state != IDLE}
        return [self.machine.runners[r] for r in sorted(late)]

    def walk(self) -> Iterator[tuple[Configuration, Step]]:
        for here, each in self.steps.items():
            for step in each:
                yield here, step

    def fewest_failures(self) -> int | None:
        """The cheapest path to an end of this kind, if a failure costs 1 and all else nothing."""
        done: set[Configuration] = set()
        todo: list[tuple[int, int, Configuration]] = [(0, 0, self.first)]
        count = 0
        while todo:
            cost, _, here = heappop(todo)
            if here.end == GAVE_UP:
                return cost
            if here in done or here.end is not None:
                continue
            done.add(here)
            for step in self.steps[here]:
                count += 1
                heappush(todo, (cost + (step.event == FAILED), count, step.after))
        return None

    # -- loops ------------------------------------------------------------------------------

    def loops(self) -> set[tuple[frozenset[Name], bool]]:
        """The runners that have outcomes in each loop, and whether it cannot be left."""
        leads_out = _back(
            self.steps, [here for here in self.steps if here.end is not None or _stands(here)]
        )
        return {
            (
                frozenset(
                    self.machine.runners[step.runner] for each in part.values() for step in each
                ),
                not any(here in leads_out for here in part),
            )
            for part in self.parts
        }

    # -- dangling ---------------------------------------------------------------------------

    def dangling(self) -> list[tuple[Name, str, str]]:
        lost = set(self.unreachable())
        return [
            (name, event, self._effect(number, event))
            for number, name in enumerate(self.machine.runners)
            for event in (SUCCEEDED, FAILED)
            if name not in lost and not self._leads_on(name, event)
        ]

    def _leads_on(self, name: Name, event: str) -> bool:
        todo, seen = [(name, event)], set()
        while todo:
            signal = todo.pop()
            if signal in seen:
                continue
            seen.add(signal)
            for action, target in self.machine.leads.get(signal, ()):
                kind = self.machine.kinds[target]
                if action == "stop" or kind in ("runner", "complete"):
                    return True
                if kind == "join":
                    todo.append((target, SUCCEEDED))
        return False

    def _effect(self, runner: int, event: str) -> str:
        if event not in self.machine.outcomes[runner]:
            return "dont_care"
        pairs = [
            (
                self.machine.step(here, runner, event).after,
                self.machine.instead(here, runner, event),
            )
            for here in self.steps
            if here.end is None
            and here.states[runner] == ACTIVE
            and event in self.machine.possible(here, runner)
        ]
        for effect, shown in (
            ("give_up", lambda here: here.end == GAVE_UP),
            ("stuck", lambda here: here.end is None and _stands(here)),
        ):
            instead = [after for now, after in pairs if shown(now)]
            if instead and any(after in self._otherwise(effect, instead) for after in instead):
                return effect
        return "dont_care"

    def _otherwise(self, effect: str, roots: list[Configuration]) -> set[Configuration]:
        """Those from which some maximal run does not give up, or is not stuck."""
        steps = self.machine.reach(roots)
        targets = {here for here in steps if here.end == COMPLETED}
        if effect == "give_up":
            targets |= {here for here in steps if here.end is None and _stands(here)}
        else:
            targets |= {here for here in steps if here.end == GAVE_UP}
        for part in _parts(self._open(steps)):
            if _is_run(part):
                targets |= set(part)
        return _back(steps, targets)

    # -- joins ------------------------------------------------------------------------------

    def join_deadlocks(self) -> list[tuple[Name, str]]:
        all_ = [(name, self._deadlock(n)) for n, name in enumerate(self.machine.joins)]
        return [(name, effect) for name, effect in all_ if effect is not None]

    def _deadlock(self, join: int) -> str | None:
        if self.machine.needs[self.machine.joins[join]] < 2:
            return None
        begins = [here for here in self.steps if here.arrived[join] and not here.fired[join]]
        quiet = self.machine.reach(begins, lambda step: join not in step.moved)
        ends = {here.end or STUCK for here in quiet if _stands(here)}
        for part in _parts(quiet):
            if _is_run(part):  # an end stays: all of a part have the same
                ends.add(next(iter(part)).end or ENDLESS)
        for end, effect in (
            (STUCK, "stuck"),
            (GAVE_UP, "give_up"),
            (ENDLESS, "endless"),
            (COMPLETED, "absorbed"),
        ):
            if end in ends:
                return effect
        assert not ends
        return None


def is_lasso(
    machine: Machine, prefix: Iterable[tuple[Name, str]], loop: Iterable[tuple[Name, str]]
) -> bool:
    """True if these outcomes are a run that has not ended and goes round in the loop for ever."""
    here = machine.begin()

    def after(name: Name, outcome: str) -> Step | None:
        number = machine.number[name]
        if here.states[number] != ACTIVE or outcome not in machine.possible(here, number):
            return None
        event = None if outcome == HANG else outcome
        return next(
            (s for s in machine.steps(here) if (s.runner, s.event) == (number, event)), None
        )

    for each in prefix:
        step = after(*each)
        if step is None:
            return False
        here = step.after
    start, waiting = here, {r for r, state in enumerate(here.states) if state == ACTIVE}
    for each in loop:
        step = after(*each)
        if step is None:
            return False
        here = step.after
        waiting -= step.over
        waiting = {runner for runner in waiting if here.states[runner] == ACTIVE}
    return here == start and here.end is None and not waiting


def _how_often(end: str, ends: set[str]) -> str:
    return "never" if end not in ends else "always" if len(ends) == 1 else "sometimes"


def machine_facts(
    graph: nx.MultiDiGraph[Any],
    outcomes: Mapping[Name, Iterable[str]] | None = None,
    *,
    ties: Sequence[Tie] = (),
    most: int = 20_000,
) -> dict[str, Any]:
    """All facts of a well-formed machine, with the names of its nodes."""
    return facts_of_machine(Machine(graph, outcomes, ties=ties, most=most))


def facts_of_machine(machine: Machine) -> dict[str, Any]:
    """All facts of a machine."""
    facts = _Facts(machine)
    ends, fair = facts.ends(), facts.ends(fair=True)
    return {
        "completes": _how_often(COMPLETED, ends),
        "gives_up": _how_often(GAVE_UP, ends),
        "stuck": _how_often(STUCK, ends),
        "endless": _how_often(ENDLESS, ends),
        "completes_if_fair": _how_often(COMPLETED, fair),
        "unreachable": facts.unreachable(),
        "loops": facts.loops(),
        "dangling": facts.dangling(),
        "join_deadlocks": facts.join_deadlocks(),
        "orphans": facts.orphans(),
        "fewest_failures_to_give_up": facts.fewest_failures(),
    }


def meetings(machine: Machine) -> set[tuple[Name, Name]]:
    """The runners that are active, or hang, at one instant, not later than that of the end."""
    facts = _Facts(machine)
    shown = [facts.first]
    for here, step in facts.walk():
        shown += [] if here.end is not None else [here, step.after]
    names = machine.runners
    return {
        (names[one], names[other])
        for here in shown
        for other in range(len(names))
        for one in range(other)
        if IDLE not in (here.states[one], here.states[other])
    }
