"""Clocks: how long a run takes, exactly and for z3 (semantics, section 8.5).

With fixed outcomes every time is a sum of durations, or the first or the last of other times. So
it grows with each duration, and the bounds of the durations give the bounds of the times. z3
searches the outcomes; what a scenario comes to is computed here and not read from a model.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal

from gpsfsm.analysis.encode import FALSE, conjunction, disjunction, negation
from gpsfsm.analysis.solver import Solver
from gpsfsm.analysis.timing.amounts import UNBOUNDED, Number, plus
from gpsfsm.model.automaton import Automaton, NodeKind, Signal
from gpsfsm.model.event import Event, Outcome

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.analysis.encode import Encoding, Variant
    from gpsfsm.analysis.evaluate import Run

Sense = Literal["earliest", "latest", "exact"]
"""The ties of clocks: from below, from above, or both."""

_REAL = frozenset("cd")
_NONE: Mapping[int, str] = {}


class RealSolver(Solver):
    """A z3 problem that also has real numbers: clocks ``c7`` (of nodes), durations ``d7``."""

    LOGIC = "QF_LRA"

    def __init__(self, other: Solver, *, rlimit: int | None = None) -> None:
        rlimit = other.rlimit if rlimit is None else rlimit
        super().__init__(other.compiled, other.constraints, rlimit=rlimit, purse=other.purse)

    def sort(self, name: str) -> str:
        """Real for clocks and durations."""
        return "Real" if name[0] in _REAL else "Bool"


def times(automaton: Automaton, run: Run, duration: Callable[[int], Number]) -> dict[int, Number]:
    """The time at which each node of a run is triggered; UNBOUNDED: not while outcomes wait.

    ``duration`` is that of an instance by its number.
    """
    instants: dict[int, Number] = {}
    for node in automaton.order:
        if node not in run.triggered:
            continue
        arrivals = [
            arrival(automaton, instants, signal, duration)
            for signal in automaton.inputs[node]
            if run.happens(signal)
        ]
        need = automaton.nodes[node].need or 1
        instants[node] = sorted(arrivals)[need - 1]
    return instants


def arrival(
    automaton: Automaton,
    instants: Mapping[int, Number],
    signal: Signal,
    duration: Callable[[int], Number],
) -> Number:
    """The time at which an event happens, by the time at which its node is triggered."""
    kind = automaton.nodes[signal.node].kind
    if kind is NodeKind.START:
        return 0
    if kind is NodeKind.RUNNER and signal.event is not Event.STARTED:
        return plus(instants[signal.node], duration(automaton.runner_number(signal.node)))
    return instants[signal.node]


# -- bounds that hold whatever the outcomes are ---------------------------------------------


def earliest_bounds(
    automaton: Automaton, constraints: Constraints, duration: Sequence[Number]
) -> dict[int, Number]:
    """For each node that may be triggered a time before which it is not."""
    return _bounds(automaton, constraints, duration, min)


def latest_bounds(
    automaton: Automaton, constraints: Constraints, duration: Sequence[Number]
) -> dict[int, Number]:
    """For each node a time by which it is triggered, if it is; outcomes that wait never come."""
    return _bounds(automaton, constraints, duration, max)


def _bounds(
    automaton: Automaton,
    constraints: Constraints,
    duration: Sequence[Number],
    first: Callable[[list[Number]], Number],
) -> dict[int, Number]:
    """``first`` tells the time of the first of several, of which some may not happen."""
    instants: dict[int, Number] = {0: 0}  # start
    for node in automaton.order[1:]:
        inputs = automaton.inputs[node]
        arrivals = [
            arrival(automaton, instants, signal, duration.__getitem__)
            for signal in inputs
            if _possible(automaton, constraints, signal, instants)
        ]
        arrivals = [time for time in arrivals if time != UNBOUNDED]
        need = automaton.nodes[node].need or 1
        if len(arrivals) >= need:
            instants[node] = first(arrivals) if need == 1 else max(arrivals)
    return instants


def _possible(
    automaton: Automaton, constraints: Constraints, signal: Signal, instants: Mapping[int, Number]
) -> bool:
    kind = automaton.nodes[signal.node].kind
    if kind is not NodeKind.RUNNER:
        return kind is NodeKind.START or signal.node in instants
    if signal.node not in instants:
        return False
    allowed = constraints.allowed[automaton.runner_number(signal.node)]
    if signal.event is Event.SUCCEEDED:
        return Outcome.SUCCEEDED in allowed
    if signal.event is Event.FAILED:
        return bool(allowed & {Outcome.FAILED, Outcome.NO_START})
    return allowed != {Outcome.NO_START}


# -- terms ----------------------------------------------------------------------------------


class Clocks:
    """A clock ``c7`` for each node of a run, tied by ``definitions``.

    ``run`` says which events happen; ``durations[number]`` is a term. ``earliest`` clocks can take
    every value from the time at which the node is triggered on, ``latest`` ones every value up to
    it, ``exact`` ones that value alone; those of nodes that are not triggered are free.
    ``inside`` holds the nodes that may be triggered at all.
    """

    def __init__(
        self,
        automaton: Automaton,
        run: Encoding | Variant,
        durations: Sequence[str],
        *,
        sense: Sense,
        inside: Mapping[int, object],
    ) -> None:
        self._automaton = automaton
        self._run = run
        self._durations = durations
        self.definitions: list[str] = []
        for node in inside:
            signals = [
                signal
                for signal in automaton.inputs[node]
                if signal.node in inside and run.happens(signal) != FALSE
            ]
            if not signals:
                continue
            join = automaton.nodes[node].kind is NodeKind.JOIN
            if not join or len(signals) == 1:  # what is not triggered may have any time
                sign = {"earliest": ">=", "latest": "<=", "exact": "="}[sense]
                self.definitions += [
                    f"({sign} c{node} {self.arrival(signal)})" for signal in signals
                ]
            elif automaton.nodes[node].need == 1:
                self._first(node, signals, sense)
            else:
                self._last(node, signals, sense)

    def arrival(self, signal: Signal) -> str:
        """The time of an event."""
        kind = self._automaton.nodes[signal.node].kind
        if kind is NodeKind.START:
            return "0.0"
        if kind is NodeKind.RUNNER and signal.event is not Event.STARTED:
            number = self._automaton.runner_number(signal.node)
            return f"(+ c{signal.node} {self._durations[number]})"
        return f"c{signal.node}"

    def _first(self, node: int, signals: list[Signal], sense: Sense) -> None:
        if sense != "earliest":
            self.definitions += [
                disjunction(
                    (negation(self._run.happens(signal)), f"(<= c{node} {self.arrival(signal)})")
                )
                for signal in signals
            ]
        if sense != "latest":
            came = (
                conjunction((self._run.happens(signal), f"(>= c{node} {self.arrival(signal)})"))
                for signal in signals
            )
            self.definitions.append(disjunction((negation(self._run.triggered(node)), *came)))

    def _last(self, node: int, signals: list[Signal], sense: Sense) -> None:
        fires = self._run.triggered(node)
        if sense != "earliest":
            late = (f"(<= c{node} {self.arrival(signal)})" for signal in signals)
            self.definitions.append(disjunction((negation(fires), *late)))
        if sense != "latest":
            self.definitions += [
                disjunction((negation(fires), f"(>= c{node} {self.arrival(signal)})"))
                for signal in signals
            ]


def free_durations(
    ranges: Sequence[tuple[Number, Number]], unstarted: Mapping[int, str] = _NONE
) -> tuple[list[str], list[str]]:
    """A symbol ``d7`` per instance, and the assertions that keep it between its bounds.

    Every duration is positive. A greatest of 0 is as good as none in the whole units of the other
    bounds: all such durations together are shorter than one. ``unstarted`` says of instances that
    may not start when they do not: then they heed no least duration.
    """
    assertions: list[str] = []
    tiny = f"(/ 1.0 {1 + sum(most == 0 for _, most in ranges)}.0)"
    for number, (least, most) in enumerate(ranges):
        if number in unstarted or not least:
            assertions.append(f"(> d{number} 0.0)")
        if least:
            bound = f"(>= d{number} {least}.0)"
            excused = [unstarted[number]] if number in unstarted else []
            assertions.append(disjunction((*excused, bound)))
        if most != UNBOUNDED:
            assertions.append(f"(<= d{number} {f'{most}.0' if most else tiny})")
    return [f"d{number}" for number in range(len(ranges))], assertions


def unstarted(solver: Solver) -> dict[int, str]:
    """Of the instances that may not start, by their numbers, the terms that they do not."""
    return {
        number: solver.encoding.outcome(number, (Outcome.NO_START,))
        for number, outcomes in enumerate(solver.constraints.allowed)
        if Outcome.NO_START in outcomes
    }


def at_most(clock: str, number: Number) -> str:
    """The clock shows at most that."""
    return f"(<= {clock} {number}.0)" if number >= 0 else FALSE


# -- search ---------------------------------------------------------------------------------


def greatest(low: int, high: int, find: Callable[[int], int | None]) -> int:
    """The greatest value, which is at least ``low`` (some scenario has it) and at most ``high``.

    ``find`` looks for a scenario with at least a given value and tells its value, or None. It is
    asked for the very bound first, then in turn for the middle and for the least improvement:
    mostly one answer ends the search, and it never takes more than a logarithm of them.
    """
    if low >= high:
        return low
    reached = find(high)
    if reached is not None:
        return reached
    high -= 1
    careful = True
    while low < high:
        target = low + 1 if careful else (low + high + 1) // 2
        reached = find(target)
        if reached is not None:
            low = reached
        elif careful:
            return low
        else:
            high = target - 1
        careful = not careful
    return low
