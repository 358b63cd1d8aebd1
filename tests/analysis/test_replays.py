"""Replays that share work against runs that are played event by event, and alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

import gpsfsm
from corpus import generate
from gpsfsm.analysis import evaluate
from gpsfsm.analysis.evaluate import KEPT, Evaluator, code_of, signal_of
from gpsfsm.compile import compile_plan
from gpsfsm.errors import InternalError
from gpsfsm.model.automaton import Automaton, Edge, Node, NodeKind, Signal, Traits
from gpsfsm.model.event import End, Event, Outcome
from tests import oracle
from tests.analysis.plain_play import POSSIBLE, SURE, play
from tests.strategies import plans
from tests.support import plan_of

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from hypothesis.strategies import DrawFn

    from gpsfsm.analysis.evaluate import Run

EVENTS = st.sampled_from([Event.STARTED, Event.SUCCEEDED, Event.FAILED])
OUTCOMES = st.sampled_from(Outcome)
PLAN = plan_of(oracle.P(()))


@st.composite
def automata(draw: DrawFn) -> Automaton:
    """Automata that no plan needs to say: events used twice, k of n, engines that break."""
    runners, joins = draw(st.integers(1, 5)), draw(st.integers(0, 4))
    complete = 1 + runners + joins
    inner = draw(st.permutations(range(1, complete)))
    edges: list[Edge] = []
    for place, target in enumerate([*inner, complete, complete + 1]):
        before = [0, *inner[:place]]
        for source in draw(st.lists(st.sampled_from(before), min_size=1, max_size=4)):
            event = draw(EVENTS) if 0 < source <= runners else Event.SUCCEEDED
            edges.append(Edge(source, event, target))
    inputs = [sum(edge.target == node for edge in edges) for node in range(complete + 2)]
    nodes = [Node(0, NodeKind.START, 0)]
    nodes += (Node(index, NodeKind.RUNNER, 0) for index in range(1, 1 + runners))
    for join in range(1 + runners, complete):
        nodes.append(Node(join, NodeKind.JOIN, 0, draw(st.integers(1, inputs[join]))))
    nodes += (Node(complete, NodeKind.COMPLETE, 0), Node(complete + 1, NodeKind.GIVE_UP, 0))
    some = st.sets(st.sampled_from(range(1 + runners, complete)) if joins else st.nothing())
    traits = Traits(
        engine="drawn",
        refusals_hang=draw(st.booleans()),
        silent=frozenset(draw(st.sets(st.integers(1, runners)))),
        breaking=frozenset(draw(some)),
    )
    return Automaton.of(PLAN, nodes, edges, traits=traits)


@st.composite
def cases(draw: DrawFn) -> tuple[Automaton, dict[int, Outcome], set[int]]:
    """An automaton, decisions about some of its runners, and those that are withheld."""
    automaton = draw(automata() | plans().map(lambda each: compile_plan(plan_of(each)).automaton))
    numbers = st.integers(0, max(0, len(automaton.runners) - 1))
    decisions = draw(st.dictionaries(numbers, OUTCOMES))
    return automaton, decisions, draw(st.sets(numbers, max_size=2))


def run_of(
    automaton: Automaton, decisions: Mapping[int, Outcome], withheld: Collection[int], kind: str
) -> Run | None:
    """None where the engine breaks in a manner that no compiled plan has."""
    evaluator = Evaluator(automaton)
    try:
        if kind == "run":
            return evaluator.run(
                lambda number: decisions.get(number, Outcome.FAILED), withheld=withheld
            )
        if kind == "surely":
            return evaluator.surely(decisions, withheld=withheld)
        return evaluator.possibly(decisions, withheld=withheld)
    except InternalError:
        return None


@pytest.mark.parametrize("kind", ["run", "surely", "possibly"])
@given(case=cases())
def test_events_come_in_the_order_of_the_queue(
    case: tuple[Automaton, dict[int, Outcome], set[int]], kind: str
) -> None:
    automaton, decisions, withheld = case
    if kind == "run":
        others = dict.fromkeys(range(len(automaton.runners)), Outcome.FAILED)
        wanted = play(automaton, others | decisions, SURE, withheld)
    else:
        undecided = SURE if kind == "surely" else POSSIBLE
        wanted = play(automaton, decisions, undecided, withheld)
    broken = wanted.broken(automaton)
    run = run_of(automaton, decisions, withheld, kind)
    if run is None:
        assert broken
        assert automaton.complete not in wanted.triggered
        return
    assert list(map(signal_of, run.order)) == list(wanted.events)
    assert list(run.order.values()) == list(range(len(run)))
    assert list(run.triggered) == list(wanted.triggered)
    assert run.broken == broken
    assert (run.ends is End.ABORT) == (not broken.isdisjoint(automaton.deadly))
    assert run.failures == sum(signal.event is Event.FAILED for signal in wanted.events)


@given(data=st.data(), case=cases())
def test_what_is_prevented_is_what_is_not_possible(
    data: st.DataObject, case: tuple[Automaton, dict[int, Outcome], set[int]]
) -> None:
    automaton, decisions, withheld = case
    evaluator = Evaluator(automaton)
    possible = set(play(automaton, decisions, POSSIBLE, withheld).triggered)
    nodes = range(1, len(automaton.nodes))
    codes = [code_of(Signal(source, event)) for source, event, _ in automaton.edges]
    some = data.draw(st.sets(st.sampled_from(codes))) if codes else set()
    for node in nodes:
        assert evaluator.prevented([node], decisions, withheld=withheld) == (node not in possible)
        if node in possible:  # then no hint makes it absent
            assert not evaluator.prevented([node], decisions, withheld=withheld, happening=some)
    absent = [node for node in nodes if node not in possible]
    assert evaluator.prevented(absent, decisions, withheld=withheld)


@given(data=st.data(), whole=plans())
def test_a_run_with_these_decisions_hides_no_absence(data: st.DataObject, whole: oracle.P) -> None:
    automaton = compile_plan(plan_of(whole)).automaton
    evaluator = Evaluator(automaton)
    outcomes = [data.draw(OUTCOMES) for _ in automaton.runners]
    decisions = {each: outcomes[each] for each in range(len(outcomes)) if data.draw(st.booleans())}
    run = evaluator.run(outcomes.__getitem__)
    for node in range(1, len(automaton.nodes)):
        assert evaluator.prevented([node], decisions) == evaluator.prevented(
            [node], decisions, happening=run.order
        )


def test_codes_stand_for_events() -> None:
    signals = [Signal(node, event) for node in (0, 1, 7) for event in Event]
    assert [signal_of(code_of(signal)) for signal in signals] == signals
    assert len(set(map(code_of, signals))) == len(signals)


def evaluator_of(text: str) -> tuple[Evaluator, int]:
    reading = gpsfsm.parse(text)
    assert reading.plan is not None
    automaton = compile_plan(reading.plan).automaton
    return Evaluator(automaton), len(automaton.runners)


def scenarios(evaluator: Evaluator, size: int) -> Sequence[evaluate.OutcomeOf]:
    kept = []
    for number in range(KEPT + 1):
        outcomes = [Outcome.SUCCEEDED] * size
        outcomes[number] = Outcome.FAILED
        kept.append(tuple(outcomes).__getitem__)
    return kept


def test_the_runs_of_the_latest_scenarios_are_kept() -> None:
    evaluator, size = evaluator_of(generate.chain(10))
    first, *others = scenarios(evaluator, size)
    assert evaluator.run(first) is not evaluator.run(first)
    evaluator.keep(first)
    run = evaluator.run(first)
    assert evaluator.run(first) is run
    held = evaluator.run(first, withheld=(3, 1))
    assert held is not run
    assert evaluator.run(first, withheld={1, 3}) is held
    for other in others:
        evaluator.keep(other)
    assert evaluator.run(first) is not run


def test_long_runs_are_not_kept_for_long(monkeypatch: pytest.MonkeyPatch) -> None:
    evaluator, size = evaluator_of(generate.chain(10))
    monkeypatch.setattr(evaluate, "_MAX_EVENTS", 5)
    first, second, *_ = scenarios(evaluator, size)
    evaluator.keep(first)
    run = evaluator.run(first)
    evaluator.keep(first)
    assert evaluator.run(first) is run  # that of the scenario in hand
    evaluator.keep(second)
    assert evaluator.run(first) is not run


@pytest.mark.parametrize(
    "text",
    [
        generate.nested(4, 2),
        generate.nested(3, 3),
        generate.random(3, 40),
        generate.random(5, 40),
        generate.chain(12),
        generate.fanout(5),
    ],
)
@pytest.mark.parametrize("engine", ["paper", "fabric-v2"])
def test_what_is_shared_changes_no_report(
    text: str, engine: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    shared = gpsfsm.check(text, engine=engine).to_dict()
    monkeypatch.setattr(Evaluator, "keep", lambda *_: None)
    assert gpsfsm.check(text, engine=engine).to_dict() == shared
