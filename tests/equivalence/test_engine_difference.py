"""Where a plan does something else on an engine, against a brute force over all outcomes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import example, given

from gpsfsm.compile import compile_plan
from gpsfsm.equivalence.engine_difference import difference_on_engine
from gpsfsm.model.event import Event
from tests.engines.plans import plans
from tests.engines.test_facts import both, reading_of
from tests.oracle.engine import Machine

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.compile.engine_text import EngineReading
    from gpsfsm.model.automaton import Automaton

Prefix = tuple[tuple[int, bool], ...]

Seen = tuple[frozenset[int], str, frozenset[int]]
"""What starts at the instant of the last outcome, how the run ends then, and what is active."""


def react(reading: EngineReading, paper: Automaton, prefix: Prefix) -> tuple[Seen, Seen]:
    """What both do with these outcomes, one after the other."""
    return _paper(paper, prefix), _engine(reading, prefix)


def _paper(automaton: Automaton, prefix: Prefix) -> Seen:
    """Events spread along edges; a join fires at its need, an end is final."""
    active: set[int] = set()
    before: set[int] = set()
    counts: dict[int, int] = {}
    end: list[str] = []

    def emit(node: int, event: Event) -> None:
        for source, name, target in automaton.edges:
            if (source, name) != (node, event):
                continue
            if target == automaton.complete:
                end.append("COMPLETED")
            elif target == automaton.give_up:
                end.append("LOST")
            elif automaton.nodes[target].need:
                counts[target] = counts.get(target, 0) + 1
                if counts[target] == automaton.nodes[target].need:
                    emit(target, Event.SUCCEEDED)
            else:
                active.add(target - 1)

    emit(0, Event.SUCCEEDED)
    for number, succeeds in prefix:
        active.discard(number)
        before = set(active)
        emit(number + 1, Event.SUCCEEDED if succeeds else Event.FAILED)
    return frozenset(active - before), end[0] if end else "", frozenset(active)


def _engine(reading: EngineReading, prefix: Prefix) -> Seen:
    """The connections, played with these outcomes."""
    machine = Machine(reading.connections)
    elements = sorted(machine.of[number].source.element or 0 for number in machine.leaves)
    leaf = {machine.of[number].source.element: number for number in machine.leaves}
    number_of = {leaf[element]: index for index, element in enumerate(elements)}
    active: set[int] = set()
    before: set[int] = set()
    counts: dict[int, int] = {}
    end: list[str] = []

    def trigger(target: object) -> None:
        instance = getattr(target, "instance", None)
        if instance is None or end or not target.named:  # type: ignore[attr-defined]
            return
        if instance in machine.done:
            end.append("COMPLETED")
        elif instance in machine.leaves:
            active.add(number_of[instance])
            if machine._starts(instance):
                trigger(machine.of[instance].on_start)
        else:
            counts[instance] = counts.get(instance, 0) + 1
            kind = machine.of[instance].source.interface
            if counts[instance] > 1 and not kind.endswith("AllRunner"):
                end.append("ABORT")
            elif counts[instance] == machine._expected(machine.of[instance]):
                trigger(machine.of[instance].on_success)

    trigger(None if machine.begin is None else machine.begin.source)
    for number, succeeds in prefix:
        active.discard(number)
        before = set(active)
        connection = machine.of[leaf[elements[number]]]
        trigger(connection.on_success if succeeds else connection.on_failure)
        if not active and not end:
            end.append("LOST")
    return frozenset(active - before), end[0] if end else "", frozenset(active)


def differing(reading: EngineReading, paper: Automaton) -> Iterator[Prefix]:
    """All shortest histories after which the two are not alike."""
    pending: list[Prefix] = [()]
    while pending:
        prefix = pending.pop()
        here, there = react(reading, paper, prefix)
        (*reaction, active), (*other, _) = here, there
        if reaction != other:
            yield prefix
        elif "" in reaction:
            pending += [(*prefix, (number, good)) for number in active for good in (True, False)]


AT_ONCE = (  # the parallel_any holds an empty control, and so succeeds as it begins
    '<Plan><Control type="parallel_any"><Runner interface="a/A" provider="a/A"/>'
    '<Control type="sequential"><Control type="recovery"><Runner interface="a/A" provider="a/A"/>'
    "</Control></Control></Control></Plan>"
)


@both
@given(text=plans(most=4))
@example(AT_ONCE)
def test_difference(engine: str, text: str) -> None:
    compare_with_all_histories(engine, text)


@given(text=plans(most=3, empty=True))
def test_difference_where_controls_are_empty(text: str) -> None:
    """The second version refuses such plans."""
    compare_with_all_histories("fabric-v1", text)


def compare_with_all_histories(engine: str, text: str) -> None:
    reading = reading_of(text, engine)
    paper = compile_plan(reading.plan)
    compared = difference_on_engine(paper, reading.compiled)
    changed = sorted(
        differing(reading, paper.automaton),
        key=lambda prefix: (sum(not good for _, good in prefix), len(prefix)),
    )
    assert compared.decided
    if not changed:
        assert compared.difference is None
        return
    assert compared.difference is not None
    steps = tuple((number, event is Event.SUCCEEDED) for number, event in compared.difference.steps)
    assert steps in changed
    failures = sum(not good for _, good in steps)
    assert (failures, len(steps)) == (sum(not good for _, good in changed[0]), len(changed[0]))


@pytest.mark.parametrize("most", [1, 3])
def test_a_limit_is_no_answer(most: int) -> None:
    steps = "".join(f'<Runner interface="a/R{number}" provider="a/P"/>' for number in range(9))
    reading = reading_of(f"<Plan>{steps}</Plan>", "fabric-v2")
    compared = difference_on_engine(compile_plan(reading.plan), reading.compiled, most=most)
    assert not compared.decided
    assert compared.difference is None
