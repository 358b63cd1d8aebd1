"""Two plans side by side, as an observer sees them who gives every action its outcome.

Of a plan is seen which actions are triggered at an instant and how the run ends; names, layout and
providers are not. It is played one outcome at a time (``Behaviour``). Both plans are played
together (``Sides``): the same outcome is given to both members of a pair. Occurrences of equal
actions that begin at the same instant cannot be told apart yet: they can be paired in several ways.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from functools import cached_property
from itertools import islice, product
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.compile.stepper import START, Stepper
from gpsfsm.model.automaton import Signal
from gpsfsm.model.event import End, Event

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from gpsfsm.compile import Compiled
    from gpsfsm.compile.stepper import Arrived
    from gpsfsm.equivalence.admission import Admission
    from gpsfsm.model.plan import Plan


Action = Hashable
"""Equal for equal actions (semantics, section 4)."""

OUTCOMES = (Event.SUCCEEDED, Event.FAILED)
"""What an observer can answer, in the order of canonical scenarios."""


class State(NamedTuple):
    """All that the rest of a run depends on.

    ``active`` are the numbers of the active instances, ascending. States are equal if the rest of
    the run cannot differ by what the joins still wait for. An ended run has no active instances.
    """

    active: tuple[int, ...]
    arrived: Arrived


class Reaction(NamedTuple):
    """The events of one instant: the instances that are triggered, ascending, and the end.

    ``end`` is None while the run goes on. What is triggered at the instant of the end counts;
    later than that nothing is observed, since all that is active is stopped. ``stopped`` are the
    instances that a machine stops while its run goes on, ascending.
    """

    triggered: tuple[int, ...]
    end: End | None
    stopped: tuple[int, ...] = ()


@dataclass(frozen=True, slots=False, eq=False)
class Behaviour:
    """A compiled plan, to be played; instances are numbers in document order, from 0.

    The plan must be compiled without start chain: outcomes are SUCCEEDED and FAILED. It may be
    compiled for an engine; then a run that can go on no more hangs.
    """

    compiled: Compiled

    @property
    def plan(self) -> Plan:
        """The plan."""
        return self.compiled.automaton.plan

    @cached_property
    def actions(self) -> tuple[Action, ...]:
        """The action of each instance."""
        return tuple(runner.action for runner in self.plan.runners)

    def begin(self) -> tuple[State, Reaction]:
        """The start of a run."""
        return self._after((), (), START)

    def after(self, state: State, number: int, event: Event) -> tuple[State, Reaction]:
        """An active instance has this outcome (SUCCEEDED or FAILED)."""
        active = tuple(other for other in state.active if other != number)
        return self._after(active, state.arrived, Signal(number + 1, event))

    def _after(
        self, active: tuple[int, ...], before: Arrived, signal: Signal
    ) -> tuple[State, Reaction]:
        triggered, arrived, end = self._stepper.settle(before, signal)
        if end is not None:
            return State((), ()), Reaction(triggered, end)
        now = tuple(sorted((*active, *triggered)))
        if not now and not self.compiled.automaton.traits.gives_up:
            return State((), ()), Reaction((), End.HANG)
        return State(now, self._stepper.relevant(arrived, now)), Reaction(triggered, None)

    @cached_property
    def _stepper(self) -> Stepper:
        return Stepper(self.compiled, immediate=True)


_MAX_WAYS = 64
_MAX_SHUFFLED = 7


class Pair(NamedTuple):
    """An instance of the first plan and one of the second, by number in document order."""

    first: int
    second: int


class Step(NamedTuple):
    """An outcome that the observer gives to a pair."""

    pair: Pair
    event: Event


class Joint(NamedTuple):
    """The states of both plans; ``pairs`` are the active instances, ascending.

    ``decided`` holds, where equal actions have equal outcomes, those that have been given and
    that still matter; ``assigned``, under assumptions, those that others depend on, ascending.
    """

    pairs: tuple[Pair, ...]
    first: tuple[tuple[int, int], ...]
    second: tuple[tuple[int, int], ...]
    decided: tuple[tuple[int, Event], ...] = ()
    assigned: tuple[Step, ...] = ()


@dataclass(frozen=True, slots=True)
class Difference:
    """A difference between two plans: after ``steps`` they react differently.

    Without steps they differ at the beginning. ``shortest``: no smaller number of outcomes shows a
    difference; if False, the search for a smaller one took too long.
    """

    steps: tuple[Step, ...]
    first: Reaction
    second: Reaction
    shortest: bool = True

    def perhaps_not_first(self) -> Difference:
        """A copy with ``shortest`` set to False."""
        return Difference(self.steps, self.first, self.second, shortest=False)


class Meeting(NamedTuple):
    """The reactions of both plans at one instant: ``ways`` to go on, one per pairing.

    No ways: they differ. Not ``every``: there are more ways than are listed.
    """

    first: Reaction
    second: Reaction
    ways: tuple[Joint, ...]
    every: bool = True


@dataclass(frozen=True, slots=False, eq=False)
class Sides:
    """Both plans, and for each of their instances four numbers.

    ``kinds``: equal for equal actions. ``twins``: equal for instances of one plan that are
    triggered together and can be exchanged then, each with all that follows from it alone.
    ``ranks``: equal for equal places in the normal forms (-1: nothing triggers it). ``begins``:
    equal for those with which equal forms begin. ``last`` holds for each kind its last instances
    (-1: none). ``same_form``: the plans have one normal form, so they do the same.
    """

    first: Behaviour
    second: Behaviour
    kinds: tuple[tuple[int, ...], tuple[int, ...]]
    twins: tuple[tuple[int, ...], tuple[int, ...]]
    ranks: tuple[tuple[int, ...], tuple[int, ...]]
    begins: tuple[tuple[int, ...], tuple[int, ...]]
    last: Mapping[int, Pair]
    consistent: bool = False
    same_form: bool = False
    admission: Admission | None = None

    def begin(self) -> Meeting:
        """Both plans begin."""
        return self._meet((), (), (), self.first.begin(), self.second.begin())

    def after(self, joint: Joint, step: Step) -> Meeting:
        """A pair has this outcome in both plans."""
        (one, other), event = step
        rest = tuple(pair for pair in joint.pairs if pair != step.pair)
        here = State(tuple(pair.first for pair in joint.pairs), joint.first)
        there = State(tuple(sorted(pair.second for pair in joint.pairs)), joint.second)
        decided = joint.decided
        if self.consistent:
            assigned = (self.kinds[0][one], event)
            decided = tuple(sorted({*decided, assigned}))
        return self._meet(
            rest,
            decided,
            self._assigned(joint, step),
            self.first.after(here, one, event),
            self.second.after(there, other, event),
        )

    def _assigned(self, joint: Joint, step: Step) -> tuple[Step, ...]:
        if self.admission is None or not any(map(self.admission.tied, (0, 1), step.pair)):
            return joint.assigned
        return tuple(sorted((*joint.assigned, step)))

    def allows(self, joint: Joint, step: Step) -> bool:
        """True if the observer may give this outcome. Raises InconclusiveError."""
        if self.consistent:
            kind = self.kinds[0][step.pair.first]
            if any(
                decided_kind == kind and event is not step.event
                for decided_kind, event in joint.decided
            ):
                return False
        admission = self.admission
        if admission is None:
            return True
        if not all(admission.permits(side, step.pair[side], step.event) for side in (0, 1)):
            return False
        assigned = self._assigned(joint, step)
        return assigned is joint.assigned or all(
            admission.admits(side, ((pair[side], event) for pair, event in assigned))
            for side in (0, 1)
        )

    def _meet(
        self,
        rest: tuple[Pair, ...],
        decided: tuple[tuple[int, Event], ...],
        assigned: tuple[Step, ...],
        one: tuple[State, Reaction],
        other: tuple[State, Reaction],
    ) -> Meeting:
        (here, first), (there, second) = one, other
        pairings, every = self.paired(rest, first, second)
        if first.end is not None:
            return Meeting(first, second, tuple(Joint((), (), ()) for _ in pairings[:1]))
        ways = []
        for pairs in pairings:
            kept = tuple(each for each in decided if self._matters(each[0], pairs))
            ways.append(Joint(pairs, here.arrived, there.arrived, kept, assigned))
        return Meeting(first, second, tuple(ways), every)

    def paired(
        self, rest: tuple[Pair, ...], first: Reaction, second: Reaction
    ) -> tuple[list[tuple[Pair, ...]], bool]:
        """All that is active, in each way to pair what starts; True if all ways are listed.

        No way: it cannot be paired, or one ends otherwise. After an end one way, without pairs.
        """
        mine = self._by_kind(0, first.triggered)
        theirs = self._by_kind(1, second.triggered)
        sizes = {kind: len(numbers) for kind, numbers in mine.items()}
        if first.end is not second.end or sizes != {k: len(v) for k, v in theirs.items()}:
            return [], True
        if first.end is not None:
            return [()], True
        pairings = list(islice(self._pairings(mine, theirs), _MAX_WAYS + 1))
        every = len(pairings) <= _MAX_WAYS
        chosen = pairings if every else pairings[:1]
        return [tuple(sorted((*rest, *more))) for more in chosen], every

    def _matters(self, kind: int, pairs: tuple[Pair, ...]) -> bool:
        """True if an instance of this action is active or may come: what comes is further down."""
        last = self.last[kind]
        return any(pair.first <= last.first or pair.second <= last.second for pair in pairs)

    def _by_kind(self, side: int, numbers: Sequence[int]) -> dict[int, list[int]]:
        groups: dict[int, list[int]] = {}
        for number in numbers:
            groups.setdefault(self.kinds[side][number], []).append(number)
        return groups

    def _pairings(
        self, mine: Mapping[int, list[int]], theirs: Mapping[int, list[int]]
    ) -> Iterator[list[Pair]]:
        """All ways to pair, up to twins; the likeliest comes first."""
        choices = [self._assignments(mine[kind], theirs[kind]) for kind in sorted(mine)]
        for ways in product(*choices):
            yield [pair for pairing in ways for pair in pairing]

    def _assignments(self, mine: list[int], theirs: list[int]) -> list[list[Pair]]:
        if len(mine) == 1:
            return [[Pair(mine[0], theirs[0])]]
        twins = {self.twins[0][number] for number in mine}, {self.twins[1][each] for each in theirs}
        if 1 in map(len, twins):
            return [list(map(Pair, mine, theirs))]
        likely = self._likely(mine, theirs)
        if len(mine) > _MAX_SHUFFLED:  # too many ways: the caller is to know that these are not all
            return [likely] * (_MAX_WAYS + 1)
        assignments = [likely]
        self._assign(sorted(mine, key=self.twins[0].__getitem__), theirs, [], assignments)
        return assignments

    def _likely(self, mine: list[int], theirs: list[int]) -> list[Pair]:
        """The pairing of those that look alike in the whole of their plans, then in parts."""
        alike: dict[int, int] = {}
        others = list(theirs)
        for names in (self.ranks, self.begins):
            left: dict[int, list[int]] = {}
            for other in reversed(others):
                left.setdefault(names[1][other], []).append(other)
            for n in mine:
                if n not in alike and left.get(names[0][n]):
                    alike[n] = left[names[0][n]].pop()
            others = sorted(other for rest in left.values() for other in rest)
        rest = iter(others)
        return [Pair(n, alike[n] if n in alike else next(rest)) for n in mine]

    def _assign(
        self, mine: list[int], left: list[int], so_far: list[Pair], assignments: list[list[Pair]]
    ) -> None:
        """Extend a pairing in all ways; of twins it does not matter which is taken."""
        if not left:
            assignments.append(so_far)
            return
        number = mine[len(so_far)]
        mine_twins, twins = self.twins
        least = -1
        if so_far and mine_twins[so_far[-1].first] == mine_twins[number]:
            least = twins[so_far[-1].second]
        tried: set[int] = set()
        for other in left:
            if twins[other] in tried or twins[other] < least or len(assignments) > _MAX_WAYS:
                continue
            tried.add(twins[other])
            rest = [each for each in left if each != other]
            self._assign(mine, rest, [*so_far, Pair(number, other)], assignments)
