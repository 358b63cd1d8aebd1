"""Join deadlock: a parallel_all that waits for ever, and what that does to the plan."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from gpsfsm.analysis.claims import Claim
from gpsfsm.analysis.decisions import Analysis
from gpsfsm.analysis.decisions.dangling import Leads
from gpsfsm.analysis.encode import FALSE, conjunction, disjunction, negation
from gpsfsm.model.event import End
from gpsfsm.model.report import JoinDeadlock

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from gpsfsm.analysis.proof.refutation import Refutation
    from gpsfsm.analysis.proof.witnesses import Witnesses
    from gpsfsm.analysis.solver import Solver
    from gpsfsm.analysis.structure import Structure
    from gpsfsm.compile import Compiled
    from gpsfsm.model.automaton import Automaton, Block, Signal

Effect = Literal["escalated", "absorbed", "give_up", "stuck"]


class Deadlock(NamedTuple):
    """``block`` is the index in ``Automaton.blocks``."""

    block: int
    effect: Effect


Answer = tuple[Deadlock, ...]


def by_structure(structure: Structure) -> Answer:
    """A join waits if some unit can fail; that ends the plan if nothing around it saves it."""
    automaton = structure.compiled.automaton
    leads = Leads(automaton)
    deadlocks = []
    for index, block in enumerate(automaton.blocks):
        unit = structure.unit_of_element[block.element]
        if not structure.reached[unit] or not structure.can_fail[unit]:
            continue
        effect: Effect = "give_up" if structure.fails_plan[unit] else "absorbed"
        deadlocks.append(Deadlock(index, "escalated" if leads.to_runner(block.failure) else effect))
    return tuple(deadlocks)


def by_solver(solver: Solver) -> Answer:
    """Ask for a run in which the join waits, then for what that run comes to."""
    automaton = solver.automaton
    leads = Leads(automaton)
    waits = questions(solver)
    waiting = solver.decide(waits)
    open_blocks = [
        index
        for index, block in enumerate(automaton.blocks)
        if waiting[index] and not leads.to_runner(block.failure)
    ]
    encoding = solver.encoding
    nowhere = encoding.ending(End.STUCK if automaton.traits.gives_up else End.HANG)
    stuck = solver.decide([conjunction((waits[index], nowhere)) for index in open_blocks])
    give_up = solver.decide(
        [
            conjunction(
                (
                    waits[index],
                    solver.encoding.triggered(automaton.give_up),
                    _saved(solver, automaton.blocks[index]),
                )
            )
            for index in open_blocks
        ]
    )
    effects: dict[int, Effect] = {
        index: "stuck" if is_stuck else "give_up" if gives_up else "absorbed"
        for index, is_stuck, gives_up in zip(open_blocks, stuck, give_up, strict=True)
    }
    return tuple(
        Deadlock(index, effects.get(index, "escalated"))
        for index, waits in enumerate(waiting)
        if waits
    )


def questions(solver: Solver) -> list[str]:
    """True if the join waits, for each block."""
    return [_waits(solver, block) for block in solver.automaton.blocks]


def _waits(solver: Solver, block: Block) -> str:
    """The block was triggered and its join never fires."""
    triggered = solver.encoding.happens(block.trigger)
    return conjunction((triggered, negation(solver.encoding.triggered(block.join))))


def _saved(solver: Solver, block: Block) -> str:
    """Had the block's failing units succeeded, in the same scenario, the plan would not give up."""
    encoding = solver.encoding
    changed: dict[Signal, str] = {}
    for success, failure in block.units:
        if failure is None or success is None:
            continue
        changed[success] = disjunction((encoding.happens(success), encoding.happens(failure)))
        changed[failure] = FALSE
    variant = encoding.variant(changed)
    solver.tell(variant.definitions)
    return negation(variant.triggered(solver.automaton.give_up))


def facts(answer: Answer | None, compiled: Compiled) -> Mapping[str, Any]:
    """The fact ``join_deadlocks``."""
    automaton = compiled.automaton
    return {
        "join_deadlocks": tuple(
            JoinDeadlock(automaton.plan.path(automaton.blocks[index].element), effect)
            for index, effect in answer or ()
        )
    }


def deadlock_claim(automaton: Automaton, deadlock: Deadlock) -> Claim:
    """The join waits for ever, with the effect that was found."""
    block = automaton.blocks[deadlock.block]
    happens = () if block.trigger is None or block.trigger.node == 0 else (block.trigger,)
    stuck = End.STUCK if automaton.traits.gives_up else End.HANG
    ends = {"give_up": End.GAVE_UP, "stuck": stuck}.get(deadlock.effect)

    def failing(structure: Structure) -> Iterator[int]:
        unit = structure.unit_of_element[block.element]
        yield from structure.failing(unit)
        if deadlock.effect == "give_up":
            yield from structure.failing_around(unit)
        else:
            yield from structure.failing_before(unit)

    return Claim(
        happens=happens,
        absent=(block.join,),
        ends=ends,
        more=(lambda solver: _saved(solver, block)) if deadlock.effect == "give_up" else None,
        failing=failing,
    )


def refute(answer: Answer, refutation: Refutation) -> None:
    """The other joins fire, and what is absorbed is not what makes the plan give up."""
    circuit, snapshot = refutation.circuit, refutation.snapshot
    blocks, effects = refutation.automaton.blocks, dict(answer)
    waits = [circuit.all((snapshot.happens(b.trigger), -snapshot.fired[b.join])) for b in blocks]
    for index, waiting in enumerate(waits):
        if index not in effects:
            refutation.never(circuit.all((refutation.over, waiting)))
    absorbed = {index: circuit.fresh() for index, each in answer if each == "absorbed"}
    if absorbed:
        refutation.at_most_one(absorbed.values())
        saved = refutation.saved({blocks[index]: flip for index, flip in absorbed.items()})
        lost = refutation.over, refutation.gave_up, -saved.fired[refutation.automaton.give_up]
        chosen = (circuit.all((flip, waits[index])) for index, flip in absorbed.items())
        refutation.never(circuit.all((*lost, circuit.any(chosen))))


def show(answer: Answer, witnesses: Witnesses) -> None:
    """A run in which the join waits, and where that is its effect, its twin that is saved."""
    automaton = witnesses.automaton
    for deadlock in answer:
        block = automaton.blocks[deadlock.block]
        claim = deadlock_claim(automaton, deadlock)
        failing = frozenset(claim.failing(witnesses.structure))
        ends = (automaton.give_up,) if deadlock.effect == "give_up" else ()
        lane = witnesses.lane(failing)
        witnesses.expect(lane, happens=claim.happens, triggered=ends, absent=(block.join,))
        if ends:
            witnesses.expect(witnesses.lane(failing, saved=block), absent=ends)


ANALYSIS = Analysis("joins", by_structure, by_solver, facts, questions, refute, show)
