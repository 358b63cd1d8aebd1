"""Loading: how many different runners are needed at one instant (semantics, section 8.6)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.counterexamples import plainest
from gpsfsm.analysis.decisions import Analysis
from gpsfsm.analysis.encode import FALSE, TRUE, conjunction, disjunction, negation
from gpsfsm.analysis.solver import InconclusiveError, Solver
from gpsfsm.analysis.timing.loads import UNKNOWN, most_at_once
from gpsfsm.compile import UnitKind
from gpsfsm.late import dataclass
from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import End, Event, Outcome
from gpsfsm.model.report import Loaded

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from gpsfsm.analysis.structure import Structure
    from gpsfsm.compile import Compiled
    from gpsfsm.model.automaton import Automaton

_RLIMIT = 500_000
"""z3 steps per question: about a tenth of a second."""

_MAX_RUNNERS = 1000
"""Up to here z3 is asked, with a second copy of the run, for a fact of little weight."""


@dataclass(frozen=True, eq=False)
class Answer:
    """``peak`` is UNKNOWN where a decider has reached its limit; that contradicts no number."""

    peak: int
    all: int

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Answer):
            return NotImplemented
        same = self.peak == other.peak or UNKNOWN in (self.peak, other.peak)
        return same and self.all == other.all

    __hash__ = None  # type: ignore[assignment]  # as equality is not transitive


def by_structure(structure: Structure) -> Answer:
    """The loads that can be active at once in the units, from the leaves to the plan."""
    pairs, kinds = _pairs(structure.compiled)
    reached = {
        pairs[number] for number, unit in enumerate(structure.unit_of) if structure.reached[unit]
    }
    if len(reached) <= 1:
        return Answer(len(reached), kinds)
    parallels = (UnitKind.ALL, UnitKind.ANY, UnitKind.COUNT, UnitKind.WAIT)
    parallel = any(kind in parallels for kind in structure.units.kinds)
    return Answer(most_at_once(structure, pairs, len(reached)) if parallel else 1, kinds)


def by_solver(solver: Solver) -> Answer:
    """Ask for instants at which more and more different runners are needed."""
    automaton = solver.automaton
    pairs, kinds = _pairs(solver.compiled)
    terms = [solver.encoding.triggered(node.index) for node in automaton.runners]
    if kinds > 1 and len(terms) > _MAX_RUNNERS:
        return Answer(UNKNOWN, kinds)
    try:
        reached = sorted(
            {pair for pair, can in zip(pairs, solver.decide(terms), strict=True) if can}
        )
        if len(reached) <= 1 or _one_by_one(automaton):
            return Answer(min(len(reached), 1), kinds)
        low = _side_by_side(solver, pairs)
        if low == len(reached):
            return Answer(low, kinds)
        rlimit = min(_RLIMIT, solver.rlimit)
        fresh = Solver(solver.compiled, solver.constraints, rlimit=rlimit, purse=solver.purse)
        peak = _search(fresh, pairs, reached, low)
        return Answer(peak, kinds)
    except InconclusiveError:
        return Answer(UNKNOWN, kinds)


def _pairs(compiled: Compiled) -> tuple[list[int], int]:
    """For each instance the number of its interface and provider, and how many there are."""
    numbers: dict[tuple[str, str], int] = {}
    pairs = [
        numbers.setdefault((runner.interface, runner.provider), len(numbers))
        for runner in compiled.automaton.plan.runners
    ]
    return pairs, len(numbers)


def _one_by_one(automaton: Automaton) -> bool:
    """True if no event triggers two nodes, so that one instance is active at a time."""
    return all(
        len(targets) == 1 and signal.event is not Event.STARTED
        for signal, targets in automaton.outputs.items()
    )


# -- z3 -------------------------------------------------------------------------------------


def _side_by_side(solver: Solver, pairs: Sequence[int]) -> int:
    """The most different runners that one event triggers, as the evaluator shows; 1 if none."""
    automaton = solver.automaton
    forks: list[list[int]] = []
    for targets in automaton.outputs.values():
        numbers = [
            automaton.runner_number(node)
            for node in targets
            if automaton.nodes[node].kind is NodeKind.RUNNER
        ]
        if len(numbers) > 1:
            forks.append(numbers)
    if not forks:
        return 1
    numbers = max(forks, key=lambda numbers: len({pairs[number] for number in numbers}))
    outcomes = plainest(solver, numbers[0])
    if outcomes is None:
        return 1
    run = solver.evaluator.run(outcomes.__getitem__, withheld=numbers)
    if run.ends is not End.STUCK:
        return 1
    return len({pairs[n] for n in numbers if automaton.runner_node(n) in run.triggered}) or 1


def _search(solver: Solver, pairs: Sequence[int], reached: Sequence[int], low: int) -> int:
    """The peak, which is at least ``low``."""
    active, timely = _instant(solver)
    of_pair: dict[int, list[str]] = {pair: [] for pair in reached}
    for number, pair in enumerate(pairs):
        if pair in of_pair:
            of_pair[pair].append(active[number])
    needed = [disjunction(terms) for terms in of_pair.values()]

    def possible(count: int) -> bool:
        goal = f"((_ at-least {count}) {' '.join(needed)})"
        return solver.must_check([solver.name(conjunction((timely, goal)))])

    high, step = len(needed), 1
    while low < high:  # the peak is mostly small, so begin there
        middle = min(low + step, high)
        if possible(middle):
            low, step = middle, step * 2
        elif step == 1:
            break
        else:
            high, step = middle - 1, 1
    return low


def _instant(solver: Solver) -> tuple[list[str], str]:
    """An instant of a run: per instance "is active", and "the run has not ended before".

    Which outcomes have come by then is free: ``w7`` holds that of instance 7 back. Only where a
    unit can end at the instant of its trigger does it matter that the very last outcomes, ``x7``,
    come together and end the run: what they trigger is active at the instant of the end.
    """
    encoding, automaton = solver.encoding, solver.automaton
    size = len(automaton.runners)
    waiting = [negation(f"w{number}") for number in range(size)]
    before = _State(solver, "a", waiting.__getitem__)
    over = disjunction(before.triggered(node) for node in (automaton.complete, automaton.give_up))
    hangs = [encoding.outcome(number, (Outcome.HANG,)) for number in range(size)]
    if UnitKind.EMPTY not in solver.compiled.units.kinds:
        active = [
            conjunction((before.triggered(node.index), disjunction((f"w{number}", hangs[number]))))
            for number, node in enumerate(automaton.runners)
        ]
        return active, negation(over)

    def come(number: int) -> str:
        came = disjunction((waiting[number], f"x{number}"))
        return conjunction((before.triggered(automaton.runner_node(number)), came))

    after = _State(solver, "b", come)
    active = [
        conjunction(
            (after.triggered(node.index), disjunction((negation(come(number)), hangs[number])))
        )
        for number, node in enumerate(automaton.runners)
    ]
    none_yet = conjunction(
        term for number in range(size) for term in (f"w{number}", negation(f"x{number}"))
    )
    return active, disjunction((negation(over), none_yet))


class _State:
    """The nodes triggered by some instant; ``come`` tells whether an outcome has come."""

    def __init__(self, solver: Solver, letter: str, come: Callable[[int], str]) -> None:
        self._solver = solver
        self._letter = letter
        self._come = come
        automaton = solver.automaton
        for node, inputs in enumerate(automaton.inputs):
            if inputs:
                terms = [self._happens(signal) for signal in inputs]
                solver.tell([f"(= {letter}{node} {solver.encoding.fires(node, terms)})"])

    def triggered(self, node: int) -> str:
        return f"{self._letter}{node}" if self._solver.automaton.inputs[node] else FALSE

    def _happens(self, signal: Signal) -> str:
        encoding, automaton = self._solver.encoding, self._solver.automaton
        kind, triggered = automaton.nodes[signal.node].kind, self.triggered(signal.node)
        if kind is NodeKind.START:
            return TRUE
        if kind is not NodeKind.RUNNER:
            return triggered if signal.event is Event.SUCCEEDED else FALSE
        if signal.event is Event.STARTED and signal.node in automaton.traits.silent:
            return FALSE
        number = automaton.runner_number(signal.node)
        if signal.event is Event.STARTED:
            return conjunction((triggered, negation(encoding.outcome(number, (Outcome.NO_START,)))))
        if signal.event is Event.SUCCEEDED:
            outcome = encoding.succeeds(number)
        else:
            outcome = encoding.emits_failed(number)
        return conjunction((triggered, outcome, self._come(number)))


def facts(answer: Answer | None, compiled: Compiled) -> Mapping[str, Any]:
    """The fact ``loaded``."""
    kinds = _pairs(compiled)[1] if answer is None else answer.all
    peak = None if answer is None or answer.peak == UNKNOWN else answer.peak
    return {"loaded": Loaded(peak, kinds)}


ANALYSIS = Analysis(
    "loading", by_structure, by_solver, facts, matters=lambda _: False, compared=False
)
