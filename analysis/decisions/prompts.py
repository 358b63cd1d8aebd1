"""The prompt buffer: prompts that never reach the model, flushes of nothing, empty answers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from gpsfsm.analysis.claims import Claim
from gpsfsm.analysis.decisions import Analysis
from gpsfsm.analysis.encode import conjunction, disjunction, negation
from gpsfsm.analysis.flow import Prompts, knows, prompts_of
from gpsfsm.analysis.structure import Avoiding, Paths
from gpsfsm.model.automaton import Automaton, Signal
from gpsfsm.model.event import End, Event, Outcome

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from gpsfsm.analysis.encode import Encoding
    from gpsfsm.analysis.evaluate import Evaluator, OutcomeOf
    from gpsfsm.analysis.proof.refutation import Refutation
    from gpsfsm.analysis.proof.witnesses import Witnesses
    from gpsfsm.analysis.solver import Solver
    from gpsfsm.analysis.structure import Structure
    from gpsfsm.compile import Compiled


class EmptyAnswer(NamedTuple):
    """An instance that gets the answer of an instance (``source``) that only fills its buffer."""

    runner: int
    name: str
    source: int


class PromptFlow(NamedTuple):
    """Numbers of instances, in document order.

    ``unflushed`` fill a buffer that some run that completes never flushes afterwards;
    ``empty_flush`` flush one that in some run nothing has filled before.
    """

    unflushed: tuple[int, ...] = ()
    empty_flush: tuple[int, ...] = ()
    empty_answers: tuple[EmptyAnswer, ...] = ()


Answer = PromptFlow

_Pairs = Sequence[tuple[int, tuple[int, ...]]]
"""Instances, each with the others of its buffer that matter."""


class _Questions(NamedTuple):
    """A question to a decider; ``others`` are the flushes (fills) of the same buffer."""

    unflushed: Callable[[_Pairs], list[bool]]
    empty_flush: Callable[[_Pairs], list[bool]]
    reached: Callable[[Sequence[int]], list[bool]]


def by_structure(structure: Structure) -> Answer:
    """Walk from the prompt up to the plan."""
    prompts = prompts_of(structure.compiled)
    if prompts is None:
        return PromptFlow()
    paths, unit_of = Paths(structure), structure.unit_of

    def by_buffer(
        pairs: _Pairs, ask: Callable[[int, Avoiding], bool], *, tried: bool
    ) -> list[bool]:
        """The answers in order; what units can do without others is worked out once per buffer."""
        places: dict[tuple[int, ...], list[int]] = {}
        for place, (_, others) in enumerate(pairs):
            places.setdefault(others, []).append(place)
        possible = [False] * len(pairs)
        for others, members in places.items():
            without = Avoiding(structure, frozenset(others), tried=tried)
            for place in members:
                possible[place] = ask(unit_of[pairs[place][0]], without)
        return possible

    return _answer(
        prompts,
        _Questions(
            unflushed=lambda pairs: by_buffer(pairs, paths.completes_without_after, tried=False),
            empty_flush=lambda pairs: by_buffer(pairs, paths.triggered_without, tried=True),
            reached=lambda numbers: [structure.reached[unit_of[number]] for number in numbers],
        ),
    )


def by_solver(solver: Solver) -> Answer:
    """Ask for a scenario in which nothing comes after (before) it."""
    prompts = prompts_of(solver.compiled)
    if prompts is None:
        return PromptFlow()
    node = solver.automaton.runner_node
    return _answer(
        prompts,
        _Questions(
            unflushed=lambda pairs: solver.decide(
                [_unflushed_term(solver, number, others) for number, others in pairs]
            ),
            empty_flush=lambda pairs: solver.decide(
                [_empty_flush_term(solver, number, others) for number, others in pairs]
            ),
            reached=lambda numbers: solver.decide(
                [solver.encoding.triggered(node(number)) for number in numbers]
            ),
        ),
    )


def _unflushed_term(solver: Solver, number: int, others: Iterable[int]) -> str:
    """Completes, the instance succeeds, and each of the others that is tried may precede it."""
    encoding, automaton = solver.encoding, solver.automaton
    node = automaton.runner_node
    variant = solver.without([number])
    return conjunction(
        (
            encoding.triggered(automaton.complete),
            _succeeds(encoding, node(number)),
            *(
                disjunction(
                    (negation(encoding.triggered(node(other))), variant.triggered(node(other)))
                )
                for other in others
            ),
        )
    )


def _empty_flush_term(solver: Solver, number: int, others: Sequence[int]) -> str:
    """The instance succeeds, and would be triggered without the successes of the others."""
    encoding, node = solver.encoding, solver.automaton.runner_node(number)
    variant = solver.without(others, (Event.SUCCEEDED,))
    return conjunction((_succeeds(encoding, node), variant.triggered(node)))


def _succeeds(encoding: Encoding, node: int) -> str:
    return encoding.happens(Signal(node, Event.SUCCEEDED))


def unflushed_claim(automaton: Automaton, number: int, others: Sequence[int]) -> Claim:
    """A run that completes, in which no flush of the buffer comes after the instance."""
    node = automaton.runner_node

    def shows(evaluator: Evaluator, outcome_of: OutcomeOf) -> bool:
        run = evaluator.run(outcome_of)
        before = evaluator.run(outcome_of, withheld=(number,)).triggered
        return run.ends is End.COMPLETED and not any(
            node(other) in run.triggered and node(other) not in before for other in others
        )

    claim = Claim(
        happens=(Signal(node(number), Event.SUCCEEDED),),
        ends=End.COMPLETED,
        more=lambda solver: _unflushed_term(solver, number, others),
        failing=lambda s: s.failing_before(s.unit_of[number]),
        shows=shows,
    )

    def shown(evaluator: Evaluator, outcome_of: OutcomeOf) -> Claim:
        triggered = evaluator.run(outcome_of).triggered
        tried = [other for other in others if node(other) in triggered]
        idle = [node(other) for other in others if node(other) not in triggered]
        return replace(claim, meet=tuple(tried), held=(number,), absent=tuple(idle))

    return replace(claim, shown=shown)


def empty_flush_claim(automaton: Automaton, number: int, others: Sequence[int]) -> Claim:
    """A run in which the instance flushes a buffer that nothing has filled before."""
    node = automaton.runner_node(number)

    def filled(outcome_of: OutcomeOf) -> tuple[int, ...]:
        return tuple(other for other in others if outcome_of(other) is Outcome.SUCCEEDED)

    def shows(evaluator: Evaluator, outcome_of: OutcomeOf) -> bool:
        return node in evaluator.run(outcome_of, withheld=filled(outcome_of)).triggered

    claim = Claim(
        happens=(Signal(node, Event.SUCCEEDED),),
        more=lambda solver: _empty_flush_term(solver, number, others),
        failing=lambda s: s.failing_before(s.unit_of[number]),
        shows=shows,
    )
    return replace(
        claim,
        shown=lambda _, outcome_of: replace(claim, meet=(number,), held=filled(outcome_of)),
    )


def _answer(prompts: Prompts, ask: _Questions) -> Answer:
    fills, flushes = _fills(prompts), _flushes(prompts)
    answers = list(_empty_answers(prompts))
    alive = ask.reached([answer.runner for answer in answers])
    return PromptFlow(
        unflushed=_kept([number for number, _ in fills], ask.unflushed(fills)),
        empty_flush=_kept([number for number, _ in flushes], ask.empty_flush(flushes)),
        empty_answers=tuple(
            answer for answer, reached in zip(answers, alive, strict=True) if reached
        ),
    )


def _fills(prompts: Prompts) -> list[tuple[int, tuple[int, ...]]]:
    """The instances that fill a buffer, each with those that flush it."""
    return [
        (prompt.runner, others)
        for prompt in prompts.fills
        if (others := prompts.flushing(prompt.uuid or "")) is not None
    ]


def _flushes(prompts: Prompts) -> list[tuple[int, tuple[int, ...]]]:
    """The instances that flush a buffer, each with those that fill it."""
    return [
        (prompt.runner, others)
        for prompt in prompts.flushes
        if (others := prompts.filling(prompt.uuid or "")) is not None
    ]


def _kept(numbers: Sequence[int], answers: Sequence[bool]) -> tuple[int, ...]:
    return tuple(number for number, answer in zip(numbers, answers, strict=True) if answer)


def _empty_answers(prompts: Prompts) -> Iterator[EmptyAnswer]:
    values = prompts.values
    empty = {prompt.runner: prompt.answer for prompt in prompts.all if prompt.flush is False}
    for number, binding in enumerate(values.bindings):
        source = values.source[number]
        name = empty.get(source, "")
        if binding is None or not name or name not in (values.arriving[number] or ()):
            continue
        if knows(binding, name):
            yield EmptyAnswer(number, name, source)


def facts(answer: Answer | None, compiled: Compiled) -> Mapping[str, Any]:
    """No facts: the findings tell."""
    del answer, compiled
    return {}


def refute(answer: Answer, refutation: Refutation) -> None:
    """The other fills are flushed in all runs that complete, the other flushes find something."""
    prompts = prompts_of(refutation.compiled)
    if prompts is None:
        return
    circuit, node = refutation.circuit, refutation.automaton.runner_node
    whole = refutation.whole.fired if prompts.fills else ()
    for number, others in _fills(prompts):
        if number not in answer.unflushed:
            tried = (
                circuit.any((-whole[node(other)], refutation.snapshot.fired[node(other)]))
                for other in others
            )
            succeeds = refutation.active(number), refutation.outcome(number, True)
            done = whole[refutation.automaton.complete]
            refutation.never(circuit.all((*succeeds, done, *tried)))
    for number, others in _flushes(prompts):
        if number not in answer.empty_flush:
            held = (-refutation.filled(other) for other in others)
            fired = refutation.snapshot.fired[node(number)]
            refutation.never(circuit.all((fired, refutation.outcome(number, True), *held)))


def show(answer: Answer, witnesses: Witnesses) -> None:
    """Two runs each, one of which lacks the outcome of the fill, or those of all fills."""
    prompts = prompts_of(witnesses.structure.compiled)
    if prompts is None:
        return
    structure, node = witnesses.structure, witnesses.automaton.runner_node
    for number, others in _fills(prompts):
        if number in answer.unflushed:
            failing = frozenset(structure.failing_before(structure.unit_of[number]))
            whole, held = witnesses.lane(failing), witnesses.lane(failing, held=(number,))
            done = (witnesses.automaton.complete,)
            fill = (Signal(node(number), Event.SUCCEEDED),)
            witnesses.expect(whole, happens=fill, triggered=done)
            witnesses.expect_before(whole, held, tuple(map(node, others)))
    for number, others in _flushes(prompts):
        if number in answer.empty_flush:
            failing = frozenset(structure.failing_before(structure.unit_of[number]))
            flush = (Signal(node(number), Event.SUCCEEDED),)
            witnesses.expect(witnesses.lane(failing), happens=flush)
            fills = [other for other in others if other not in failing]
            witnesses.expect(witnesses.lane(failing, held=fills), triggered=(node(number),))


ANALYSIS = Analysis("prompts", by_structure, by_solver, facts, refute=refute, show=show)
