"""The fewest failures that have come when a plan gives up: how much can go wrong before it does.

Only failures that come no later than the give-up count (semantics, 5.1). So the question is not
which scenario has the fewest failures, but which failures the give-up itself needs: all others
can come later, since durations are free. In a parallel_all of A and B, of which one fails exactly
if the other does, the first failure gives up the plan, whichever it is. The number is 1, though
every run that gives up has 2 failures. In a parallel_any of the same two it is 2.

Both deciders play a run in which some failures are *held back*, as if they never came. Events only
ever cause others, so what happens then also happens if they come; and they can be made to come as
late as one likes. The number is therefore the least number of failures that are not held back in a
run that gives up all the same. Successes are never held back: they cost nothing.

- *Structure.* What a unit needs for an end is in the unit itself. The failures of a sequential
  control are those of one child and what the successes before it take; a parallel that fails with
  k failures needs its k cheapest children, and waits for none of the others.
- *z3.* A variant of the run has a choice ``f7`` for each instance: its FAILED comes. It may only
  where the instance is triggered in the variant and fails in the scenario. The fewest such choices
  with which the variant gives up are the answer. A failure that leads to several joins is one
  choice, so it counts once, and a join of need k takes the k inputs that are cheapest together.

For example, ``par_all(seq(A, B), par_any(B, B))`` with the same action B three times: z3 finds the
scenario in which all B fail, lets the first one's FAILED come and holds the other two back. A has
succeeded, the sequence fails, and with it the parallel_all: 1.
"""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING, Any, NamedTuple

from gpsfsm.analysis import counterexamples
from gpsfsm.analysis.decisions import Analysis
from gpsfsm.analysis.deviations import successes_needed
from gpsfsm.analysis.encode import FALSE
from gpsfsm.analysis.proof.refutation import Refutation, UnprovedError
from gpsfsm.compile import UnitKind
from gpsfsm.errors import InternalError
from gpsfsm.model.automaton import Signal
from gpsfsm.model.event import Event

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from gpsfsm.analysis.proof.witnesses import Witnesses
    from gpsfsm.analysis.solver import Solver
    from gpsfsm.analysis.structure import Structure
    from gpsfsm.compile import Compiled

Answer = int | None
"""The fewest FAILED events that have come when a run gives up; None if none does."""


class _Unit(NamedTuple):
    """The fewest failures inside a unit that have come when it ends so; infinite: it cannot."""

    success: float
    failure: float


def by_structure(structure: Structure) -> Answer:
    """Sums over what must come together, minima over what may come alone."""
    fewest = _costs(structure)[0].failure
    return None if fewest == inf else int(fewest)


def _costs(structure: Structure) -> list[_Unit]:
    """The fewest failures of each unit."""
    units = structure.units
    costs = [_Unit(0, inf)] * len(units)
    for unit in reversed(range(len(units))):
        children = [costs[child] for child in units.children[unit]]
        kind = units.kinds[unit]
        if kind is UnitKind.RUNNER:
            success = 0 if structure.can_succeed[unit] else inf
            costs[unit] = _Unit(success, 1 if structure.can_fail[unit] else inf)
        elif kind is UnitKind.NOT:
            costs[unit] = _exchanged(children[0])
        elif kind is UnitKind.BRANCH:
            costs[unit] = _branch(*children)
        elif kind is UnitKind.SEQUENCE:
            costs[unit] = _sequence(children)
        elif kind in (UnitKind.GUARD, UnitKind.DEAD):
            costs[unit] = _exchanged(_sequence([_exchanged(child) for child in children]))
        else:
            waits = kind is UnitKind.WAIT
            costs[unit] = _parallel(children, successes_needed(units, unit), waits=waits)
        assert (costs[unit].success < inf) is structure.can_succeed[unit]
        assert (costs[unit].failure < inf) is structure.can_fail[unit]
    return costs


def _exchanged(unit: _Unit) -> _Unit:
    return _Unit(unit.failure, unit.success)


def _sequence(children: Sequence[_Unit]) -> _Unit:
    """Each child after the success of the one before; it fails with the first that fails."""
    success, failure = 0.0, inf
    for child in children:
        failure = min(failure, success + child.failure)
        success += child.success
    return _Unit(success, failure)


_FAILS = _Unit(inf, 0)


def _branch(condition: _Unit, then: _Unit, otherwise: _Unit = _FAILS) -> _Unit:
    return _Unit(
        *(
            min(condition.success + one, condition.failure + other)
            for one, other in zip(then, otherwise, strict=True)
        )
    )


def _parallel(children: Sequence[_Unit], needed: int, *, waits: bool) -> _Unit:
    """It ends with enough successes, or failures, unless it ``waits`` for all its children."""
    failures = len(children) - needed + 1
    exchanged = [_exchanged(child) for child in children]
    successes_of = _all_ended if waits else _first
    return _Unit(successes_of(children, needed), successes_of(exchanged, failures))


def _first(children: Sequence[_Unit], needed: int) -> float:
    """The fewest failures with which so many children succeed; the others have not ended."""
    if needed > len(children):
        return inf
    return sum(sorted(child.success for child in children)[:needed])


def _all_ended(children: Sequence[_Unit], needed: int) -> float:
    """The fewest failures with which all children end, and at least so many succeed."""
    wanted = needed - sum(child.success <= child.failure for child in children)
    more = sorted(
        child.success - child.failure for child in children if child.success > child.failure
    )
    if wanted > len(more):
        return inf
    return sum(map(min, children)) + sum(more[: max(wanted, 0)])


