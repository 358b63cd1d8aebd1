"""Data flow: values that are missing, overwritten, lost, of the wrong type or read by nobody."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from gpsfsm.analysis.decisions import Analysis
from gpsfsm.analysis.encode import conjunction
from gpsfsm.analysis.flow import How, Values, knows, placeholder
from gpsfsm.analysis.structure import Paths
from gpsfsm.model.automaton import Signal
from gpsfsm.model.capability import ValueType
from gpsfsm.model.event import Event

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from gpsfsm.analysis.proof.refutation import Refutation
    from gpsfsm.analysis.proof.witnesses import Witnesses
    from gpsfsm.analysis.solver import Solver
    from gpsfsm.analysis.structure import Structure
    from gpsfsm.compile import Compiled
    from gpsfsm.model.capability import Binding


class Missing(NamedTuple):
    """A need that is missing in some run that triggers the instance."""

    runner: int
    name: str
    kind: Literal["parameter", "input"]
    how: How


class Overwritten(NamedTuple):
    """An attribute that a value from ``source`` replaces."""

    runner: int
    name: str
    how: How
    source: int


class Lost(NamedTuple):
    """An output that a later instance wants and never gets."""

    source: int
    name: str
    event: Event
    runner: int


class Mismatch(NamedTuple):
    """A value that arrives and does not fit what the instance expects."""

    runner: int
    name: str
    source: int
    arriving: ValueType
    wanted: ValueType


class Unused(NamedTuple):
    """Outputs of an instance that no direct successor reads; status outputs left out."""

    runner: int
    names: tuple[str, ...]


class DataFlow(NamedTuple):
    """All answers, each in document order of the instances; numbers are runner numbers."""

    missing: tuple[Missing, ...] = ()
    overwritten: tuple[Overwritten, ...] = ()
    lost: tuple[Lost, ...] = ()
    mismatched: tuple[Mismatch, ...] = ()
    unused: tuple[Unused, ...] = ()


Answer = DataFlow

_NEAREST = 50
"""Producers of one name that are considered for a consumer: those right before it."""


def by_structure(structure: Structure) -> Answer:
    """An instance that is reached is reached through its one connection."""
    compiled = structure.compiled
    unit_of = structure.unit_of

    def reached(numbers: Sequence[int]) -> list[bool]:
        return [structure.reached[unit_of[number]] for number in numbers]

    def together(pairs: Sequence[Lost]) -> list[bool]:
        paths = Paths(structure)
        return [
            paths.happen_together(
                unit_of[pair.source], pair.event is Event.SUCCEEDED, unit_of[pair.runner]
            )
            for pair in pairs
        ]

    return _answer(compiled, reached, together)


def by_solver(solver: Solver) -> Answer:
    """Ask for a scenario that triggers the instance, and one with both for what is lost."""
    encoding, automaton = solver.encoding, solver.automaton

    def reached(numbers: Sequence[int]) -> list[bool]:
        return solver.decide(
            [encoding.triggered(automaton.runner_node(number)) for number in numbers]
        )

    def together(pairs: Sequence[Lost]) -> list[bool]:
        return solver.decide(
            [
                conjunction(
                    (
                        encoding.happens(Signal(automaton.runner_node(pair.source), pair.event)),
                        encoding.triggered(automaton.runner_node(pair.runner)),
                    )
                )
                for pair in pairs
            ]
        )

    return _answer(solver.compiled, reached, together)


def _answer(
    compiled: Compiled,
    reached: Callable[[Sequence[int]], list[bool]],
    together: Callable[[Sequence[Lost]], list[bool]],
) -> Answer:
    if not any(compiled.bindings):
        return DataFlow()
    values = Values(compiled)
    flow = DataFlow(
        missing=tuple(_missing(values)),
        overwritten=tuple(_overwritten(values)),
        lost=tuple(_lost(values)),
        mismatched=tuple(_mismatched(values)),
        unused=tuple(_unused(values)),
    )
    concerned = sorted(
        {entry.runner for part in (flow[0], flow[1], flow[3], flow[4]) for entry in part}
    )
    alive = {
        number
        for number, is_reached in zip(concerned, reached(concerned), strict=True)
        if is_reached
    }
    return DataFlow(
        missing=tuple(entry for entry in flow.missing if entry.runner in alive),
        overwritten=tuple(entry for entry in flow.overwritten if entry.runner in alive),
        lost=tuple(
            entry
            for entry, both in zip(flow.lost, together(flow.lost) if flow.lost else (), strict=True)
            if both
        ),
        mismatched=tuple(entry for entry in flow.mismatched if entry.runner in alive),
        unused=tuple(entry for entry in flow.unused if entry.runner in alive),
    )


def _described(values: Values) -> Iterator[tuple[int, Binding]]:
    for number, binding in enumerate(values.bindings):
        if binding is not None:
            yield number, binding


def _missing(values: Values) -> Iterator[Missing]:
    for number, _ in _described(values):
        for need, how in values.unmet(number):
            yield Missing(number, need.name, need.kind, how)


def _overwritten(values: Values) -> Iterator[Overwritten]:
    for number, binding in _described(values):
        for name, output in (values.arriving[number] or {}).items():
            if name in binding.written and knows(binding, name):
                how: How = "sometimes" if output.optional else "always"
                yield Overwritten(number, name, how, values.source[number])


def _lost(values: Values) -> Iterator[Lost]:
    """The outputs that instances before it hand over under a name that an instance wants."""
    producers: dict[str, list[tuple[int, Event]]] = {}
    for number, binding in _described(values):
        for name in _wanted(values, number, binding):
            for source, event in producers.get(name, ())[-_NEAREST:]:
                yield Lost(source, name, event, number)
        for output in binding.provider.outputs:
            producers.setdefault(output.name, []).append((number, output.event))


def _wanted(values: Values, number: int, binding: Binding) -> Iterator[str]:
    """The names under which an instance goes without what it wants."""
    arriving = values.arriving[number]
    if arriving is None:
        return
    # what is missing only sometimes arrives, and so is not lost
    wanted = {need.name for need, _ in values.unmet(number)}
    for name, attribute in binding.written.items():
        if name not in arriving and knows(binding, name) and placeholder(attribute.text):
            wanted.add(name)
    yield from sorted(wanted - set(arriving))


def _mismatched(values: Values) -> Iterator[Mismatch]:
    for number, binding in _described(values):
        for name, output in (values.arriving[number] or {}).items():
            wanted = _expected(binding, name)
            if wanted is not None and not _fits(output.type, wanted):
                yield Mismatch(number, name, values.source[number], output.type, wanted)


def _expected(binding: Binding, name: str) -> ValueType | None:
    """The type under which an instance reads a value; None if it reads none of this name."""
    if not knows(binding, name):
        return None
    expected = binding.provider.input(name) or binding.provider.parameter(name)
    return None if expected is None else expected.type


def _fits(arriving: ValueType, wanted: ValueType) -> bool:
    """True if a value of one type can stand where another is expected; text takes any scalar."""
    if ValueType.ANY in (arriving, wanted) or arriving is wanted:
        return True
    if wanted is ValueType.STRING:
        return not arriving.endswith("[]")
    return (arriving, wanted) in (
        (ValueType.INT, ValueType.DOUBLE),
        (ValueType.INTS, ValueType.DOUBLES),
    )


def _unused(values: Values) -> Iterator[Unused]:
    read: set[tuple[int, str]] = set()
    unknown: set[int] = set()
    for number, source in enumerate(values.source):
        binding = values.bindings[number]
        if source < 0 or values.event[number] is Event.STARTED:
            continue
        if binding is None:
            unknown.add(source)
            continue
        read.update(
            (source, name) for name in values.arriving[number] or () if knows(binding, name)
        )
    for number, binding in _described(values):
        outputs = [output.name for output in binding.provider.outputs if not output.status]
        names = tuple(name for name in dict.fromkeys(outputs) if (number, name) not in read)
        if names and number not in unknown:
            yield Unused(number, names)


def facts(answer: Answer | None, compiled: Compiled) -> Mapping[str, Any]:
    """No facts: the findings tell."""
    del answer, compiled
    return {}


def refute(answer: Answer, refutation: Refutation) -> None:
    """No output comes in one run with an instance that is not among those that go without it.

    What is left out because its instance is never triggered, reachability refutes.
    """
    if not any(refutation.compiled.bindings):
        return
    node, lost = refutation.automaton.runner_node, frozenset(answer.lost)
    for pair in _lost(Values(refutation.compiled)):
        if pair not in lost:
            snapshot = refutation.snapshot
            output = snapshot.happens(Signal(node(pair.source), pair.event))
            wanted = snapshot.fired[node(pair.runner)]
            refutation.never(refutation.circuit.all((output, wanted)))


def show(answer: Answer, witnesses: Witnesses) -> None:
    """A run with the output and the instance that goes without it."""
    structure, node = witnesses.structure, witnesses.automaton.runner_node
    for source, _, event, runner in answer.lost:
        failing = {
            *structure.failing_before(structure.unit_of[source]),
            *structure.failing_before(structure.unit_of[runner]),
            *((source,) if event is Event.FAILED else ()),
        }
        happens = (Signal(node(source), event),)
        witnesses.expect(witnesses.lane(failing), happens=happens, triggered=(node(runner),))


ANALYSIS = Analysis("data_flow", by_structure, by_solver, facts, refute=refute, show=show)
