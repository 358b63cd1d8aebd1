"""Configurations of a machine, and what happens at one instant (semantics, 9.2).

The events of an instant are the smallest set that the machine's connections close. None of them
causes itself, so that each node is looked at once, after all that can cause its event: in the
order of immediate causes, whose vertices are the STOPPED and the STARTED of a runner and the
SUCCEEDED of a join.

    A FAILED → stops B, triggers join J (1 of 2);  J SUCCEEDED → triggers B;  B STARTED → triggers C
    order      B STOPPED, J SUCCEEDED, B STARTED, C STARTED
    A fails while B is active: B stops, J fires, B starts again, C starts
"""

from __future__ import annotations

from heapq import heappop, heappush
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import Event

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Sequence

    import networkx as nx

    from gpsfsm.model.automaton import Automaton, Tie

STARTED, SUCCEEDED, FAILED, STOPPED = range(4)
"""Events as numbers; that of a node is ``node * 4 + event``."""

CODES = {
    Event.STARTED: STARTED,
    Event.SUCCEEDED: SUCCEEDED,
    Event.FAILED: FAILED,
    Event.STOPPED: STOPPED,
}
EVENTS = (Event.STARTED, Event.SUCCEEDED, Event.FAILED, Event.STOPPED)

GOING, COMPLETED, GAVE_UP = range(3)
"""How the run of a configuration has ended: not yet, or so."""

_STOP = -1
_UNSURE = 2  # of the bits of a tie


class Configuration(NamedTuple):
    """The state of a machine between two instants; sets of runners, inputs and joins are bits.

    Bit r of ``active`` and ``hanging``: the runner with number r. ``arrived``: one bit for each
    input of a join, in the order of ``Instants.inputs``. ``fired``: one bit for each join.
    ``said``: two bits for each tie, whether its outcome is fixed and whether it is SUCCEEDED; the
    second one alone says that no outcome counts now.
    """

    active: int
    hanging: int
    arrived: int
    fired: int
    ended: int
    said: int = 0


AT_FIRST = Configuration(0, 0, 0, 0, GOING)
"""The configuration before the first instant."""


class Instant(NamedTuple):
    """The result of an instant.

    ``events`` are numbers in an order of causes. ``moved``: the runners that came to an end, by
    an outcome or because they were stopped. ``joined``: the joins that fired or were stopped.
    ``triggered``: the runners that were triggered, also those for which that changes nothing.
    """

    configuration: Configuration
    events: tuple[int, ...]
    moved: int
    joined: int
    triggered: int


def immediate_causes(automaton: Automaton) -> nx.DiGraph[int]:
    """The graph of the events of an instant: an edge from each to those that it causes at once.

    Vertices are numbers of events. A well-formed machine has no cycle there (semantics, 9.1).
    """
    import networkx

    graph: nx.DiGraph[int] = networkx.DiGraph()
    joins = {node.index for node in automaton.nodes if node.kind is NodeKind.JOIN}
    for node in automaton.nodes:
        if node.kind is NodeKind.RUNNER:
            graph.add_edge(node.index * 4 + STOPPED, node.index * 4 + STARTED)
        elif node.kind is NodeKind.JOIN:
            graph.add_node(node.index * 4 + SUCCEEDED)
    for edges, caused in ((automaton.edges, STARTED), (automaton.stops, STOPPED)):
        for source, event, target in edges:
            cause = source * 4 + CODES[event]
            effect = target * 4 + (SUCCEEDED if target in joins else caused)
            if cause in graph and effect in graph:
                graph.add_edge(cause, effect)
    return graph