def by_solver(solver: Solver) -> Answer:
    """Bound the number of failures that come lower and lower."""
    encoding, automaton = solver.encoding, solver.automaton
    if not solver.decide([encoding.triggered(automaton.give_up)])[0]:
        return None
    failures = {
        Signal(node.index, Event.FAILED): f"f{number}"
        for number, node in enumerate(automaton.runners)
        if encoding.happens(Signal(node.index, Event.FAILED)) != FALSE
    }
    before = encoding.variant(failures)
    solver.tell(before.definitions)
    solver.tell(
        f"(=> {comes} (and {before.triggered(node)} "
        f"{encoding.emits_failed(automaton.runner_number(node))}))"
        for (node, _), comes in failures.items()
    )
    choices = list(failures.values())

    def count() -> int:
        number = solver.holding(choices)
        outcomes = solver.outcomes()
        assert number <= solver.evaluator.run(outcomes.__getitem__).failures
        return number

    goal = solver.name(before.triggered(automaton.give_up))
    fewest = counterexamples.fewest(solver, goal, choices, count)
    assert fewest is not None, "a run gives up, and so it does where no failure is held back"
    return fewest


def facts(answer: Answer, compiled: Compiled) -> Mapping[str, Any]:
    """The fact ``fewest_failures_to_give_up``."""
    del compiled
    return {"fewest_failures_to_give_up": answer}


def refute(answer: Answer, refutation: Refutation) -> None:
    """Each of so many classes of failures, no two with an instance in common, has to come.

    Where each of ``answer`` classes is needed, a give-up takes as many failures.
    """
    if answer is None:
        refutation.never(refutation.gave_up)
    if not answer:
        return
    structure = refutation.structure
    if not (structure.units.plain and structure.constraints.independent):
        raise UnprovedError  # successes that take failures are no matter of classes
    spans = spans_of(structure, answer)
    classes = {
        number: spans[unit][0] for number, unit in enumerate(structure.unit_of) if unit in spans
    }
    if {*classes.values()} != {*range(answer)}:
        raise InternalError("a class of failures has no member: no failure of it is needed")
    spared = refutation.spared(classes)
    refutation.never(spared.fired[refutation.automaton.give_up])


def spans_of(structure: Structure, number: int) -> dict[int, tuple[int, int]]:
    """Per unit the classes of failures, [first, last + 1), of which it needs one each to fail.

    Units of which one failure is enough share the classes of the unit around them, others divide
    them; an instance has one class. There are so many classes as the plan takes failures.

        parallel_any(A, sequence(B, C))     2 failures; A has class 0, B and C have class 1
    """
    units, costs = structure.units, _costs(structure)
    if number > costs[0].failure:
        raise UnprovedError  # there are no so many
    spans = {0: (0, number)}
    for unit in range(len(units)):
        if unit not in spans:
            continue
        low, high = spans[unit]
        able = [child for child in units.children[unit] if costs[child].failure < inf]
        divided = units.kinds[unit] in (UnitKind.GUARD, UnitKind.ANY)
        for child in able if costs[unit].failure < inf else ():
            end = min(high, low + int(costs[child].failure)) if divided else high
            if low < end:
                spans[child] = low, end
            low = end if divided else low
    _require_spans(structure, spans)
    return spans


def _require_spans(structure: Structure, spans: Mapping[int, tuple[int, int]]) -> None:
    """Raise InternalError unless no unit fails without a failure of each of its classes.

    That is so if it has a single class and is a runner, if each child that can fail has the same
    classes, or, where all children have to fail, if these have its classes between them.
    """
    for unit, (low, high) in spans.items():
        kind, children = structure.units.kinds[unit], structure.units.children[unit]
        parts = [spans.get(child) for child in children if structure.can_fail[child]]
        if kind is UnitKind.RUNNER:
            right = high - low == 1
        elif kind in (UnitKind.GUARD, UnitKind.ANY):
            between = sorted(each for each in parts if each is not None)
            ends = [low, *(end for _, end in between)]
            right = [begin for begin, _ in between] == ends[:-1] and ends[-1] == high
        else:
            right = all(part == (low, high) for part in parts)
        if not right:
            raise InternalError("the classes of failures of a unit are not those of its parts")


def show(answer: Answer, witnesses: Witnesses) -> None:
    """A run that gives up with so many failures; those that it does not need never come."""
    if answer is None:
        return
    structure = witnesses.structure
    if witnesses.sure and not structure.units.plain:
        raise UnprovedError
    failing = frozenset(_needed(structure) if witnesses.sure else structure.failing(0))
    late = [number for number in witnesses.sure if number not in failing]
    lane = witnesses.lane(failing, held=late)
    witnesses.expect(lane, triggered=(witnesses.automaton.give_up,), failures=answer)


def _needed(structure: Structure) -> Iterator[int]:
    """The runners of a plan whose failures the give-up with the fewest of them takes.

    An end takes that end of all children, or else of a single child; in a row, the children before
    that have come to the other end.
    """
    units, costs = structure.units, _costs(structure)
    pending = [(0, False)]
    while pending:
        unit, succeeds = pending.pop()
        kind, children = units.kinds[unit], units.children[unit]
        if kind is UnitKind.RUNNER and not succeeds:
            yield structure.number[unit]
        if succeeds is (kind in (UnitKind.SEQUENCE, UnitKind.ALL)):
            pending += ((child, succeeds) for child in children)
        elif children:
            before = children if kind in (UnitKind.SEQUENCE, UnitKind.GUARD) else ()
            prices = [
                costs[child][not succeeds] + sum(costs[other][succeeds] for other in before[:place])
                for place, child in enumerate(children)
            ]
            best = prices.index(min(prices))
            pending += ((other, not succeeds) for other in before[:best])
            pending.append((children[best], succeeds))


ANALYSIS = Analysis("fewest", by_structure, by_solver, facts, refute=refute, show=show)
