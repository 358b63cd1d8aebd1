"""Thousands of runs at once: each is a bit of the numbers that are computed (a *lane*).

One pass in topological order computes for each node the lanes in which it is triggered, with an
operation per connection whatever the number of lanes. It is an evaluator of its own, which shares
no code with the one that replays what is shown.

    A in a guard with B; lane 0: nothing fails, lane 1: A fails, lane 2: A and B fail
    A triggered in 111, fails in 110; B triggered in 110, fails in 100: the plan gives up in lane 2
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import Event

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from gpsfsm.model.automaton import Automaton


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