class Instants:
    """The instants of a well-formed machine: what an outcome leads to."""

    def __init__(self, automaton: Automaton, ties: Sequence[Tie] = ()) -> None:
        import networkx

        self.automaton = automaton
        self.ties = tuple(ties)
        self.tie_of = {number: place for place, tie in enumerate(ties) for number in tie.runners}
        self._writers = [sum(1 << number for number in set(tie.writers)) for tie in ties]
        self._resets = [
            {
                each.signal.node * 4 + CODES[each.signal.event]: [
                    automaton.runner_node(number) * 4 + STARTED for number in each.before
                ]
                for each in tie.resets
            }
            for tie in ties
        ]
        order = networkx.lexicographical_topological_sort(immediate_causes(automaton))
        self._vertices = tuple(order)
        self._rank = {vertex: rank for rank, vertex in enumerate(self._vertices)}
        joins = [node for node in automaton.nodes if node.kind is NodeKind.JOIN]
        self.joins = tuple(node.index for node in joins)
        self.place = {node.index: place for place, node in enumerate(joins)}
        self.inputs: tuple[tuple[Signal, int], ...] = tuple(
            (signal, join) for join in self.joins for signal in automaton.inputs[join]
        )
        self._need = [node.need for node in joins]
        self.inputs_of = [0] * len(joins)
        self.effects: dict[int, list[tuple[int, int]]] = {}
        self.stops: dict[int, int] = {}  # by event: the runners that it stops, as bits
        for bit, (signal, join) in enumerate(self.inputs):
            self.inputs_of[self.place[join]] |= 1 << bit
            self._add(signal, join * 4 + SUCCEEDED, 1 << bit)
        for source, event, target in automaton.edges:
            if target not in self.place:
                kind = automaton.nodes[target].kind
                vertex = target * 4 + STARTED if kind is NodeKind.RUNNER else ~target
                self._add(Signal(source, event), vertex, 0)
        for source, event, target in automaton.stops:
            if target in self.place:
                self._add(Signal(source, event), target * 4 + SUCCEEDED, _STOP)
            else:
                code = source * 4 + CODES[event]
                bit = 1 << automaton.runner_number(target)
                self.stops[code] = self.stops.get(code, 0) | bit

    def _add(self, signal: Signal, vertex: int, what: int) -> None:
        """An effect of an event: a vertex; the bit of the input that arrives, or _STOP."""
        code = signal.node * 4 + CODES[signal.event]
        self.effects.setdefault(code, []).append((vertex, what))

    def first(self) -> Instant:
        """The first instant: all start nodes emit SUCCEEDED."""
        starts = [start * 4 + SUCCEEDED for start in self.automaton.starts]
        instant = self._instant(AT_FIRST, starts, 0)
        return self._tied(instant, -1, STARTED) if self.ties else instant

    def after(self, at: Configuration, number: int, event: int) -> Instant:
        """The instant at which an active runner emits SUCCEEDED or FAILED."""
        bit = 1 << number
        assert at.active & bit, "only what is active has an outcome"
        idle = at._replace(active=at.active & ~bit)
        instant = self._instant(idle, [self.automaton.runner_node(number) * 4 + event], bit)
        return self._tied(instant, number, event) if self.ties else instant

    def fixed(self, at: Configuration, number: int) -> int | None:
        """The only outcome that a runner can have because of its tie; None if there is none."""
        place = self.tie_of.get(number)
        if place is None or not at.said >> 2 * place & 1:
            return None
        return SUCCEEDED if at.said >> 2 * place & 2 else FAILED

    def _tied(self, instant: Instant, number: int, event: int) -> Instant:
        """The same, with what the ties remember of it."""
        after, said = instant.configuration, 0
        busy = after.active | after.hanging | instant.moved
        events = set(instant.events)
        for place, tie in enumerate(self.ties):
            before = after.said >> 2 * place & 3
            resets = [row for code, row in self._resets[place].items() if code in events]
            unsure = before == _UNSURE or any(not events.isdisjoint(row) for row in resets)
            if unsure and any(after.active >> each & 1 for each in tie.runners):
                said |= _UNSURE << 2 * place
            elif not (before == _UNSURE or resets or self._writers[place] & busy):
                fixed = 1 + 2 * (event == SUCCEEDED)
                said |= (fixed if number in tie.runners else before) << 2 * place
        return instant._replace(configuration=after._replace(said=said))

    def hanging(self, at: Configuration, number: int) -> Configuration:
        """The configuration in which an active runner is never going to end by itself."""
        bit = 1 << number
        assert at.active & bit, "only what is active can hang"
        return at._replace(active=at.active & ~bit, hanging=at.hanging | bit)

    def _instant(self, at: Configuration, causes: Iterable[int], moved: int) -> Instant:
        now = _Now(at, list(causes), moved)
        due: list[int] = []
        spread = 0
        while True:
            while spread < len(now.events):
                # What is not active now starts behind its STOPPED, if at all: no stop reaches it.
                reached = self.stops.get(now.events[spread], 0) & (now.active | now.hanging)
                while reached:
                    number = (reached & -reached).bit_length() - 1
                    reached &= reached - 1
                    vertex = self.automaton.runner_node(number) * 4 + STOPPED
                    if vertex not in now.coming:
                        now.coming[vertex] = 0
                        heappush(due, self._rank[vertex])
                for vertex, what in self.effects.get(now.events[spread], ()):
                    if vertex < 0:
                        now.ends |= 1 if vertex == ~self.automaton.complete else 2
                        continue
                    if vertex not in now.coming:
                        now.coming[vertex] = 0
                        heappush(due, self._rank[vertex])
                    if what == _STOP:
                        now.stopped.add(vertex)
                    else:
                        now.coming[vertex] |= what
                spread += 1
            if not due:
                return now.instant()
            vertex = self._vertices[heappop(due)]
            node, kind = divmod(vertex, 4)
            if kind == SUCCEEDED:
                place = self.place[node]
                now.join(vertex, 1 << place, self.inputs_of[place], self._need[place])
            else:
                now.runner(vertex, kind, 1 << self.automaton.runner_number(node))


