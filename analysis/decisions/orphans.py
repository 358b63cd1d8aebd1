"""Orphans: runner instances that can still be active when the plan completes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.claims import Claim
from gpsfsm.analysis.counterexamples import necessary, plainest
from gpsfsm.analysis.decisions import Analysis
from gpsfsm.analysis.encode import FALSE, conjunction, negation
from gpsfsm.analysis.proof.refutation import Refutation, UnprovedError
from gpsfsm.compile import UnitKind
from gpsfsm.model.automaton import Automaton, NodeKind
from gpsfsm.model.event import End, Event

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from gpsfsm.analysis.proof.witnesses import Witnesses
    from gpsfsm.analysis.solver import Solver
    from gpsfsm.analysis.structure import Structure
    from gpsfsm.analysis.timing.meeting import Clock
    from gpsfsm.analysis.timing.pairs import Instants
    from gpsfsm.compile import Compiled, Units

Answer = tuple[int, ...]
"""The numbers of the instances that some run leaves active at completion."""


def by_structure(structure: Structure) -> Answer:
    """Something beside it decides first, and it is triggered no later than the plan completes."""
    orphans = [
        number
        for number, unit in enumerate(structure.unit_of)
        if structure.outlived[unit] and not structure.late[unit]
    ]
    return _by_clock(structure.clock, orphans)


def by_solver(solver: Solver) -> Answer:
    """Ask for a run that completes although the outcome of the instance never comes."""
    numbers = [
        number
        for number in range(len(solver.automaton.runners))
        if _may_be_outlived(solver, number)
    ]
    shown = {number for number in numbers if _is_shown(solver, number)}
    open_ = [number for number in numbers if number not in shown]
    answers = solver.decide([_outlives(solver, number) for number in open_])
    shown.update(number for number, outlived in zip(open_, answers, strict=True) if outlived)
    return _by_clock(solver.clock, sorted(shown))


def _by_clock(clock: Instants | None, numbers: list[int]) -> Answer:
    """Those of the instances that are orphans with declared durations, too."""
    return tuple(number for number in numbers if clock is None or clock.outlives(number))


def _is_shown(solver: Solver, number: int) -> bool:
    """True if the plainest scenario already shows it."""
    if UnitKind.EMPTY in solver.compiled.units.kinds:
        return False  # the instance might be triggered too late
    outcomes = plainest(solver, number)
    if outcomes is None:
        return False
    run = solver.play().run(outcomes.__getitem__, withheld=(number,))
    node = solver.automaton.runner_node(number)
    return node in run.triggered and run.ends is End.COMPLETED


def _may_be_outlived(solver: Solver, number: int) -> bool:
    """True if completion may come without the instance's outcome, at the widest estimate."""
    needed = necessary(solver.automaton, solver.automaton.runner_node(number))
    run = solver.play().possibly(needed, withheld=(number,))
    return solver.automaton.complete in run.triggered


def _outlives(solver: Solver, number: int) -> str:
    """The instance is triggered in time, and the plan completes without its outcome."""
    encoding, automaton = solver.encoding, solver.automaton
    node = automaton.runners[number].index
    variant = solver.without([number])
    triggered = encoding.triggered(node)
    return conjunction(
        (triggered, variant.triggered(automaton.complete), negation(too_late(solver, number)))
    )


def too_late(solver: Solver, number: int) -> str:
    """The plan completes strictly before the instance can be triggered.

    That is so if it completes with nothing but the outcomes that trigger the instance, less the
    last of them. Only a parallel_any with an empty control in it can do that.
    """
    units, automaton = solver.compiled.units, solver.automaton
    if UnitKind.EMPTY not in units.kinds:
        return FALSE
    node = automaton.runners[number].index
    unit = units.elements.index(automaton.runners[number].origin)
    before = {units.elements[other] for other in _before(units, unit)}
    kept = {runner.index for runner in automaton.runners if runner.origin in before}
    kept.difference_update(_instant_causes(automaton, node))
    variant = solver.without(
        number for number, runner in enumerate(automaton.runners) if runner.index not in kept
    )
    return conjunction((variant.triggered(automaton.complete), negation(variant.triggered(node))))


def _instant_causes(automaton: Automaton, node: int) -> Iterator[int]:
    """The runners whose outcome triggers ``node`` at the instant at which it comes."""
    seen = {node}
    pending = [node]
    while pending:
        for source, event in automaton.inputs[pending.pop()]:
            kind = automaton.nodes[source].kind
            if kind is NodeKind.RUNNER and event is not Event.STARTED:
                yield source
            elif kind is not NodeKind.START and source not in seen:
                seen.add(source)
                pending.append(source)


def _before(units: Units, unit: int) -> Iterator[int]:
    """All units inside the units that must end so that ``unit`` is triggered."""
    while units.parents[unit] >= 0:
        parent = units.parents[unit]
        if units.kinds[parent] in (UnitKind.SEQUENCE, UnitKind.GUARD, UnitKind.BRANCH):
            pending = list(units.children[parent][: units.positions[unit]])
            while pending:
                current = pending.pop()
                yield current
                pending.extend(units.children[current])
        unit = parent


def facts(answer: Answer | None, compiled: Compiled) -> Mapping[str, Any]:
    """The fact ``orphans``."""
    plan = compiled.automaton.plan
    return {"orphans": tuple(plan.path(plan.runners[number]) for number in answer or ())}


def orphan_claim(clock: Clock | None, number: int) -> Claim:
    """A run that completes while the instance is active; ``clock`` is that of the plan."""
    if clock is not None:
        return Claim(
            ends=End.COMPLETED,
            outlives=number,
            more=lambda solver: clock.outliving(solver, number),
            failing=lambda structure: structure.failing_to_outlive(structure.unit_of[number]),
            shows=lambda _, outcome_of: clock.shows_outliving(outcome_of, number),
            through=clock.with_clocks,
        )
    return Claim(
        ends=End.COMPLETED,
        outlives=number,
        more=lambda solver: _outlives(solver, number),
        failing=lambda structure: structure.failing_to_outlive(structure.unit_of[number]),
    )


def refute(answer: Answer, refutation: Refutation) -> None:
    """The plan never completes while one of the others is active, whatever the durations.

    Which of them declared durations leave out, z3 has said already.
    """
    structure, timed = refutation.structure, refutation.structure.clock is not None
    _require_simple(structure)
    orphans = frozenset(answer)
    safe = (
        number
        for number, unit in enumerate(structure.unit_of)
        if number not in orphans and not (timed and structure.outlived[unit])
    )
    active = refutation.circuit.any(map(refutation.active, safe))
    refutation.never(refutation.circuit.all((refutation.completed, active)))


def show(answer: Answer, witnesses: Witnesses) -> None:
    """A run that completes though the outcome of the instance never comes."""
    structure, automaton = witnesses.structure, witnesses.automaton
    _require_simple(structure)
    for number in answer:
        failing = structure.failing_to_outlive(structure.unit_of[number])
        nodes = automaton.runner_node(number), automaton.complete
        witnesses.expect(witnesses.lane(failing, held=(number,)), triggered=nodes)


def _require_simple(structure: Structure) -> None:
    """Raise UnprovedError where an instance may be triggered too late."""
    if UnitKind.EMPTY in structure.units.kinds:
        raise UnprovedError


ANALYSIS = Analysis("orphans", by_structure, by_solver, facts, refute=refute, show=show)
