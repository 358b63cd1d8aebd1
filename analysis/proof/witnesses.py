"""Runs that show what the structural pass says there is: all of them are replayed at once.

An analysis asks for scenarios (``lane``) and says what must be seen in each (``expect``). Thousands
of them run at once: each is a bit of the numbers that are computed (a *lane*). One pass in
topological order computes for each node the lanes in which it is triggered, with an operation per
connection whatever the number of lanes. It is an evaluator of its own, which shares no code with
the one that replays what is shown.

    A in a guard with B; lane 0: nothing fails, lane 1: A fails, lane 2: A and B fail
    A triggered in 111, fails in 110; B triggered in 110, fails in 100: the plan gives up in lane 2
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import Event, Outcome

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from gpsfsm.analysis.structure import Structure
    from gpsfsm.model.automaton import Automaton, Block

_AT_ONCE = 4096
"""Scenarios that are replayed together: numbers of 512 bytes."""


class _Scenario(NamedTuple):
    failing: tuple[int, ...]
    held: tuple[int, ...]
    saved: Block | None


class _Expected(NamedTuple):
    analysis: str
    lane: int
    happens: Sequence[Signal]
    triggered: Sequence[int]
    absent: Sequence[int]
    failures: int | None
    before: tuple[int, Sequence[int]] | None


class Witnesses:
    """The scenarios that show the answers about one plan."""

    def __init__(self, structure: Structure) -> None:
        self.structure = structure
        self.automaton = structure.compiled.automaton
        self.analysis = ""  # the one that asks
        self._scenarios: list[_Scenario] = []
        self._numbers: dict[_Scenario, int] = {}
        self._expected: list[_Expected] = []
        self.sure = tuple(  # what never succeeds
            number
            for number, outcomes in enumerate(structure.constraints.allowed)
            if Outcome.SUCCEEDED not in outcomes
        )

    @cached_property
    def plain(self) -> Lanes:
        """The one run in which nothing fails but what must."""
        return Lanes(self.automaton, 1, dict.fromkeys(self.sure, 1), {}, {})

    def lane(
        self,
        failing: Iterable[int],
        *,
        held: Iterable[int] = (),
        saved: Block | None = None,
        spared: int | None = None,
    ) -> int:
        """The number of the scenario in which these fail, and the outcomes of those never come.

        ``saved``: the units of this block succeed in place of failing; ``spared``: so does this
        instance, even if it never does. What may succeed and is not named does.
        """
        fails = {*failing, *self.sure} - {spared}
        scenario = _Scenario(tuple(sorted(fails)), tuple(held), saved)
        number = self._numbers.get(scenario)
        if number is None:
            number = self._numbers[scenario] = len(self._scenarios)
            self._scenarios.append(scenario)
        return number

    def expect(
        self,
        lane: int,
        *,
        happens: Sequence[Signal] = (),
        triggered: Sequence[int] = (),
        absent: Sequence[int] = (),
        failures: int | None = None,
    ) -> None:
        """Expect events, nodes that are triggered, nodes that are not, a number of failures."""
        expected = _Expected(self.analysis, lane, happens, triggered, absent, failures, None)
        self._expected.append(expected)

    def expect_before(self, lane: int, other: int, nodes: Sequence[int]) -> None:
        """Expect of nodes that are triggered in one lane that they are in the other one, too."""
        before = other, nodes
        self._expected.append(_Expected(self.analysis, lane, (), (), (), None, before))

    @property
    def cost(self) -> int:
        """The nodes that are looked at for all of them."""
        return len(self.automaton.nodes) * -(-len(self._scenarios) // _AT_ONCE)

    def missed(self) -> set[str]:
        """The analyses of which some run does not show what it should."""
        batches: dict[int, list[_Expected]] = {}
        for expected in self._expected:
            batches.setdefault(expected.lane // _AT_ONCE, []).append(expected)
            if expected.before is not None:
                batches.setdefault(expected.before[0] // _AT_ONCE, []).append(expected)
        missed: set[str] = set()
        earlier: dict[int, frozenset[int]] = {}  # by lane the nodes asked about that are triggered
        for batch, group in sorted(batches.items()):
            play = self._play(batch * _AT_ONCE)
            for expected in group:
                if expected.before is None:
                    if not self._shows(play, expected):
                        missed.add(expected.analysis)
                    continue
                for lane in (expected.lane, expected.before[0]):
                    if lane // _AT_ONCE == batch:
                        earlier[lane] = _triggered(play, lane % _AT_ONCE, expected.before[1])
        for expected in self._expected:
            if expected.before is not None:
                other, nodes = expected.before
                if not earlier[expected.lane].intersection(nodes) <= earlier[other]:
                    missed.add(expected.analysis)
        return missed

    @staticmethod
    def _shows(play: Lanes, expected: _Expected) -> bool:
        bit, triggered = 1 << expected.lane % _AT_ONCE, play.triggered
        return (
            all(play.happens(signal) & bit for signal in expected.happens)
            and all(triggered[node] & bit for node in expected.triggered)
            and not any(triggered[node] & bit for node in expected.absent)
            and (expected.failures is None or play.failures(bit) == expected.failures)
        )

    def _play(self, first: int) -> Lanes:
        scenarios = self._scenarios[first : first + _AT_ONCE]
        failing: dict[int, int] = {}
        held: dict[int, int] = {}
        saved: dict[Signal, list[tuple[Signal, int]]] = {}
        for place, scenario in enumerate(scenarios):
            bit = 1 << place
            for number in scenario.failing:
                failing[number] = failing.get(number, 0) | bit
            for number in scenario.held:
                held[number] = held.get(number, 0) | bit
            for success, failure in scenario.saved.units if scenario.saved is not None else ():
                if success is not None and failure is not None:
                    saved.setdefault(failure, []).append((success, bit))
        pairs = {failure: tuple(each) for failure, each in saved.items()}
        return Lanes(self.automaton, len(scenarios), failing, held, pairs)


def _triggered(play: Lanes, place: int, nodes: Sequence[int]) -> frozenset[int]:
    """Those of the nodes that are triggered in a lane."""
    return frozenset(node for node in nodes if play.triggered[node] >> place & 1)


class Lanes:
    """The runs of ``count`` scenarios.

    ``failing`` and ``held``: per runner number the lanes in which it fails, and in which its
    outcome never comes; all others succeed. ``saved``: per failure signal of a unit its success
    signal and the lanes in which that comes in its place.
    """

    def __init__(
        self,
        automaton: Automaton,
        count: int,
        failing: Mapping[int, int],
        held: Mapping[int, int],
        saved: Mapping[Signal, tuple[tuple[Signal, int], ...]],
    ) -> None:
        self._automaton = automaton
        self._all = (1 << count) - 1
        self._failing = failing
        self._held = held
        self._saved = saved
        self._gained: dict[Signal, list[tuple[Signal, int]]] = {}
        for failure, pairs in saved.items():
            for success, lanes in pairs:
                self._gained.setdefault(success, []).append((failure, lanes))
        self.triggered = [0] * len(automaton.nodes)
        self.triggered[0] = self._all
        nodes, inputs = automaton.nodes, automaton.inputs
        for node in automaton.order:
            if inputs[node]:
                came = [self.happens(signal) for signal in inputs[node]]
                self.triggered[node] = at_least(nodes[node].need or 1, came)

    def happens(self, signal: Signal) -> int:
        """The lanes in which the event happens."""
        lanes = self._plain(signal)
        if self._saved:
            for _, saved in self._saved.get(signal, ()):
                lanes &= ~saved
            for failure, saved in self._gained.get(signal, ()):
                lanes |= self._plain(failure) & saved
        return lanes

    def _plain(self, signal: Signal) -> int:
        node, event = signal
        triggered = self.triggered[node]
        if self._automaton.nodes[node].kind is not NodeKind.RUNNER:
            return triggered if event is Event.SUCCEEDED else 0
        if event is Event.STARTED:
            return triggered
        number = node - 1
        failing = self._failing.get(number, 0)
        came = failing if event is Event.FAILED else ~failing
        return triggered & came & ~self._held.get(number, 0)

    def failures(self, bit: int) -> int:
        """The number of FAILED events in a lane, of which this is the bit."""
        return sum(
            bool(self.triggered[number + 1] & failing & ~self._held.get(number, 0) & bit)
            for number, failing in self._failing.items()
        )


def at_least(need: int, lanes: Sequence[int]) -> int:
    """The lanes in which so many of these come; counted in binary, a number per digit."""
    if need == 1:
        return _union(lanes)
    if need == len(lanes):
        result = lanes[0]
        for each in lanes:
            result &= each
        return result
    if need > len(lanes):
        return 0
    digits: list[int] = []
    for each in lanes:
        carry = each
        for place, digit in enumerate(digits):
            digits[place], carry = digit ^ carry, digit & carry
        if carry:
            digits.append(carry)
    greater, equal = 0, -1  # compared with the need from the highest digit on
    assert 0 < need < len(lanes)
    for place in reversed(range(max(len(digits), need.bit_length()))):
        digit = digits[place] if place < len(digits) else 0
        if need >> place & 1:
            equal &= digit
        else:
            greater |= equal & digit
            equal &= ~digit
    return greater | equal


def _union(lanes: Iterable[int]) -> int:
    result = 0
    for each in lanes:
        result |= each
    return result