class _Now:
    """An instant while it happens."""

    def __init__(self, at: Configuration, events: list[int], moved: int) -> None:
        self.active, self.hanging, self.arrived, self.fired, self.ended, self.said = at
        self.events, self.moved, self.joined, self.triggered = events, moved, 0, 0
        self.ends = 0  # bit 0: complete is triggered, bit 1: give_up
        self.coming: dict[int, int] = {}  # the vertices that are caused, with the inputs that come
        self.stopped: set[int] = set()

    def runner(self, vertex: int, kind: int, bit: int) -> None:
        """A runner is stopped, or triggered."""
        if kind == STOPPED:
            if (self.active | self.hanging) & bit:
                self.active, self.hanging = self.active & ~bit, self.hanging & ~bit
                self.moved |= bit
                self.events.append(vertex)
            return
        self.triggered |= bit
        if not (self.active | self.hanging) & bit:
            self.active |= bit
            self.events.append(vertex)

    def join(self, vertex: int, bit: int, inputs: int, need: int) -> None:
        """Inputs of a join arrive, after it was stopped if it was."""
        if vertex in self.stopped:
            self.arrived, self.fired = self.arrived & ~inputs, self.fired & ~bit
            self.joined |= bit
        self.arrived |= self.coming[vertex]
        arrived = self.arrived & inputs
        if not self.fired & bit and arrived.bit_count() >= need:
            self.fired, self.joined = self.fired | bit, self.joined | bit
            self.events.append(vertex)
        if arrived == inputs and self.fired & bit:  # armed again
            self.arrived, self.fired = self.arrived & ~inputs, self.fired & ~bit
            self.joined |= bit

    def instant(self) -> Instant:
        """The instant, now that all of it has happened."""
        ended = self.ended
        if ended == GOING and self.ends:
            ended = GAVE_UP if self.ends & 2 else COMPLETED
        after = Configuration(self.active, self.hanging, self.arrived, self.fired, ended, self.said)
        return Instant(after, tuple(self.events), self.moved, self.joined, self.triggered)


HANG = 3
"""A runner hangs: a step beside SUCCEEDED and FAILED that emits nothing."""

MOST_CHANGES = 50_000
"""Changes that are kept before all of them are made anew: one takes up to a kilobyte."""


class Change(NamedTuple):
    """The effect of an outcome: of a packed configuration the bits ``kept``, and those ``added``.

    ``number`` and ``outcome``: whose it is. Sets of runners: ``stopped`` come to an end if they are
    active or hang, ``moved`` do in any case; ``triggered`` stay as they are if they hang.
    ``joined``: the joins that fire, are armed again or stopped.
    """

    number: int
    outcome: int
    kept: int
    added: int
    stopped: int
    triggered: int
    moved: int
    joined: int


class Move:
    """An outcome of a runner, and its changes by the bits of a configuration that it ``looks`` at.

    The change is None where a tie rules the outcome out.
    """

    __slots__ = ("changes", "looks", "number", "outcome", "step")

    def __init__(self, number: int, outcome: int, looks: int) -> None:
        self.step = self.number, self.outcome = number, outcome
        self.looks = looks
        self.changes: dict[int, Change | None] = {}


