"""Which runners nothing needs any more: unit by unit it is the same as node by node."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

from hypothesis import given, settings
from hypothesis import strategies as st

from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.records import Input, Kind, Load, Start, Status, Stop
from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import Event
from tests.cases import many
from tests.execution.support import BEGIN, compiled_of, kinds
from tests.oracle import par_all, par_any, plan, rec, seq
from tests.strategies import faults, plans

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.execution.records import Record
    from tests import oracle

EVENTS = {Kind.STARTED: Event.STARTED, Kind.SUCCEEDED: Event.SUCCEEDED, Kind.FAILED: Event.FAILED}


def played(kernel: Kernel, luck: int) -> Iterator[list[Record]]:
    """The records of a run with random outcomes in a random order, input by input."""
    chance = random.Random(luck)  # noqa: S311
    pending = [BEGIN]
    while pending:
        records, commands = kernel.step(pending.pop(chance.randrange(len(pending))))
        for command in commands:
            if isinstance(command, Start):
                kind = chance.choice([Kind.SUCCEEDED, Kind.FAILED])
                pending.append(Input(kind, command.number))
            elif isinstance(command, Load):
                kind = Kind.LOADED if chance.random() < 0.9 else Kind.NOT_LOADED
                pending.append(Input(kind, runner=command.runner))
            elif isinstance(command, Stop):
                pending.append(Input(Kind.STOPPED, command.number))
        yield records


@settings(max_examples=many(200))
@given(whole=plans(max_runners=25), luck=st.integers(0, 1000), models=faults())
def test_it_is_the_same_as_node_by_node(whole: oracle.P, luck: int, models: frozenset[str]) -> None:
    compiled = compiled_of(whole, models)
    by_node = Kernel(compiled)
    by_node._pruning._by_unit = False
    assert list(played(Kernel(compiled), luck)) == list(played(by_node, luck))


def possible(kernel: Kernel, seen: list[Record]) -> set[int]:
    """The nodes that are or may be triggered, after what has happened; brute force."""
    automaton = kernel.automaton
    ended = {record.node for record in seen if record.kind in (Kind.SUCCEEDED, Kind.FAILED)}
    came = {Signal(record.node, EVENTS[record.kind]) for record in seen if record.kind in EVENTS}
    peaks = {0}
    while True:
        may = {
            signal
            for inputs in automaton.inputs
            for signal in inputs
            if signal in came or (signal.node in peaks and signal.node not in ended)
        }
        more = {
            node.index
            for node, inputs in zip(automaton.nodes, automaton.inputs, strict=True)
            if sum(signal in may for signal in inputs) >= (node.need or 1)
        }
        if more <= peaks:
            return peaks
        peaks |= more


@given(whole=plans(max_runners=10), luck=st.integers(0, 1000))
def test_what_is_loaded_is_what_some_instance_may_need(whole: oracle.P, luck: int) -> None:
    kernel = Kernel(compiled_of(whole))
    seen: list[Record] = []
    for records in played(kernel, luck):
        seen += records
        if kernel.status is not Status.RUNNING:
            return
        ended = {record.node for record in seen if record.kind in (Kind.SUCCEEDED, Kind.FAILED)}
        needed = {
            kernel.runner_of[node - 1]
            for node in possible(kernel, seen) - ended
            if kernel.automaton.nodes[node].kind is NodeKind.RUNNER
        }
        assert set(kernel.loaded) <= needed


def test_several_at_once_go_in_the_order_of_their_last_users() -> None:
    units = par_all(seq("A", "B", "C"), seq("B", "C", "A"))
    kernel = Kernel(compiled_of(plan(par_all("A", "B", "C"), "D", rec(units, "B"), "D")))
    records = kernel.step(BEGIN)[0]
    for runner in range(3):
        records += kernel.step(Input(Kind.LOADED, runner=runner))[0]
    for number in range(3):
        records += kernel.step(Input(Kind.SUCCEEDED, number))[0]
    kernel.step(Input(Kind.LOADED, runner=3))
    # D succeeds: of the recovery nothing is needed any more
    events = kinds(kernel.step(Input(Kind.SUCCEEDED, 3))[0])
    assert sorted(events[1:4]) == ["UNLOADED r0", "UNLOADED r1", "UNLOADED r2"]
    by_node = Kernel(kernel.compiled)
    by_node._pruning._by_unit = False
    by_node.step(BEGIN)
    for runner in range(3):
        by_node.step(Input(Kind.LOADED, runner=runner))
    for number in range(3):
        by_node.step(Input(Kind.SUCCEEDED, number))
    by_node.step(Input(Kind.LOADED, runner=3))
    assert kinds(by_node.step(Input(Kind.SUCCEEDED, 3))[0]) == events


def test_a_unit_that_is_passed_over_costs_as_much_as_a_small_one() -> None:
    large = par_all(*(par_any("B", seq("B", "C")) for _ in range(500)))
    kernel = Kernel(compiled_of(plan("A", rec(large), "B", "C")))
    for happened in (BEGIN, Input(Kind.LOADED, runner=0), Input(Kind.SUCCEEDED, 0)):
        kernel.step(happened)
    assert kernel.pruned <= 2 * len(kernel.runners)
