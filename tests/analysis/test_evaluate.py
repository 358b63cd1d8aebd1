"""The evaluator and the compiler against the oracle's, run by run."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.analysis.evaluate import Evaluator
from gpsfsm.compile import compile_plan
from gpsfsm.model.automaton import Signal
from gpsfsm.model.event import Event, Outcome
from tests import oracle
from tests.strategies import faults, plans
from tests.support import plan_of


@given(data=st.data(), whole=plans(), models=faults())
def test_every_run_is_that_of_the_oracle(
    data: st.DataObject, whole: oracle.P, models: frozenset[str]
) -> None:
    plan = plan_of(whole)
    automaton = compile_plan(plan, start_chain="no-start" in models).automaton
    system = oracle.System(whole, models)
    kinds = st.sampled_from(sorted(system.kinds))
    outcomes = tuple(data.draw(kinds) for _ in system.paths)
    wanted = system.run(outcomes)
    run = Evaluator(automaton).run(lambda number: Outcome(outcomes[number]))
    assert run.ends == wanted.ends
    assert run.failures == wanted.failures
    for node in automaton.runners:
        path = plan.path(node.origin)
        assert (node.index in run.triggered) == wanted.triggers(path)
        assert run.happens(Signal(node.index, Event.FAILED)) == wanted.emits_failed(path)


@given(data=st.data(), whole=plans())
def test_what_is_sure_happens_and_what_happens_is_possible(
    data: st.DataObject, whole: oracle.P
) -> None:
    automaton = compile_plan(plan_of(whole)).automaton
    evaluator = Evaluator(automaton)
    choice = st.sampled_from([Outcome.SUCCEEDED, Outcome.FAILED])
    outcomes = [data.draw(choice) for _ in automaton.runners]
    fixed = {
        number: outcomes[number] for number in range(len(outcomes)) if data.draw(st.booleans())
    }
    run = evaluator.run(outcomes.__getitem__)
    assert set(evaluator.surely(fixed).triggered) <= set(run.triggered)
    assert set(run.triggered) <= set(evaluator.possibly(fixed).triggered)


@given(whole=plans())
def test_events_come_after_their_causes(whole: oracle.P) -> None:
    automaton = compile_plan(plan_of(whole)).automaton
    run = Evaluator(automaton).run(lambda _: Outcome.SUCCEEDED)
    for node in automaton.runners:
        done = Signal(node.index, Event.SUCCEEDED)
        if run.happens(done):
            assert run.place(Signal(node.index, Event.STARTED)) < run.place(done)
            causes = [run.place(signal) for signal in automaton.inputs[node.index]]
            assert min(causes) < run.place(Signal(node.index, Event.STARTED))
