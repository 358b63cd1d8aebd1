"""The evaluator: what happens in one scenario.

It follows the automaton event by event and knows nothing of the analyses, so that every scenario
that they claim can be replayed here before anybody sees it. A run costs time in proportion to the
events that happen; besides that, one list with a number for each node is copied.

An event is a number here, its *code*: four times the node, and which event it is. Events of runners
wait in one queue. A join takes no time: the last input that it needs makes it fire before anything
else happens, and of several joins that one input makes fire the last is followed first.

Nothing that happens prevents anything else, so that an absence is shown backwards: a node never
comes if too few of its inputs can come. Of the other inputs nothing has to be shown. For example:

    a join of 3 that needs 2          it never fires if 2 inputs never come
    of these, one is a runner         decided to fail: its SUCCEEDED never comes
    and one a runner that is open     its trigger must never come: the search goes on there
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Container, Iterable, Mapping
from functools import cached_property
from itertools import count
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.errors import InternalError
from gpsfsm.model.automaton import Automaton, NodeKind, Signal
from gpsfsm.model.event import EMITTED, End, Event, Outcome

if TYPE_CHECKING:
    from collections.abc import Sequence

OutcomeOf = Callable[[int], Outcome]
"""The outcome of a runner instance by its number in document order, from 0."""

KEPT = 8  # scenarios whose runs are kept,
_MAX_EVENTS = 200_000  # with so many events in their runs


class Reasons(NamedTuple):
    """The reasons of an end: runner numbers, codes of events, and the questions that led there."""

    decisions: frozenset[int]
    trace: frozenset[int]
    questions: frozenset[int]


class Run:
    """A maximal run: all events in an order that respects causality.

    ``triggered`` holds each node that is triggered (for a join: that fires), in that order.
    ``broken`` holds the joins at which a second input aborts the engine, if it has such joins. All
    events are listed that can happen in some order; ``ends`` is ABORT if in some order the engine
    aborts before the plan completes.
    """

    __slots__ = ("_order", "_played", "broken", "ends", "reasons", "triggered")

    def __init__(
        self,
        played: Sequence[int],
        triggered: Mapping[int, None],
        ends: End,
        broken: frozenset[int] = frozenset(),
    ) -> None:
        self._played = played
        self._order: Mapping[int, int] | None = None
        self.reasons: Reasons | None = None  # of the end, once somebody has looked for them
        self.triggered = triggered
        self.ends = ends
        self.broken = broken

    def __len__(self) -> int:
        return len(self._played)

    @property
    def order(self) -> Mapping[int, int]:
        """The place of each event by its code. It is made late: few runs are asked for it."""
        if self._order is None:
            self._order = dict(zip(self._played, count(), strict=False))
        return self._order

    def happens(self, signal: Signal) -> bool:
        """True if the event happens."""
        return code_of(signal) in self.order

    def place(self, signal: Signal) -> int:
        """The place of the event in the order of the run; it must happen."""
        return self.order[code_of(signal)]

    @property
    def failures(self) -> int:
        """The number of FAILED events."""
        return sum(code & 3 == _FAILED for code in self._played)


_CODES = {Event.STARTED: 0, Event.SUCCEEDED: 1, Event.FAILED: 2, Event.STOPPED: 3}
_STARTED, _SUCCEEDED, _FAILED = 0, 1, 2


def code_of(signal: Signal) -> int:
    """The number that stands for an event of a node."""
    return signal.node * 4 + _CODES[signal.event]


_EVENTS = tuple(_CODES)
_RUNNER, _JOIN, _END = range(3)
_ROLES = {NodeKind.RUNNER: _RUNNER, NodeKind.JOIN: _JOIN, NodeKind.START: _JOIN}


def signal_of(code: int) -> Signal:
    """The event of a node that a code stands for."""
    return Signal(code >> 2, _EVENTS[code & 3])


class Evaluator:
    """Replays scenarios on one automaton."""

    def __init__(self, automaton: Automaton) -> None:
        self.automaton = automaton
        targets: list[list[int]] = [[] for _ in range(4 * len(automaton.nodes))]
        for source, event, target in automaton.edges:
            targets[source * 4 + _CODES[event]].append(target)
        self._targets = targets
        self.roles = [_ROLES.get(node.kind, _END) for node in automaton.nodes]
        self.need = [node.need or 1 for node in automaton.nodes]  # inputs, until it is triggered
        traits = automaton.traits
        self._breaking = traits.breaking
        for join in traits.breaking:
            if self.need[join] > 1:  # the second input breaks it
                self.need[join] = len(automaton.inputs[join]) + 1
        self._silent = frozenset(map(automaton.runner_number, traits.silent))
        self._loud: dict[Outcome | None, tuple[int, ...]] = dict(_EMITTED)
        if traits.refusals_hang:
            self._loud[Outcome.NO_START] = ()
        self._quiet = {
            outcome: tuple(code for code in codes if code != _STARTED)
            for outcome, codes in self._loud.items()
        }
        self._one_by_one = any(targets[::4])  # something is triggered by a STARTED
        self._kept: dict[OutcomeOf, dict[tuple[int, ...], Run]] = {}

    @cached_property
    def sources(self) -> Sequence[Sequence[int]]:
        """For each node the codes of the events that lead to it, in order of creation."""
        sources: list[list[int]] = [[] for _ in self.automaton.nodes]
        for source, event, target in self.automaton.edges:
            sources[target].append(source * 4 + _CODES[event])
        return sources

    def run(self, outcome_of: OutcomeOf, *, withheld: Collection[int] = ()) -> Run:
        """The run of a scenario.

        ``withheld``: numbers of runners whose outcome never comes (they do start).
        """
        kept = self._kept.get(outcome_of)
        if kept is None:
            return self._play(outcome_of, (), withheld)
        late = tuple(sorted(withheld))
        if late not in kept:
            kept[late] = self._play(outcome_of, (), withheld)
        return kept[late]

    def keep(self, outcome_of: OutcomeOf) -> None:
        """Keep the runs of this scenario from now on, as long as it is among the latest.

        It must be pure. The findings of a rule mostly need only a few scenarios in turn, and each
        of these in up to three claims about the same run.
        """
        self._kept[outcome_of] = self._kept.pop(outcome_of, {})
        events = [sum(map(len, runs.values())) for runs in self._kept.values()]
        while len(self._kept) > 1 and (len(self._kept) > KEPT or sum(events) > _MAX_EVENTS):
            del self._kept[next(iter(self._kept))], events[0]

    def emitted(self, number: int, outcome: Outcome) -> tuple[int, ...]:
        """The events of a runner that is triggered and has this outcome, as codes of node 0."""
        return (self._quiet if number in self._silent else self._loud)[outcome]

    def surely(self, decisions: Mapping[int, Outcome], *, withheld: Collection[int] = ()) -> Run:
        """The run that happens however the outcomes that are not in ``decisions`` turn out.

        Events never prevent others, so that what happens while those are withheld, even their
        STARTED, happens in every run.
        """
        return self._play(decisions.get, (), withheld)

    def possibly(self, decisions: Mapping[int, Outcome], *, withheld: Collection[int] = ()) -> Run:
        """Whatever may happen: outcomes that are not in ``decisions`` come in both ways."""
        return self._play(decisions.get, _OPEN, withheld)

    def open(self, number: int, decisions: Mapping[int, Outcome]) -> tuple[int, ...]:
        """The events that may come from a runner that is triggered."""
        if number in decisions:
            return self.emitted(number, decisions[number])
        return _OPEN[1:] if number in self._silent else _OPEN

    def prevented(
        self,
        nodes: Iterable[int],
        decisions: Mapping[int, Outcome],
        *,
        withheld: Collection[int] = (),
        happening: Container[int] = (),
    ) -> bool:
        """True if none of the nodes is triggered, whatever may happen.

        It is what ``possibly`` would say. ``happening`` are codes of events that are not worth
        looking behind, those of a run with these decisions: they count as possible, which never
        makes the answer true.
        """
        absence = _Absence(self, decisions, withheld, happening)
        return all(map(absence.shown, nodes))

    def _play(
        self,
        outcome_of: Callable[[int], Outcome | None],
        undecided: tuple[int, ...],
        withheld: Collection[int],
    ) -> Run:
        """Play; ``undecided`` are the events of the runners for which the outcome is None.

        A STARTED that triggers nothing is followed at once by the other event of its runner, so
        that the queue has one entry for both.
        """
        targets, roles, missing = self._targets, self.roles, self.need.copy()
        emitted: dict[Outcome | None, tuple[int, ...]] = self._loud | {None: undecided}
        seconds = {} if self._one_by_one else _SECONDS
        special = self._silent.union(withheld)
        played: list[int] = []
        triggered: list[int] = []
        queue: list[tuple[int, ...]] = [
            (start * 4 + _SUCCEEDED,) for start in self.automaton.starts
        ]
        firing: list[int] = []
        for codes in queue:  # grows while it is read
            played += codes
            reached = targets[codes[-1]]
            while True:
                for target in reached:
                    missing[target] -= 1
                    if missing[target]:
                        continue
                    triggered.append(target)
                    first = target * 4
                    if roles[target] == _RUNNER:
                        number = target - 1  # Automaton.runner_number
                        outcome = outcome_of(number)
                        second = seconds.get(outcome)
                        if second and number not in special:
                            queue.append((first, first + second))
                        else:
                            events = self._heard(number, emitted[outcome], withheld)
                            queue += [(first + event,) for event in events]
                    elif roles[target] == _JOIN:
                        firing.append(first + _SUCCEEDED)
                if not firing:
                    break
                played.append(firing.pop())
                reached = targets[played[-1]]
        came = dict.fromkeys(triggered)
        assert len(came) == len(triggered), "a node is triggered once"
        broken = self._broken(missing, came) if self._breaking else frozenset()
        return Run(played, came, self._end(came, broken), broken)

    def _heard(
        self, number: int, events: tuple[int, ...], withheld: Collection[int]
    ) -> tuple[int, ...]:
        """The events that come of a runner that is silent, or whose outcome is withheld."""
        if number in self._silent:
            events = tuple(event for event in events if event != _STARTED)
        return events[: events[:1] == (_STARTED,)] if number in withheld else events

    def _broken(self, missing: Sequence[int], triggered: Container[int]) -> frozenset[int]:
        """The joins that got a second input; ``missing``: the inputs that they still need."""
        looping = self.automaton.traits.looping
        return frozenset(
            join
            for join in self._breaking
            if self.need[join] - missing[join] > 1 or (join in looping and join in triggered)
        )

    def _end(self, triggered: Container[int], broken: frozenset[int]) -> End:
        automaton = self.automaton
        if broken and not broken.isdisjoint(automaton.deadly):
            return End.ABORT
        if automaton.complete in triggered:
            return End.COMPLETED
        if broken:
            raise InternalError("a join that completes the plan has fired without completing it")
        if automaton.give_up in triggered:
            return End.GAVE_UP
        return End.STUCK if automaton.traits.gives_up else End.HANG


_OPEN = (_STARTED, _SUCCEEDED, _FAILED)
_EMITTED: dict[Outcome | None, tuple[int, ...]] = {
    outcome: tuple(_CODES[event] for event in EMITTED[outcome]) for outcome in Outcome
}
_SECONDS: dict[Outcome | None, int] = {
    Outcome.SUCCEEDED: _SUCCEEDED,
    Outcome.FAILED: _FAILED,
}
"""The events that follow STARTED."""


class _Absence:
    """The search for what prevents nodes, backwards from them; see ``Evaluator.prevented``."""

    def __init__(
        self,
        evaluator: Evaluator,
        decisions: Mapping[int, Outcome],
        withheld: Collection[int],
        happening: Container[int],
    ) -> None:
        self._evaluator = evaluator
        self._decisions = decisions
        self._withheld = withheld
        self._happening = happening
        self._prevented = {0: False}  # by node; node 0 is the start
        self._counts: dict[int, tuple[int, int]] = {}  # inputs that come and do not, so far

    def shown(self, goal: int) -> bool:
        """True if the node is prevented."""
        pending = [goal]
        while pending:
            node = pending[-1]
            source = None if node in self._prevented else self._advance(node)
            if source is None:
                pending.pop()
            else:
                pending.append(source)
        return self._prevented[goal]

    def _advance(self, node: int) -> int | None:
        """Count inputs of the node until it is settled, or return one that has to be so before."""
        inputs, need = self._evaluator.sources[node], self._evaluator.need[node]
        coming, lacking = self._counts.get(node, (0, 0))
        while coming < need <= len(inputs) - lacking:
            code = inputs[coming + lacking]
            if code in self._happening:
                coming += 1
                continue
            prevented = self._prevented.get(code >> 2) if self._may_emit(code) else True
            if prevented is None:
                self._counts[node] = (coming, lacking)
                return code >> 2
            coming, lacking = coming + (not prevented), lacking + prevented
        self._prevented[node] = coming < need
        return None

    def _may_emit(self, code: int) -> bool:
        """True if the event may come of its node, once that is triggered."""
        node, event = divmod(code, 4)
        role = self._evaluator.roles[node]
        if role != _RUNNER:
            return role == _JOIN and event == _SUCCEEDED
        number = self._evaluator.automaton.runner_number(node)
        if number in self._withheld and event != _STARTED:
            return False
        return event in self._evaluator.open(number, self._decisions)