# The idea: an instant looks at little of a configuration: at the joins that it can reach, and at
# runners whose STARTED or STOPPED causes more. All other runners are quiet. They are stopped and
# triggered too, but nothing depends on that, so that bit operations do it, whoever is active. So
# an instant is played once for all configurations that agree in the bits that it looks at.
#
#     A FAILED → stops B and C, triggers D         nobody listens to B, C and D: all three are quiet
#     looks at nothing; kept: all but A, B and C; added: D; stopped: B and C
#     {A, B} → {D}      {A, C, D, E} → {D, E}      the second one is not played any more
#
# That is the same for two reasons. What an instant does is decided by its events, and each event
# of a node that is not quiet is decided by the bits that the instant looks at, which are collected
# along the effects of the events that can come. And what stops a runner comes before its STARTED
# (see ``immediate_causes``): a quiet runner is first idle, if anything stops it, and then active,
# if anything triggers it and it does not hang.


class Successors:
    """The steps of a machine from configurations that are packed into numbers.

    From its lowest bits on, a number has ``Configuration``'s active, hanging (if that can be),
    arrived, fired, ended and said. ``by_scenario``: an outcome that is compared with only is none
    of the steps.
    """

    by_scenario = False

    def __init__(self, instants: Instants, allowed: Sequence[Sequence[int]]) -> None:
        self.instants = instants
        self.runners = runners = len(allowed)
        hang = any(HANG in outcomes for outcomes in allowed)
        self._hanging = runners if hang else 0  # where the bits of hanging begin
        self._arrived = runners + self._hanging
        self._fired = self._arrived + len(instants.inputs)
        self._ended = self._fired + len(instants.joins)
        self._said = self._ended + 2
        self._active = (1 << runners) - 1
        self._loud, self._always = self._watched()
        self._allowed = allowed
        self._moves: dict[int, tuple[Move, ...]] = {}  # by the bit of the runner
        self._kept = 0

    @property
    def tied(self) -> Collection[int]:
        """The runners that have a tie."""
        return self.instants.tie_of

    def first(self) -> Configuration:
        """The configuration after the first instant."""
        return self.instants.first().configuration

    def instead(self, at: Configuration, number: int, code: int) -> Configuration:
        """The configuration after an outcome, whether it can come or not."""
        return self.instants.after(at, number, code).configuration

    def possible(self, at: Configuration, number: int) -> tuple[int, ...]:
        """The outcomes that an active runner can have in a configuration."""
        fixed = self.instants.fixed(at, number)
        if fixed is None:
            return tuple(self._allowed[number])
        return tuple(each for each in self._allowed[number] if each in (fixed, HANG))

    def packed(self, configuration: Configuration) -> int:
        """The number of a configuration."""
        active, hanging, arrived, fired, ended, said = configuration
        assert self._hanging or not hanging
        return (
            active
            | hanging << self._hanging
            | arrived << self._arrived
            | fired << self._fired
            | ended << self._ended
            | said << self._said
        )

    def unpacked(self, state: int) -> Configuration:
        """The configuration of a number."""
        return Configuration(
            state & self._active,
            state >> self._hanging & self._active if self._hanging else 0,
            state >> self._arrived & (1 << self._fired - self._arrived) - 1,
            state >> self._fired & (1 << self._ended - self._fired) - 1,
            state >> self._ended & 3,
            state >> self._said,
        )

    def changes(self, state: int) -> list[Change]:
        """The steps that a configuration has, by runner and outcome."""
        changes: list[Change] = []
        active = state & self._active
        while active:
            bit = active & -active
            active ^= bit
            for move in self._moves.get(bit) or self._moves_of(bit):
                try:
                    change = move.changes[state & move.looks]
                except KeyError:
                    change = self._played(state, move)
                if change is not None:
                    changes.append(change)
        return changes

    def targets(self, state: int, changes: Iterable[Change]) -> list[int]:
        """The configurations that its steps lead to."""
        if self._hanging:
            return [self._made(state, change) for change in changes]
        return [state & change.kept | change.added for change in changes]

    def moved(self, state: int, changes: Iterable[Change]) -> list[int]:
        """The runners that come to an end in its steps."""
        busy = self._busy(state)
        return [busy & change.stopped | change.moved for change in changes]

    def _moves_of(self, bit: int) -> tuple[Move, ...]:
        """The possible outcomes of a runner, in ascending order."""
        number = bit.bit_length() - 1
        self._moves[bit] = tuple(
            Move(number, outcome, self._looks(number, outcome)) for outcome in self._allowed[number]
        )
        return self._moves[bit]

    def _made(self, state: int, change: Change) -> int:
        """The configuration that a change makes of one: what hangs is not active."""
        made = state & change.kept | change.added
        if self._hanging:
            made &= ~(change.triggered & made >> self._hanging)
        return made

    def _busy(self, state: int) -> int:
        """The runners that are active or hang."""
        hanging = state >> self._hanging if self._hanging else 0
        return (state | hanging) & self._active

    def _bits_of(self, runners: int) -> int:
        """The bits that tell whether some runners are active or hang."""
        return runners | runners << self._hanging

    def _watched(self) -> tuple[int, int]:
        """The runners that are not quiet, and the bits that every instant looks at.

        Ties with writers or resets look at configurations, too; all others remember outcomes only.
        """
        causes = {*self.instants.effects, *self.instants.stops}
        loud = always = 0
        for place, tie in enumerate(self.instants.ties):
            if not (tie.writers or tie.resets):
                continue
            members = {*tie.writers}
            for reset in tie.resets:
                causes.add(reset.signal.node * 4 + CODES[reset.signal.event])
                members.update((*reset.before, *tie.runners) if reset.before else ())
            loud |= sum(1 << number for number in members)
            always |= self._bits_of(loud) | 3 << self._said + 2 * place
        for number in range(self.runners):
            node = self.instants.automaton.runner_node(number)
            if not causes.isdisjoint((node * 4 + STARTED, node * 4 + STOPPED)):
                loud |= 1 << number
        return loud, always

    def _looks(self, number: int, outcome: int) -> int:
        """The bits of a configuration that decide what this outcome causes, but for quiet runners.

        They are collected along the effects of all events that can come at its instant.
        """
        if outcome == HANG:
            return 0
        instants, automaton = self.instants, self.instants.automaton
        looks = self._always
        if number in instants.tie_of:
            looks |= 3 << self._said + 2 * instants.tie_of[number]
        events = [automaton.runner_node(number) * 4 + outcome]
        seen = set(events)
        for event in events:  # grows while it is read
            effects = [vertex for vertex, _ in instants.effects.get(event, ())]
            effects += (
                automaton.runner_node(each) * 4 + STOPPED
                for each in bits(instants.stops.get(event, 0) & self._loud)
            )
            for vertex in effects:
                if vertex < 0:
                    looks |= 3 << self._ended
                    continue
                node, kind = divmod(vertex, 4)
                if kind == SUCCEEDED:
                    place = instants.place[node]
                    looks |= instants.inputs_of[place] << self._arrived
                    looks |= 1 << self._fired + place
                elif self._loud >> automaton.runner_number(node) & 1:
                    looks |= self._bits_of(1 << automaton.runner_number(node))
                else:
                    continue
                if vertex not in seen:
                    seen.add(vertex)
                    events.append(vertex)
        return looks

    def _played(self, state: int, move: Move) -> Change | None:
        """The change of a configuration, kept for all that agree in what the move looks at."""
        if self._kept == MOST_CHANGES:
            self._kept = 0
            self._moves.clear()
        change = self._change(state, move)
        move.changes[state & move.looks] = change
        self._kept += 1
        return change

    def _change(self, state: int, move: Move) -> Change | None:
        before, own = self.unpacked(state), 1 << move.number
        if move.outcome == HANG:
            return Change(*move.step, ~own, own << self._hanging, 0, 0, own, 0)
        if self.instants.fixed(before, move.number) not in (None, move.outcome):
            return None
        instant = self.instants.after(before, move.number, move.outcome)
        stopped = 0
        for event in instant.events:
            stopped |= self.instants.stops.get(event, 0)
        stopped &= ~(self._loud | own)
        triggered = instant.triggered & ~self._loud
        after = self.packed(instant.configuration)
        change = Change(
            *move.step,
            kept=~(move.looks | self._bits_of(stopped) | own),
            added=after & move.looks | triggered,
            stopped=stopped,
            triggered=triggered,
            moved=instant.moved & self._loud | own,
            joined=instant.joined,
        )
        assert self._is_right(change, state, after, instant), "a change does what its instant does"
        return change

    def _is_right(self, change: Change, state: int, after: int, instant: Instant) -> bool:
        """True if a change makes of a configuration what the instant makes of it."""
        (moved,) = self.moved(state, [change])
        return self._made(state, change) == after and moved == instant.moved


def bits(number: int) -> Iterator[int]:
    """The places of the bits of a number, in ascending order."""
    while number:
        lowest = number & -number
        yield lowest.bit_length() - 1
        number ^= lowest
